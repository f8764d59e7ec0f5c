"""Two models of one robot: what moved, what nobody knows, and both in one."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_diagnoses
import numpy as np
import pytest
from called import printed
from scipy import stats

import crosscheck
import seecr

ROBOT = seecr.load_robot("demobot_cogiro")
KEYS = [f"drum_gain.gain_{i}" for i in range(1, 9)] + ["platform_mass.added_kg"]
ERROR = np.array([*np.full(8, 3e-5), 2e-3])
CORRELATION = 0.6 ** np.abs(np.subtract.outer(range(9), range(9)))
COVARIANCE = CORRELATION * np.outer(ERROR, ERROR)
TRUTH = np.array([1e-3, -5e-4, 2e-4, 0.0, 3e-4, 1e-4, -2e-4, 4e-4, 0.03])


def text(values: np.ndarray, error: np.ndarray = ERROR, correlated: bool = True) -> str:
    """A model of drum gains and a mass, as a fit writes it."""
    cells = [
        f"{key.partition('.')[2]} = {{ value = {value!r}, stderr = {size!r} }}"
        for key, value, size in zip(KEYS, values.tolist(), error.tolist(), strict=True)
    ]
    out = ["format = 1", seecr.new_model(ROBOT).document["robot"].as_string()]
    out.insert(1, "[robot]")
    out += ["[[effect]]", 'name = "drum_gain"', "[effect.parameters]", *cells[:8]]
    out += ["[[effect]]", 'name = "platform_mass"', "[effect.parameters]", cells[8]]
    if correlated:
        rows = [CORRELATION[i, : i + 1].tolist() for i in range(9)]
        out += ["[fit]", f"parameters = {json.dumps(KEYS)}", f"stderr = {error.tolist()}"]
        out += [f"correlation = {rows}"]
    return "\n".join(out) + "\n"


def kept(folder: Path, name: str, *given: Any) -> Path:
    path = folder / name
    path.write_text(text(*given), encoding="utf-8")
    return path


def test_what_moved_is_said_with_its_error(tmp_path: Path) -> None:
    now = TRUTH.copy()
    now[2] += 2e-4
    found = crosscheck.compare_models(
        kept(tmp_path, "monday.toml", TRUTH), kept(tmp_path, "friday.toml", now)
    )
    (moved,) = found.moved
    error = np.hypot(3e-5, 3e-5)
    assert moved.label == "drum_gain.gain_3" and moved.difference == pytest.approx(2e-4)
    assert moved.stderr == pytest.approx(error)
    assert moved.chance == pytest.approx(9.0 * 2.0 * stats.norm.sf(2e-4 / error), rel=1e-9)
    assert moved.words == (
        "drum_gain: gain_3 is 0.000200 ± 0.000042 larger now, 4.7 times its error (0.000200 ± "
        "0.000030 before, 0.000400 ± 0.000030 now)"
    )
    assert found.together is not None
    chi2 = (now - TRUTH) @ np.linalg.solve(2.0 * COVARIANCE, now - TRUTH)
    assert found.together[:2] == pytest.approx((chi2, 9))
    assert found.together[2] == pytest.approx(stats.chi2.sf(chi2, 9))
    assert found.pooled is None and "1 of 9 values moved beyond its error" in str(found)


def test_a_pooled_model_has_both_by_their_inverse_covariances(tmp_path: Path) -> None:
    other = TRUTH + np.linalg.cholesky(COVARIANCE) @ np.array([0.3, -0.5, 0.2, 0.1] + [0.4] * 5)
    wider = 2.0 * ERROR
    found = crosscheck.compare_models(
        kept(tmp_path, "a.toml", TRUTH), kept(tmp_path, "b.toml", other, wider)
    )
    assert not found.differs and found.pooled is not None
    one, two = np.linalg.inv(COVARIANCE), np.linalg.inv(4.0 * COVARIANCE)
    whole = np.linalg.inv(one + two)
    wanted = whole @ (one @ TRUTH + two @ other)
    crosscheck.save_model(tmp_path / "pooled.toml", found.pooled)
    model = seecr.load_model(tmp_path / "pooled.toml", ROBOT)
    assert np.abs(model.terms.vector - wanted).max() < 1e-6 * ERROR[0]
    spread = seecr.spread_of(ROBOT, [[0.3, 0.2, 0.1, 1, 0, 0, 0]], model)
    narrow = seecr.load_model(kept(tmp_path, "c.toml", wanted), ROBOT)
    known = seecr.spread_of(ROBOT, [[0.3, 0.2, 0.1, 1, 0, 0, 0]], narrow)
    assert spread is not None and known is not None
    # 1/(1 + 1/4) of the variance of the first alone
    assert spread.position == pytest.approx(np.sqrt(0.8) * known.position, rel=1e-6)


@pytest.mark.slow
def test_two_fits_of_one_file_are_said_not_to_be_independent(tmp_path: Path) -> None:
    """A model pooled with itself had errors that were smaller by the root of two, in silence."""
    names = ["monday.toml", "friday.toml"]
    apart = [kept(tmp_path, name, TRUTH) for name in names]
    assert "independent" not in str(crosscheck.compare_models(*apart))
    for path in apart:
        path.write_text(
            path.read_text().replace(
                'name = "platform_mass"',
                'name = "platform_mass"\nprovenance = { data = "day1.csv", date = "2026-11-29", '
                'version = "seecr 0.1.0", by = "crosscheck add" }',
            )
        )
    said = str(crosscheck.compare_models(*apart))
    assert "both were fitted to day1.csv: if that is the same file, their errors are not" in said


def test_a_robot_that_has_not_changed_is_said_to_in_one_of_twenty_at_most(tmp_path: Path) -> None:
    model = seecr.load_model(kept(tmp_path, "a.toml", TRUTH), ROBOT)
    random, lower = np.random.default_rng(3), np.linalg.cholesky(COVARIANCE)
    said, count = 0, 120
    for _ in range(count):
        pair = [
            replace(model, terms=model.terms.with_vector(TRUTH + lower @ random.standard_normal(9)))
            for _ in range(2)
        ]
        said += crosscheck.compare_models(*pair).differs
    assert 1 <= said <= 0.05 * count + 3.0 * np.sqrt(0.05 * 0.95 * count)


def test_correlations_tell_what_no_single_value_does(tmp_path: Path) -> None:
    """Values that always go the same way, and now go different ways."""
    apart = 1.4 * ERROR * np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])
    files = kept(tmp_path, "a.toml", TRUTH), kept(tmp_path, "b.toml", TRUTH + apart)
    found = crosscheck.compare_models(*files)
    assert not found.moved and found.differs and found.pooled is None
    assert "Together the 9 values moved" in found.sentence
    without = [kept(tmp_path, f"{f.stem}2.toml", v, ERROR, False) for f, v in zip(
        files, (TRUTH, TRUTH + apart), strict=True)]  # fmt: skip
    blind = crosscheck.compare_models(*without)
    assert not blind.differs
    assert blind.together is None
    assert "a2.toml keeps no covariance: its values are taken one by one" in str(blind)


def test_what_neither_settles_is_named_and_not_tested(tmp_path: Path) -> None:
    size = seecr.layout_of("platform_mass", ROBOT).scale[0]
    wide = ERROR.copy()
    wide[8] = size
    now = TRUTH.copy()
    now[8] += 20.0 * size
    found = crosscheck.compare_models(
        kept(tmp_path, "a.toml", TRUTH, wide), kept(tmp_path, "b.toml", now, wide)
    )
    assert [one.label for one in found.unsettled] == ["platform_mass.added_kg"]
    assert not found.differs and found.together is not None and found.together[1] == 8
    one = crosscheck.compare_models(
        kept(tmp_path, "a.toml", TRUTH), kept(tmp_path, "b.toml", now, wide)
    )
    assert one.unsettled == () and [v.label for v in one.moved] == ["platform_mass.added_kg"]


def test_an_effect_of_one_alone_is_told(tmp_path: Path) -> None:
    first = kept(tmp_path, "a.toml", TRUTH)
    more = tmp_path / "b.toml"
    effect = (
        '[[effect]]\nname = "stiffness"\n[effect.parameters]\nfactor = {value=0.9,stderr=0.01}\n'
    )
    more.write_text(text(TRUTH, ERROR, False) + effect, encoding="utf-8")
    found = crosscheck.compare_models(first, more)
    assert found.only_now == ("stiffness",) and found.only_before == ()
    assert f"only in {more}: stiffness" in str(found)
    assert found.pooled is not None and found.pooled.names == ("drum_gain", "platform_mass")
    fixed = tmp_path / "c.toml"
    fixed.write_text(
        text(TRUTH, ERROR, False).replace("0.03, stderr = 0.002", "0.03, fixed = true")
    )
    both = crosscheck.compare_models(fixed, fixed)
    assert len(both.values) == 8 and "1 value without an error in either" in str(both)


def test_results_are_compared_as_their_models(tmp_path: Path) -> None:
    found = made_diagnoses.pulleys()
    assert found.model is not None
    same = crosscheck.compare_models(found, found.model)
    assert same.values and not same.differs and (same.before, same.now) == ("before", "now")
    with pytest.raises(seecr.InputError, match="got Diagnosis, which has no model"):
        crosscheck.compare_models(made_diagnoses.none(), found)


WRONG: dict[str, tuple[str, str]] = {
    "no TOML": ("[[effect", "b.toml: is not TOML"),
    "another file": ("run = 3\n", "b.toml: is not a model, it has run"),
    "no number": (
        text(TRUTH).replace("value = 0.0004", 'value = "much"'), r"line \d+: .*gain_8: expected",
    ),
    "another robot": (
        text(TRUTH).replace("0.485", "0.495"), "b.toml: made for another robot of the same name",
    ),
    "another count": (
        text(TRUTH).replace(', "cable8"]', "]"), "b.toml: made for another robot: .* 7 cables",
    ),
    "a matrix that is none": (
        text(TRUTH).replace("[[1.0]", "[[1.5]"), "correlation: expected 9 rows of numbers",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_damaged_model_is_one_sentence(tmp_path: Path, what: str) -> None:
    damaged, words = WRONG[what]
    good = kept(tmp_path, "a.toml", TRUTH)
    (tmp_path / "b.toml").write_text(damaged, encoding="utf-8")
    with pytest.raises(seecr.InputFileError, match=words):
        crosscheck.compare_models(good, tmp_path / "b.toml")


def test_models_that_name_no_robot_need_one(tmp_path: Path) -> None:
    bare = tmp_path / "bare.toml"
    bare.write_text(text(TRUTH).replace("[robot]", "[mine]"), encoding="utf-8")
    with pytest.raises(seecr.InputError, match="neither model says which robot"):
        crosscheck.compare_models(bare, bare)
    assert not crosscheck.compare_models(bare, bare, ROBOT).differs
    with pytest.raises(seecr.InputError, match=r"expected a model, .* got int"):
        crosscheck.compare_models(3, bare)


# --- the command ----------------------------------------------------------------------------------


def test_the_command_compares_two_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    now = TRUTH.copy()
    now[2] += 2e-4
    kept(tmp_path, "a.toml", TRUTH)
    kept(tmp_path, "b.toml", now)
    out = printed("compare", "a.toml", "b.toml", "--model-out", "p.toml", status=1)
    assert "gain_3 is 0.000200 ± 0.000042 larger now" in out
    assert "p.toml was not written: the values differ" in out and not Path("p.toml").exists()
    printed("compare", "a.toml", "b.toml")
    told = json.loads(
        printed("compare", "a.toml", "b.toml", "--json", "--fail-on", "moved", status=1)
    )
    assert told["moved"] == ["drum_gain.gain_3"] and told["exit_status"] == 1
    assert json.loads(Path("crosscheck-comparison/models.json").read_text()) == told
    out = printed("compare", "a.toml", "a.toml", "--model-out", "p.toml", "--fail-on", "moved")
    assert "Nothing moved" in out and "Written to p.toml" in out and Path("p.toml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("a.toml", "m.csv"), "or two models .* got a.toml m.csv"),
        (("robot.xml", "a.toml"), "or two models .* got robot.xml a.toml"),
        (("a.toml", "a.toml", "a.toml"), "or two models .* got a.toml a.toml a.toml"),
        (("a.toml", "a.toml", "--sigma", "position=1mm"), "--sigma is for compare ROBOT.xml"),
        (("a.toml", "a.toml", "--model", "a.toml"), "--model is for compare ROBOT.xml"),
        (("robot.xml", "m.csv", "--fail-on", "moved"), "--fail-on is for compare two models"),
        (("a.toml", "a.toml", "--fail-on", "gone"), "--fail-on: expected moved, got gone"),
        (("a.toml", "d.json"), "d.json: line 1: is not JSON"),
        (("e.json", "a.toml"), "e.json: has no verdict"),
    ],
)
def test_mixtures_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    kept(tmp_path, "a.toml", TRUTH)
    Path("d.json").write_text("{")
    Path("e.json").write_text("{}")
    out = printed("compare", *words, status=2)
    assert re.search(said, out), out
    assert not Path("crosscheck-comparison").exists()
