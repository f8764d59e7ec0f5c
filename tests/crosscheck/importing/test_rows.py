"""Files of other programs as rows of cells, and blocks of numbers in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.importing.logs import Block, FileRows, unit_quaternions
from seecr.errors import InputFileError


def rows_of(folder: Path, text: str) -> FileRows:
    path = folder / "export.csv"
    path.write_text(text, encoding="utf-8")
    return FileRows.of(path, "expected an export")


def test_decimal_commas_are_points_where_cells_end_with_semicolons(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, "Frame;x;y\n1;-2,5e3;0,5\n")
    assert rows.cells[:2] == [["Frame", "x", "y"], ["1", "-2.5e3", "0.5"]]


def test_a_quote_without_its_end_does_not_swallow_lines(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, 'a,5" wide,c\n1,2,3\n')
    assert rows.cells[1] == ["1", "2", "3"]


def test_numbers_know_their_lines_and_blanks_are_none(tmp_path: Path) -> None:
    block = Block(rows_of(tmp_path, "head\n\nt,x\n1,\n2,0.5\n"), 2, range(3, 5))
    assert block.line.tolist() == [4, 5] and block.labels == ["t", "x"]
    np.testing.assert_array_equal(block.numbers([1, 0]), [[np.nan, 1.0], [0.5, 2.0]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "t,x\n1,2\n2\n",
            "line 3: expected 2 cells as in the row of labels .* is the file cut off",
        ),
        ("t,x\n1,2\n2,two\n", "line 3, column x: expected a number, got 'two'"),
    ],
)
def test_a_row_that_is_no_row_of_numbers_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputFileError, match=said):
        Block(rows_of(tmp_path, text), 0, range(1, 3)).numbers([0, 1])


@pytest.mark.parametrize("times", [[1.0, 1.0], [2.0, 1.0], [1.0, np.nan]])
def test_times_that_do_not_grow_are_two_recordings(tmp_path: Path, times: list[float]) -> None:
    block = Block(rows_of(tmp_path, "t\n1\n2\n"), 0, range(1, 3))
    block.check_times(np.array([1.0, 2.0]), "t")
    with pytest.raises(InputFileError, match=r"line 3, column t: .* that increase after 1|after 2"):
        block.check_times(np.array(times), "t")


def test_a_body_that_was_not_seen_has_no_orientation(tmp_path: Path) -> None:
    def refuse(text: str, row: int) -> InputFileError:
        return InputFileError(f"row {row}: {text}")

    found = unit_quaternions(np.array([[0.0, 0, 0, 0], [1.004, 0, 0, 0]]), refuse)
    np.testing.assert_array_equal(found, [[np.nan] * 4, [1.0, 0, 0, 0]])
    with pytest.raises(InputFileError, match="row 1: expected a quaternion of length 1, got 2"):
        unit_quaternions(np.array([[1.0, 0, 0, 0], [2.0, 0, 0, 0]]), refuse)
