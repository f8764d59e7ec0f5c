"""One parameter in a model's file, and the line where it stands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seecr import InputFileError, Term, layout_of, load_robot
from seecr.pose import Array
from seecr.prediction.effect_tables import Cell, Reader, Where, nearest_first, number_of, term_of

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
