"""How far predictions may be off: against many models drawn from the covariance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrated import POSES, ROBOT, model_of

from seecr import InputFileError, Term, Terms, solve, spread_of
from seecr.files import json_text
from seecr.pose import pose_difference
from seecr.prediction.uncertainty import covariance_of
from seecr.show.batch_words import sweep_lines
from seecr.show.files import SweepRows
from seecr.show.pose_words import cable_lines, pose_lines
from seecr.units import with_error

MODEL = """format = 1
[[effect]]
name = "stiffness"
[effect.parameters]
factor = { value = 0.9, stderr = 0.05 }
[[effect]]
name = "tracker_target"
[effect.parameters]
shift_m = { value = 0.0, stderr = 0.01 }
rotation_rad = { value = 0.0, stderr = 0.0 }
[[effect]]
name = "platform_mass"
[effect.parameters]
added_kg = { value = 0.05, stderr = 0.02 }
[calibration]
parameters = ["platform_mass.added_kg", "stiffness.factor", "gone.away"]
correlation = [
    [1.0],
    [0.8, 1.0],
    [0.1, 0.2, 1.0],
]
"""


def test_the_covariance_is_put_together_by_name(tmp_path: Path) -> None:
    covariance = covariance_of(model_of(tmp_path, MODEL))
    assert covariance is not None and covariance.shape == (8, 8)
    # terms stand in the order in which they act, not as in the file
    expected = np.diag([0.05, 0.02, 0.01, 0.01, 0.01, 0.0, 0.0, 0.0]) ** 2
    expected[0, 1] = expected[1, 0] = 0.8 * 0.05 * 0.02
    np.testing.assert_allclose(covariance, expected, atol=1e-18)


def test_an_effect_put_beside_those_of_the_file_has_no_known_errors(tmp_path: Path) -> None:
    """A model with other terms ended in a KeyError wherever it was shown or kept."""
    model = model_of(tmp_path, MODEL)
    pulley = Term.of(ROBOT, "pulley_radius", radius_m=0.01)
    more = replace(model, terms=Terms([*model.terms, pulley]))
    new = [row for row in more.records() if row["effect"] == "pulley_radius"]
    assert [(row["value"], row["stderr"]) for row in new] == [(0.01, None)]
    assert json_text(more.as_json()).count('"pulley_radius"') == 1
    had, now = covariance_of(model), covariance_of(more)
    assert had is not None and now is not None
    kept = [effect != "pulley_radius" for effect, _key in more.terms.labels]
    np.testing.assert_array_equal(now[np.ix_(kept, kept)], had)
    assert not now[~np.array(kept)].any()


@pytest.mark.slow
def test_many_models_drawn_from_it_spread_as_said(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL)
    spread = spread_of(ROBOT, POSES, model)
    covariance = covariance_of(model)
    assert spread is not None and covariance is not None
    small = 0.1  # first order holds
    drawn = np.random.default_rng(1).multivariate_normal(
        model.terms.vector, small**2 * covariance, 600
    )
    own = solve(ROBOT, POSES, effects=model)
    poses, tensions = [], []
    for vector in drawn:
        terms: Terms = model.terms.with_vector(vector).without("tracker_target")
        found = solve(ROBOT, POSES, effects=terms)
        poses.append(pose_difference(found.pose, own.pose))
        tensions.append(found.tensions)
    said = np.concatenate([spread.position, spread.rotation, spread.tensions], axis=1)
    seen = np.concatenate([np.std(poses, axis=0), np.std(tensions, axis=0)], axis=1) / small
    seen_at_all = seen > 1e-3 * seen.max(axis=1, keepdims=True)
    np.testing.assert_allclose(said[seen_at_all], seen[seen_at_all], rtol=0.1)
    # what the tracker reads hangs on its target too, which no pose does
    target = np.sqrt(spread.position**2 + 0.01**2)
    np.testing.assert_allclose(spread.seen[:, :3], target, rtol=1e-3)
    np.testing.assert_allclose(spread.seen[:, 3:], spread.rotation, rtol=1e-3)
    # correlation counts: heavier and stiffer go together here, and the sag hardly changes
    apart = spread_of(ROBOT, POSES, model_of(tmp_path, MODEL.replace("[0.8, 1.0]", "[-0.8, 1.0]")))
    assert apart is not None and np.all(apart.position[:, 2] > 1.5 * spread.position[:, 2])


def test_history_is_walked(tmp_path: Path) -> None:
    text = """format = 1
