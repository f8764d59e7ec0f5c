"""One parameter in a model's file, and the line where it stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seecr.effects import layout_of
from seecr.errors import InputFileError
from seecr.prediction.effect_tables import Cell, Where, cell_of, nearest_first, number_of

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
    return cell_of(WHERE, 1, LAYOUT, 0, content, fixed)


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
    [
        10**400,
        {"value": 0.01, "stderr": 10**400},
        {"known": {"value": 0.01, "stderr": 10**400}},
    ],
)
def test_a_number_of_hundreds_of_digits_is_refused_in_a_short_line(content: Any) -> None:
    with pytest.raises(InputFileError, match=r"^m\.toml: line 8: .*radius_m: .*got 10000") as error:
        read(content)
    assert len(str(error.value)) < 250


def test_the_most_similar_word_comes_first_whatever_its_case() -> None:
    assert nearest_first("STDERROR", ("value", "unit", "stderr")).split(", ")[0] == "stderr"
