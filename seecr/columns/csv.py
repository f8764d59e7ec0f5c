"""A file of rows and named columns, CSV or Parquet, as text with the line of each cell.

This module does not know what a column means. Errors name the line and column of the mistake.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.errors import InputFileError, MissingPackageError, printable
from seecr.files import no_text, read_bytes
from seecr.pose import LARGEST, Array

# The parts of a column's name: a quantity and, after the last underscore, its unit.

QUANTITY = re.compile(
    r"(t|temperature|run|(?:cmd|meas|want)_(?:q[wxyz]|r?[xyz])|(?:length|tension)_\d+"
    r"|payload(?:_[xyz])?|(?:force|moment)_[xyz])(?:_([^_]*))?"
)


def is_number(name: str) -> bool:
    """Whether a column of that name holds numbers that are read; runs have names."""
    found = QUANTITY.fullmatch(name.strip())
    return found is not None and found[1] != "run"


EXPECTED_FILE = "expected a CSV file in UTF-8 with a header row and one row per resting pose"

_PARQUET_MAGIC = b"PAR1"
_TEXT_BEGINNINGS = {"{": "JSON", "[": "JSON or TOML", "<": "XML, such as a robot's MJCF"}
# First cells of the files of each program.
VICON = ("segments", "trajectories", "devices", "joints", "model outputs")
_QUALISYS = "no_of_frames"
_SEPARATORS = (",", ";", "\t")
# Marks of a missing reading, besides an empty cell.
_NOT_READ = ("nan", "NaN")
_COMMA_NUMBER = re.compile(r"[+-]?(\d+,\d*|,\d+)(e[+-]?\d+)?", re.IGNORECASE)
_POINT_NUMBER = re.compile(r"[+-]?(\d+\.\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_NO_NUMBER = {"nan", "inf", "infinity", "na", "n/a", "#n/a", "null", "none", "-", "--"}


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of text cells.

    Attributes:
        path: the file.
        names: of the columns, stripped, as in the header.
        line: (n,) line at which each row begins, counted from 1.
        header_line: line of the header; None if the file has no lines.
        cells: for each column the stripped texts, (n,) each; numbers with decimal points.
    """

    path: Path
    names: tuple[str, ...]
    line: NDArray[np.int64]
    header_line: int | None
    cells: Sequence[Sequence[str]]

    def error(
        self, text: str, *, row: int | None = None, column: str | None = None
    ) -> InputFileError:
        """An error at a row (counted from 0) or, without one, in the header."""
        in_lines = self.header_line is not None
        line = self.header_line if row is None else int(self.line[row])
        word = "line" if in_lines else "row"
        return InputFileError.at(self.path, text, line=line, column=column, line_word=word)

    def numbers(self, index: int, *, blank_is_nan: bool) -> Array:
        """Numbers (n,) of one column, as written; NaN for missing readings, if allowed."""
        cells = self.cells[index]
        if blank_is_nan:
            cells = ["" if cell in _NOT_READ else cell for cell in cells]
        try:
            values = np.array([float(cell) if cell else math.nan for cell in cells])
        except ValueError:
            raise self._first_fault(index, cells, blank_is_nan) from None
        blank = np.array([not cell for cell in cells])
        odd = np.any((np.abs(values) <= LARGEST) == blank) or "_" in "".join(cells)
        if odd or (np.any(blank) and not blank_is_nan):
            raise self._first_fault(index, cells, blank_is_nan)
        return values

    def _first_fault(self, index: int, cells: Sequence[str], blank_is_nan: bool) -> InputFileError:
        for row, cell in enumerate(cells):
            fault = _cell_fault(cell, blank_is_nan)
            if fault:
                return self.error(fault, row=row, column=self.names[index])
        raise AssertionError("numbers() found a fault that no cell has")