[[effect]]
name = "backlash"
[effect.parameters]
gap_m = { value = 0.001, stderr = 0.0002 }
[calibration]
parameters = ["backlash.gap_m"]
correlation = [[1.0]]
"""
    spread = spread_of(ROBOT, POSES, model_of(tmp_path, text))
    assert spread is not None and 1e-5 < np.linalg.norm(spread.position[1]) < 1e-3


def test_without_a_covariance_nothing_is_said(tmp_path: Path) -> None:
    assert spread_of(ROBOT, POSES, model_of(tmp_path, MODEL.partition("[calib")[0])) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [("[0.8, 1.0],", "[0.8, 0.9],"), ("[0.8, 1.0],", "[1.8, 1.0],"), ("[0.8, 1.0],", ""),
     ('"gone.away"', ""), ("[0.1, 0.2, 1.0]", "[0.99, -0.99, 1.0]"), ("[1.0]", '["a"]'),
     ("[1.0]", "[1" + 400 * "0" + "]")],
)  # fmt: skip
def test_correlations_that_are_none_are_one_sentence(tmp_path: Path, old: str, new: str) -> None:
    model = model_of(tmp_path, MODEL.replace(old, new))
    with pytest.raises(InputFileError, match=r"model.toml: line 17: correlation: expected .* rows"):
        spread_of(ROBOT, POSES, model)


@pytest.mark.parametrize("label", ["stiffness.foo", "platform_mass.added_kg"])
def test_correlations_are_of_parameters_that_there_are(tmp_path: Path, label: str) -> None:
    """Without one, its value would go with nothing, and answers be said to be less sure."""
    model = model_of(tmp_path, MODEL.replace('"stiffness.factor"', f'"{label}"'))
    with pytest.raises(
        InputFileError, match=rf"line 15: \[calibration\] parameters: .* got '{label}'"
    ):
        covariance_of(model)


def test_errors_in_full_are_one_for_each_parameter(tmp_path: Path) -> None:
    full = MODEL.replace("correlation =", "stderr = [0.0201, 0.05]\ncorrelation =")
    with pytest.raises(InputFileError, match=r"line 17: stderr: expected 3 numbers, .* got 2"):
        covariance_of(model_of(tmp_path, full))
    with pytest.raises(InputFileError, match="stderr: expected 3 numbers, one for each"):
        covariance_of(model_of(tmp_path, full.replace("[0.0201, 0.05]", "0.05")))
    for wrong in ('"a"', "-0.1", "nan", "inf"):
        with pytest.raises(InputFileError, match="stderr: expected numbers from 0 on, or 'unseen'"):
            covariance_of(model_of(tmp_path, full.replace("0.05]", f"0.05, {wrong}]")))
    # one of another size than stands with the value is not that of this value
    found = covariance_of(model_of(tmp_path, full.replace("0.05]", "0.0503, 1.0]")))
    assert found is not None
    assert np.sqrt(np.diag(found))[:2] == pytest.approx([0.0503, 0.0201])
    found = covariance_of(model_of(tmp_path, full.replace("0.05]", '0.06, "unseen"]')))
    assert found is not None
    assert np.sqrt(np.diag(found))[:2] == pytest.approx([0.05, 0.0201])


def test_it_is_printed_and_written(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL)
    found, spread = solve(ROBOT, POSES, effects=model), spread_of(ROBOT, POSES, model)
    assert spread is not None
    lines = list(pose_lines(found, spread=spread))
    assert lines[2].startswith("  ± 0.00") and lines[2].endswith(
        "from the uncertainty of the model"
    )
    assert lines[3].startswith("  ± 10, ") and lines[3].endswith("would read it")
    head, first = list(cable_lines(found, spread=spread))[:2]
    value, error = with_error(found.tensions[0, 0], spread.tensions[0, 0])
    assert "± [N]" in head and first.split()[1:3] == [value, error]
    slack = replace(found, slack=np.ones_like(found.slack))
    assert all("±" not in line for line in list(cable_lines(slack, spread=spread))[1:])
    assert list(cable_lines(slack, spread=spread))[1].split()[1] == f"{found.tensions[0, 0]:.4f}"
    x, error = with_error(1e3 * found.pose[0, 0], 1e3 * spread.position[0, 0])
    assert f"rests at x y z {x}, " in lines[1] and f"± {error}" in lines[2]
    assert sweep_lines(found, spread=spread)[-1].startswith("uncertain by up to ± 0.")
    rows = SweepRows(found, spread=spread)
    assert rows.as_json()[1]["position_stderr_m"].tolist() == spread.position[1].tolist()
    assert "pose_z_stderr_m" in next(rows.csv_lines())
    assert "stderr" not in json_text({"rows": SweepRows(found)})
