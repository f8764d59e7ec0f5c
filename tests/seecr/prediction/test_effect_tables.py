"""A model's file: parameters, effects, lines where they stand, and how far its data reach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seecr import InputFileError, Model, Term, layout_of, load_model, load_robot, solve
from seecr.pose import Array
from seecr.prediction.effect_tables import Cell, Reader, Where, nearest_first, number_of, term_of
from seecr.prediction.model import DataReach

LAYOUT = layout_of("pulley_radius", "demobot_cogiro")
TEXT = """# radius_m = 1
[[effect]]
name = "stiffness"
parameters.factor = 1.2   # factor = 2
[[ effect ]] # factor = 3
name = "pulley_radius"
[effect.parameters]
"radius_m" = { value = 0.01 }
"""
WHERE = Where(Path("m.toml"), TEXT)


def read(content: Any, fixed: bool = False) -> Cell:
    return Reader(WHERE, 1, LAYOUT, 0).read(content, fixed)


@pytest.mark.parametrize(
    ("effect", "key", "line"),
    [
        (0, "factor", 4),
        (1, "radius_m", 8),
        (1, "parameters", 7),
        (1, "name", 6),
        (1, "factor", 5),  # which it does not have: its own first line
        (None, "radius_m", 8),
        (None, "nothing", None),
        (2, "name", None),
    ],
)
def test_a_key_is_found_within_its_effect_and_not_in_remarks(
    effect: int | None, key: str, line: int | None
) -> None:
    assert WHERE.line(effect, key) == line


def test_a_number_alone_is_a_value_without_anything_else() -> None:
    cell = read(0.02)
    assert (cell.value, cell.fixed, cell.known_stderr) == (0.02, False, np.inf)
    assert np.isnan(cell.stderr) and np.isnan(cell.known)


def test_an_unseen_value_has_an_infinite_error_and_an_exact_one_none() -> None:
    assert read({"value": 0.01, "stderr": "unseen"}).stderr == np.inf
    assert read({"value": 0.01, "stderr": 0}).stderr == 0.0


def test_a_value_beside_the_measured_one_is_where_fits_begin() -> None:
    cell = read({"value": 0.02, "known": {"value": 0.01, "stderr": 1e-3}})
    assert (cell.value, cell.known, cell.known_stderr) == (0.02, 0.01, 1e-3)


def test_what_holds_for_the_effect_cannot_be_taken_back_by_a_parameter() -> None:
    assert read({"value": 0.01, "fixed": False}, fixed=True).fixed


@pytest.mark.parametrize("value", [True, "1", None, np.nan, -np.inf, 10**400, [1.0]])
def test_what_is_no_finite_number_is_none(value: Any) -> None:
    assert number_of(value) is None


def test_whole_numbers_are_numbers() -> None:
    assert number_of(3) == 3.0 and isinstance(number_of(3), float)


@pytest.mark.parametrize(
    "content",
    [10**400, {"value": 0.01, "stderr": 10**400}, {"known": {"value": 0.01, "stderr": 10**400}}],
)
def test_a_number_of_hundreds_of_digits_is_refused_in_a_short_line(content: Any) -> None:
    with pytest.raises(InputFileError, match=r"^m\.toml: line 8: .*radius_m: .*got 10000") as error:
        read(content)
    assert len(str(error.value)) < 250


def test_the_most_similar_word_comes_first_whatever_its_case() -> None:
    assert nearest_first("STDERROR", ("value", "unit", "stderr")).split(", ")[0] == "stderr"


# --- One effect in a model's file


ROBOT = load_robot("demobot_cogiro")
FIRST = Where(Path("m.toml"), "[[effect]]\n")


def term_read(name: str, **table: Any) -> tuple[Term, Array]:
    return term_of(FIRST, 0, {"name": name, **table}, ROBOT)


def values(whole: Mapping[str, Any]) -> list[float]:
    """The gains of drums of which number 3 is said by itself."""
    return term_read("drum_gain", parameters={**whole, "gain_3": 0.003})[0].vector.tolist()


def test_what_is_said_of_all_cables_is_said_of_each_that_has_nothing_of_its_own() -> None:
    assert values({"gain": 0.001}) == [0.001, 0.001, 0.003, *[0.001] * 5]


def test_of_each_cable_its_own_words_count_and_the_rest_is_that_of_all() -> None:
    both = {"gain": {"value": 0.001, "stderr": 1e-4}, "gain_2": {"value": 0.002, "stderr": 2e-4}}
    term, stderr = term_read("drum_gain", parameters=dict(both))
    assert term.vector.tolist() == [0.001, 0.002, *[0.001] * 6]
    assert stderr.tolist() == [1e-4, 2e-4, *[1e-4] * 6]
    both["gain_2"] = {"fixed": True}
    term, stderr = term_read("drum_gain", parameters=dict(both))
    assert term.vector[1] == 0.001 and stderr[1] == 1e-4
    assert np.flatnonzero(term.knowledge.fixed).tolist() == [1]


def test_an_effect_of_each_file_that_says_no_more_is_nothing_so_far() -> None:
    term, stderr = term_read("stiffness", per_file=True)
    assert term.vector.tolist() == [1.0] and np.isnan(stderr).all()
    assert term.own is not None and (term.own.kind, term.own.values) == ("file", {})
    with pytest.raises(InputFileError, match=r"expected a table \[effect.parameters\] with factor"):
        term_read("stiffness")


def test_keys_of_the_users_own_are_left_alone_unless_they_look_misspelt() -> None:
    assert term_read("stiffness", parameters={"factor": 1.2}, remark="on a Monday")[0].vector == [
        1.2
    ]
    with pytest.raises(InputFileError, match="unknown Provenence; expected provenance"):
        term_read("stiffness", parameters={"factor": 1.2}, Provenence="here")


def test_of_many_missing_parameters_some_are_named() -> None:
    with pytest.raises(InputFileError) as error:
        term_read("exit_point_error", parameters={})
    said = str(error.value)
    assert "error_1_x_m" in said and "error_8_z_m" not in said and "= { value = 0 }" in said


# --- How far a model's data reach: what lies beyond is said, and what is near is not


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


def model_of(text: str, folder: Path) -> Model:
    (folder / "m.toml").write_text(text)
    return load_model(folder / "m.toml", ROBOT)


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


def test_a_model_says_what_of_an_answer_is_beyond_its_data(tmp_path: Path) -> None:
    model = model_of(TABLE, tmp_path)
    inside, outside = ([x, 0.25, 0.15, 1, 0, 0, 0] for x in (0.4, 0.17))
    assert model.beyond(solve(ROBOT, inside, effects=model)) == ()
    (line,) = model.beyond(solve(ROBOT, [inside, outside], effects=model))
    assert "at 1 of 2 poses" in line and "outside the region" in line
    # a row that is not at rest says nothing, however far it was when the search ended
    lost = solve(ROBOT, [inside, outside], effects=model, max_iterations=1)
    assert not lost.converged.any() and model.beyond(lost) == ()
    unknown = model_of(TABLE.split("[fitted_to]")[0], tmp_path)
    assert unknown.beyond(solve(ROBOT, outside, effects=unknown)) == ()


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
def test_a_table_that_is_none_is_refused(tmp_path: Path, old: str, new: str) -> None:
    with pytest.raises(InputFileError) as error:
        model_of(TABLE.replace(old, new), tmp_path)
    text = str(error.value)
    assert "\n" not in text and text.startswith(str(tmp_path / "m.toml"))
    assert "line 7: [fitted_to]: expected position_m = [[x, y, z], [x, y, z]]" in text


def test_a_base_frame_far_away_keeps_the_box() -> None:
    far = replace(REACH, low=REACH.low + 123456.0, high=REACH.high + 123456.0)
    low, high = np.asarray(far.as_toml()["position_m"].unwrap())
    assert low == pytest.approx(far.low, abs=1e-4) and high == pytest.approx(far.high, abs=1e-4)
    assert REACH.as_toml()["position_m"].unwrap() == [[0.3, 0.2, 0.1], [0.5, 0.3, 0.2]]