def show(text: str) -> str:
    """A cell or header for an error message: quoted, one line, not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def taken_for(names: Sequence[str]) -> str:
    """The program whose export begins like this, and what to do; "" if unknown."""
    cell = names[0].lower()
    if cell == "format version":
        return "; this is an export of Motive: crosscheck import motive"
    if cell in VICON:
        return "; this is an export of Vicon: crosscheck import vicon"
    if cell == _QUALISYS:
        return "; this is an export of Qualisys: make a plain log of it, crosscheck import poses"
    return ""


def read_table(path: Path) -> Table:
    """Read a CSV or Parquet file (told apart by content, not by name).

    Raises:
        InputFileError: of another kind, not UTF-8, or rows that do not fit the header.
    """
    if path.is_dir():
        raise InputFileError.at(path, f"is a folder; {EXPECTED_FILE}")
    data = read_bytes(path, EXPECTED_FILE)
    if data.startswith(_PARQUET_MAGIC):
        return _read_parquet(path)
    return _read_csv(path, data)


def _decode(path: Path, data: bytes) -> str:
    kind = no_text(data)
    if kind:
        raise InputFileError.at(path, f"is {kind}; {EXPECTED_FILE}, or Parquet")
    try:
        return data.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        text = (
            f"byte 0x{data[error.start]:02X} (number {error.start + 1} of the file) is not UTF-8; "
            "expected text in UTF-8; save the file again in that encoding"
        )
        raise InputFileError.at(path, text, line=line) from None


def _read_csv(path: Path, data: bytes) -> Table:
    numbered = [
        (number, line)
        for number, line in enumerate(io.StringIO(_decode(path, data), newline=""), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise InputFileError.at(path, f"is empty; {EXPECTED_FILE}")
    _check_first_line(path, *numbered[0])
    separator = _separator(path, *numbered[0])
    (header_line, header), *body = _csv_rows(path, numbered, separator)
    if not body:
        raise InputFileError.at(
            path, "has a header but no rows; expected one row per resting pose", line=header_line
        )
    _check_cell_counts(path, header_line, header, body)
    columns = zip(*(row for _, row in body), strict=True)
    cells = [[cell.strip() for cell in column] for column in columns]
    return Table(
        path=path,
        names=tuple(name.strip() for name in header),
        line=np.array([line for line, _ in body]),
        header_line=header_line,
        cells=cells if separator == "," else _with_points(header, cells),
    )


def _with_points(names: list[str], cells: list[list[str]]) -> list[list[str]]:
    """Decimal commas as points, if no number has a point: a file uses only one kind.

    Columns without numbers are left out of that test: a run's name may be 1.5.
    """
    pairs = zip(names, cells, strict=True)
    every = [cell for name, column in pairs if is_number(name) for cell in column]
    if any(_POINT_NUMBER.fullmatch(cell) for cell in every):
        return cells
    return [
        [cell.replace(",", ".") if _COMMA_NUMBER.fullmatch(cell) else cell for cell in column]
        for column in cells
    ]


def _check_first_line(path: Path, number: int, line: str) -> None:
    kind = _TEXT_BEGINNINGS.get(line.lstrip()[0])
    if kind:
        raise InputFileError.at(path, f"looks like {kind}; {EXPECTED_FILE}", line=number)
    program = taken_for([cell.strip(' "\r\n') for cell in re.split("[,;\t]", line)])
    if program:
        raise InputFileError.at(path, f"{EXPECTED_FILE}{program}", line=number)
    if line.count("|") > max(line.count(mark) for mark in _SEPARATORS):
        text = "expected commas, semicolons or tabs between cells, got bars; write 1.5,2.5"
        raise InputFileError.at(path, text, line=number)


def _separator(path: Path, number: int, line: str) -> str:
    """The mark between the names of the header: a comma, a semicolon or a tab."""
    outside = re.sub(r'"[^"]*"', "", line)
    counts = {mark: outside.count(mark) for mark in _SEPARATORS}
    mark = max(_SEPARATORS, key=lambda one: counts[one])
    others = [count for one, count in counts.items() if one != mark]
    if counts[mark] and counts[mark] in others:
        text = "expected one kind of separator between the names, got as many of one as of another"
        raise InputFileError.at(path, f"{text}; write all with commas", line=number)
    return mark


def _csv_rows(
    path: Path, numbered: list[tuple[int, str]], separator: str
) -> list[tuple[int, list[str]]]:
    lines = (line for _, line in numbered)
    reader = csv.reader(lines, delimiter=separator, strict=True, skipinitialspace=separator != "\t")
    rows, first = [], 0
    try:
        for row in reader:
            rows.append((numbered[first][0], row))
            first = reader.line_num
    except csv.Error as error:
        text = f"cannot be split into cells: {error}; look for a quotation mark without its partner"
        raise InputFileError.at(path, text, line=numbered[first][0]) from None
    return rows


def _check_cell_counts(
    path: Path, header_line: int, header: list[str], body: list[tuple[int, list[str]]]
) -> None:
    n_columns = len(header)
    for line, row in body:
        if row == header:
            text = f"expected a row of cells, got the header (line {header_line}) again; are two "
            raise InputFileError.at(path, f"{text}files in one? Give them one at a time", line=line)
        if len(row) != n_columns:
            text = (
                f"expected {counted(n_columns, 'cell')} as in the header (line {header_line}), "
                f"got {counted(len(row), 'cell')}"
            )
            if line == body[-1][0] and len(row) < n_columns:
                text += "; it is the last line: is the file cut off?"
            if len(row) > n_columns:
                text += (
                    "; a decimal comma splits a number in two: write 1.5, not 1,5, or put "
                    "semicolons between cells"
                )
            raise InputFileError.at(path, text, line=line)


def _read_parquet(path: Path) -> Table:
    try:
        import pyarrow
        from pyarrow import parquet
    except ModuleNotFoundError as error:
        if error.name != "pyarrow":  # installed, but one of its own imports is missing
            raise
        raise MissingPackageError(
            f"{path}: is Parquet, which needs pyarrow; pip install pyarrow, or save it as CSV"
        ) from None
    try:
        content = parquet.read_table(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise InputFileError.at(path, f"cannot be read as Parquet: {error}") from None
    if content.num_rows == 0:
        raise InputFileError.at(path, "has columns but no rows; expected one row per resting pose")
    return Table(
        path=path,
        names=tuple(name.strip() for name in content.column_names),
        line=np.arange(1, content.num_rows + 1),
        header_line=None,
        cells=[
            ["" if value is None else str(value).strip() for value in column.to_pylist()]
            for column in content.columns
        ],
    )


def _cell_fault(cell: str, blank_is_nan: bool) -> str | None:
    """What is wrong with a cell that should hold a number; None if nothing is."""
    expected = "expected a number, or an empty cell where the reading is missing"
    if not blank_is_nan:
        expected = "expected a number in every row"
    if not cell:
        return None if blank_is_nan else f"{expected}, got an empty cell; fill it or drop the row"
    if cell.lower().lstrip("+-") in _NO_NUMBER or cell.lower() in _NO_NUMBER:
        remedy = "" if blank_is_nan else "; fill it or drop the row"
        return f"{expected}, got {show(cell)}{remedy}"
    if _COMMA_NUMBER.fullmatch(cell):
        point = cell.replace(",", ".")
        return f"{expected}, got a decimal comma in {show(cell)}; write {point}"
    if re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?\s*[^\W\d_]+", cell, re.IGNORECASE):
        return f"{expected}, got {show(cell)}; a unit belongs in the column's name, not in a cell"
    try:
        number = float(cell.replace("_", "?"))
    except ValueError:
        return f"{expected}, got {show(cell)}"
    if abs(number) <= LARGEST:
        return None
    largest = f"{LARGEST:g}".replace("+", "")
    return (
        f"{expected}, got {show(cell)}, which is too large; numbers go from -{largest} to {largest}"
    )


# The text of a CSV, as it is read above: every file of rows is written here.


def table_text(columns: Mapping[str, Sequence[Any] | Array], digits: int | None = None) -> str:
    """Columns of one length by name as CSV, with so many significant digits, or all.

    Numbers that are missing or not finite are empty cells.
    """
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(_cell(value, digits) for value in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def _cell(value: object, digits: int | None) -> str:
    if isinstance(value, float):
        # adding zero turns -0.0 into 0.0
        number = float(value) + 0.0
        text = repr(number) if digits is None else f"{number:.{digits}g}"
        return text if math.isfinite(number) else ""
    return "" if value is None else _quoted(str(value))


def _quoted(text: str) -> str:
    """Text as a cell; a leading # would make its line a comment, = or @ a formula of Excel."""
    text = "".join(part if part.isspace() else printable(part) for part in re.split(r"(\s)", text))
    if text.lstrip().startswith(("=", "@")):
        text = "'" + text
    if any(mark in text for mark in ',"\n\r') or text.lstrip().startswith("#"):
        return '"' + text.replace('"', '""') + '"'
    return text
