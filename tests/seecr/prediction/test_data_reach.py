"""How far a model's data reach: what lies beyond is said, and what is near is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seecr import InputFileError, Model, Robot, load_model, load_robot, solve
from seecr.prediction.model import DataReach

TABLE = """
[[effect]]
name = "pulley_radius"
[effect.parameters]
radius_m = 0.01

[fitted_to]
position_m = [[0.3, 0.2, 0.1], [0.5, 0.3, 0.2]]
tension_N = [0.2, 1.5]
"""
REACH = DataReach(np.array([0.3, 0.2, 0.1]), np.array([0.5, 0.3, 0.2]), 0.2, 1.5)
LENGTH = 0.5


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("demobot_cogiro")


def model_of(text: str, folder: Path, robot: Robot) -> Model:
    (folder / "m.toml").write_text(text)
    return load_model(folder / "m.toml", robot)


def test_it_is_the_box_of_the_places_and_the_range_of_the_tensions() -> None:
    places = np.array([[0.3, 0.3, 0.1], [0.5, 0.2, 0.2], [0.4, 0.25, 0.15]])
    reach = DataReach.of(places, np.array([[0.2, 1.0], [1.5, 0.7], [0.5, 0.5]]))
    assert reach is not None
    assert reach.low.tolist() == [0.3, 0.2, 0.1] and reach.high.tolist() == [0.5, 0.3, 0.2]
    assert (reach.least, reach.largest) == (0.2, 1.5)
    assert DataReach.of(places[:0], np.zeros((0, 2))) is None


def test_outside_counts_from_the_box_and_only_well_beyond_it() -> None:
    # the diagonal is 0.245 m, so that 24 mm is near
    places = [[0.4, 0.25, 0.15], [0.52, 0.25, 0.15], [0.53, 0.25, 0.24], [0.2, 0.25, np.nan]]
    away = REACH.outside(places, LENGTH)
    assert away == pytest.approx([0.0, 0.0, 0.05, 0.0])
    assert REACH.outside([[0.26, 0.25, 0.15]], LENGTH) == pytest.approx([0.04])
    # a single place: a fiftieth of the robot's length is near
    spot = replace(REACH, high=REACH.low)
    assert spot.outside([[0.309, 0.2, 0.1], [0.311, 0.2, 0.1]], LENGTH) == pytest.approx([0, 0.011])


def test_the_sentence_says_how_many_how_tense_and_how_far() -> None:
    near, pulls = np.array([[0.4, 0.25, 0.15]]), np.array([[0.3, 1.7]])
    assert REACH.beyond(near, pulls, LENGTH) == ()
    assert REACH.beyond(near, np.array([[0.3, 2.0]]), LENGTH) == (
        "beyond the data that the model was fitted to: tensions up to 2 N, whereas the data have "
        "0.2 to 1.5 N; predictions there are extrapolated",
    )
    (line,) = REACH.beyond(
        np.array([[0.4, 0.25, 0.15], [0.6, 0.25, 0.15], [np.nan] * 3]),
        np.array([[0.3, 1.7], [0.3, 2.5], [np.nan] * 2]), LENGTH,
    )  # fmt: skip
    assert "fitted to at 1 of 3 poses: tensions up to 2.5 N" in line
    assert "up to 100 mm outside the region of the data" in line


def test_a_model_says_what_of_an_answer_is_beyond_its_data(tmp_path: Path, robot: Robot) -> None:
    model = model_of(TABLE, tmp_path, robot)
    inside, outside = ([x, 0.25, 0.15, 1, 0, 0, 0] for x in (0.4, 0.17))
    assert model.beyond(solve(robot, inside, effects=model)) == ()
    (line,) = model.beyond(solve(robot, [inside, outside], effects=model))
    assert "at 1 of 2 poses" in line and "outside the region" in line
    # a row that is not at rest says nothing, however far it was when the search ended
    lost = solve(robot, [inside, outside], effects=model, max_iterations=1)
    assert not lost.converged.any() and model.beyond(lost) == ()
    unknown = model_of(TABLE.split("[fitted_to]")[0], tmp_path, robot)
    assert unknown.beyond(solve(robot, outside, effects=unknown)) == ()


@pytest.mark.parametrize(
    "old, new",
    [
        ("[0.5, 0.3, 0.2]", "[0.5, 0.3]"),
        ("[0.5, 0.3, 0.2]", "[0.5, 0.1, 0.2]"),
        ("[0.5, 0.3, 0.2]", '[0.5, 0.3, "high"]'),
        ("tension_N = [0.2, 1.5]", "tension_N = [2.2, 1.5]"),
        ("tension_N = [0.2, 1.5]", "tension_N = 1.5"),
        ("tension_N = [0.2, 1.5]", "tension_N = [0.2, 1" + 400 * "0" + "]"),
        ("tension_N = [0.2, 1.5]", "force_N = [0.2, 1.5]"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, robot: Robot, old: str, new: str) -> None:
    with pytest.raises(InputFileError) as error:
        model_of(TABLE.replace(old, new), tmp_path, robot)
    text = str(error.value)
    assert "\n" not in text and text.startswith(str(tmp_path / "m.toml"))
    assert "line 7: [fitted_to]: expected position_m = [[x, y, z], [x, y, z]]" in text


def test_a_base_frame_far_away_keeps_the_box() -> None:
    far = replace(REACH, low=REACH.low + 123456.0, high=REACH.high + 123456.0)
    low, high = np.asarray(far.as_toml()["position_m"].unwrap())
    assert low == pytest.approx(far.low, abs=1e-4) and high == pytest.approx(far.high, abs=1e-4)
    assert REACH.as_toml()["position_m"].unwrap() == [[0.3, 0.2, 0.1], [0.5, 0.3, 0.2]]
