"""A file of rows and named columns, CSV or Parquet, as text with the line of each cell.

This module does not know what a column means. Errors name the line and column of the mistake.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seecr.columns.cells import (
    NOT_READ,
    OF_NUMBERS,
    Style,
    decoded,
    fault_of,
    is_comment,
    is_statistic,
    is_workbook,
    sheet_rows,
)
from seecr.columns.cells import show as show  # for those who read tables
from seecr.columns.headers import QUANTITY, numbered_headers, spelled
from seecr.counted import counted, plural, some
from seecr.errors import InputFileError, MissingPackageError, printable
from seecr.files import of_sheet, read_bytes
from seecr.pose import LARGEST, Array

EXPECTED_FILE = "expected a CSV file in UTF-8 with a header row and one row per resting pose"
# Most cells of a column that are named one by one where they are no numbers.
_MOST_CELLS = 3
# Most characters of a title that are shown.
_MOST_TITLE = 40
_NUMBER = re.compile(r"[-+]?[\d.,]+([eE][-+]?\d+)?")
# A line with its end, whichever of the three that is.
_LINE = re.compile(r"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+")
_MEANS = re.compile("mean|average|avg|mittel|durchschnitt|moyenne", re.IGNORECASE)

_PARQUET_MAGIC = b"PAR1"
_TEXT_BEGINNINGS = {"{": "JSON", "[": "JSON or TOML", "<": "XML, such as a robot's MJCF"}
# First cells of the files of each program.
VICON = ("segments", "trajectories", "devices", "joints", "model outputs")
_QUALISYS = "no_of_frames"
_SEPARATORS = (",", ";", "\t")


TEXT = np.dtypes.StringDType()
"""The type of columns of texts."""

Texts: TypeAlias = Sequence[str] | NDArray[Any]
# Rows at a time that are lists of texts.
_PIECE = 4096


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of text cells.

    Attributes:
        path: the file.
        names: of the columns, stripped, as in the header.
        line: (n,) line at which each row begins, counted from 1.
        header_line: line of the header; None if the file has no lines.
        cells: for each column the stripped texts, (n,) each; numbers with decimal points. Read from
            a file they are arrays of NumPy's strings, of 16 bytes a cell where a list of Python's
            has 70.
        word: how people count in it: "line", or "row" of a workbook.
        notes: sentences for the reader: what was left out or understood.
    """

    path: Path
    names: tuple[str, ...]
    line: NDArray[np.int64]
    header_line: int | None
    cells: Sequence[Texts]
    word: str = "line"
    notes: tuple[str, ...] = ()
    _seen: dict[tuple[int, bool], Array] = field(default_factory=dict)

    def error(
        self, text: str, *, row: int | None = None, column: str | None = None
    ) -> InputFileError:
        """An error at a row (counted from 0) or, without one, in the header."""
        line = self.header_line if row is None else int(self.line[row])
        word = self.word if self.header_line is not None else "row"
        return InputFileError.at(self.path, text, line=line, column=column, line_word=word)

    def numbers(self, index: int, *, blank_is_nan: bool) -> Array:
        """Numbers (n,) of one column, as written; NaN for missing readings, if allowed.

        Raises:
            InputFileError: with every cell that is no number.
        """
        if (index, blank_is_nan) not in self._seen:  # checks read columns again
            self._seen[index, blank_is_nan] = self._numbers(index, blank_is_nan)
        return self._seen[index, blank_is_nan].copy()

    def _numbers(self, index: int, blank_is_nan: bool) -> Array:
        cells = self.cells[index]
        try:  # most columns hold nothing else
            values = np.fromiter(map(float, cells), float, len(cells))
            if np.all(np.abs(values) <= LARGEST) and "_" not in "".join(cells):
                return values
        except ValueError:
            pass
        if blank_is_nan:
            cells = ["" if cell.lower() in NOT_READ else cell for cell in cells]
        try:
            values = np.array([float(cell) if cell else math.nan for cell in cells])
        except ValueError:
            raise self._faults(index, cells, blank_is_nan) from None
        blank = np.array([not cell for cell in cells])
        odd = np.any((np.abs(values) <= LARGEST) == blank) or "_" in "".join(cells)
        if odd or (np.any(blank) and not blank_is_nan):
            raise self._faults(index, cells, blank_is_nan)
        return values

    def _faults(self, index: int, cells: Texts, blank_is_nan: bool) -> InputFileError:
        name = self.names[index]
        faults = [(row, text) for row, cell in enumerate(cells)
                  if (text := fault_of(cell, blank_is_nan))]  # fmt: skip
        told = [(int(self.line[row]), text) for row, text in faults]
        word = self.word if self.header_line is not None else "row"
        return _first_few(self.path, told, name, word)


def _first_few(
    path: Path, faults: Sequence[tuple[int, str]], column: str | None, word: str
) -> InputFileError:
    """The error about faults of one kind at several lines: the first ones, and where others are."""
    told = [
        InputFileError.at(path, text, line=line, column=column, line_word=word)
        for line, text in faults[:_MOST_CELLS]
    ]
    if others := [str(line) for line, _text in faults[_MOST_CELLS:]]:
        text = f"{len(others)} more like these, {plural(len(others), word)} {some(others, 8)}"
        told.append(InputFileError.at(path, text, column=column))
    return InputFileError.together(told)


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
    """Read a CSV, a Parquet file or a workbook (told apart by content, not by name).

    Args:
        path: of the file; ``book.xlsx:sheet`` is a sheet of a workbook, else the first one is read.

    Raises:
        InputFileError: of another kind, not text, or rows that do not fit the header.
    """
    file, sheet = of_sheet(path)
    if file.is_dir():
        raise InputFileError.at(path, f"is a folder; {EXPECTED_FILE}")
    data = read_bytes(file, EXPECTED_FILE)
    if data.startswith(_PARQUET_MAGIC):
        return _read_parquet(path)
    if is_workbook(data):
        rows = sheet_rows(path, file, sheet)
        titles, said = _titles(((number, cells) for number, cells in rows), "row")
        return _of_rows(path, rows[titles:], ";", "row", said)
    text, notes = decoded(path, data, EXPECTED_FILE)
    del data  # of a million rows more than 100 MB
    return _read_csv(path, text, notes)


def _read_csv(path: Path, text: str, notes: list[str]) -> Table:
    first = next(_content(text), None)
    # so Excel says what separates the cells below
    said = re.fullmatch(r'"?sep=(.)"?', first[1].strip()) if first else None
    begin = 1 if said else 0
    first = next(islice(_content(text), begin, None), None)
    if first is None:
        raise InputFileError.at(path, f"is empty; {EXPECTED_FILE}")
    _check_first_line(path, *first)
    split = said[1] if said else "[,;\t]"
    lines = islice(_content(text), begin, None)
    titles, above = _titles(((number, re.split(split, line)) for number, line in lines), "line")
    begin += titles
    header = next(islice(_content(text), begin, None))
    separator = said[1] if said else _separator(path, *header)
    rows = _csv_rows(path, islice(_content(text), begin, None), separator)
    return _of_rows(path, rows, separator, "line", [*notes, *above])


def _content(text: str) -> Iterator[tuple[int, str]]:
    """The lines with something in them that is no comment, with their numbers and their ends."""
    for number, match in enumerate(_LINE.finditer(text), start=1):
        line = match[0]
        if line.strip() and not (line.lstrip()[0] == "#" and is_comment(line)):
            yield number, line


def _titles(rows: Iterable[tuple[int, Sequence[str]]], word: str) -> tuple[int, list[str]]:
    """How many rows with one text alone are above a row of several names; and a note on them."""
    titles: list[str] = []
    for count, (number, cells) in enumerate(rows):
        filled = [text for cell in cells if (text := cell.strip(' "\r\n'))]
        if len(filled) != 1:
            names = len(filled) > 1 and not any(map(_NUMBER.fullmatch, filled))
            if not titles or not names:
                break
            noun = "a title" if count == 1 else "titles"
            return count, [f"Left out: {plural(count, word)} {', '.join(titles)}, {noun}."]
        if QUANTITY.fullmatch(spelled(filled[0])) or _NUMBER.fullmatch(filled[0]):
            break
        titles.append(f"{number} ({filled[0][:_MOST_TITLE]})")
    return 0, []


def _of_rows(
    path: Path,
    rows: Iterable[tuple[int, list[str]]],
    separator: str,
    word: str,
    notes: Sequence[str],
) -> Table:
    """The table of rows with their lines, the header first; those without any text are none."""
    stripped = ((line, [cell.strip() for cell in row]) for line, row in rows)
    filled: Iterator[tuple[int, list[str]]] = (pair for pair in stripped if any(pair[1]))
    first = next(filled, None)
    if first is None:
        raise InputFileError.at(path, f"is empty; {EXPECTED_FILE}")
    header_line, header = first
    if names := numbered_headers(header):
        header, filled = names, chain([first], filled)
    grid = _Grid.of(filled, header)
    header = header[: grid.width(header)]
    _check_cell_counts(path, header_line, header, grid, word)
    cells, lines = grid.cells[: len(header)], grid.lines
    end, left_out = _without_statistics(header, cells, lines, word)
    if end == 0:
        text = "has a header but no rows; expected one row per resting pose"
        raise InputFileError.at(path, text, line=header_line, line_word=word)
    cells = [column[:end] for column in cells]
    said = _plain_numbers(header, cells, separator)
    notes = (*notes, *left_out, *said)
    return Table(path, tuple(header), lines[:end], header_line, cells, word, notes)


@dataclass(frozen=True)
class _Odd:
    """A row with another number of cells than the header, or with the header's.

    Attributes:
        line: where it is. count: of its cells. filled: the same without empty ones at its end.
        again: whether it is the header.
    """

    line: int
    count: int
    filled: int
    again: bool


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells by column, as many as the header has, and what is odd about rows.

    A million rows as lists of texts would take gigabytes.
    """

    lines: NDArray[np.int64]
    cells: list[NDArray[Any]]
    odd: list[_Odd]

    @classmethod
    def of(cls, rows: Iterable[tuple[int, list[str]]], header: Sequence[str]) -> _Grid:
        """The grid of rows with their lines; what is beyond the header is not kept."""
        width, title = len(header), _bare(header)
        lines, odd = list[NDArray[np.int64]](), list[_Odd]()
        pieces: list[list[NDArray[Any]]] = [[] for _ in header]
        rows = iter(rows)
        while some := list(islice(rows, _PIECE)):
            for line, row in some:
                again = row[0] == header[0] and _bare(row) == title
                if again or len(row) != width:
                    odd.append(_Odd(line, len(row), len(_bare(row)), again))
                    row[width:] = [""] * max(width - len(row), 0)
            lines.append(np.array([line for line, _row in some]))
            columns = zip(*(row for _line, row in some), strict=True)
            for piece, column in zip(pieces, columns, strict=True):
                piece.append(np.array(column, dtype=TEXT))
        cells = []
        while pieces:
            cells.append(np.concatenate(pieces.pop(0) or [np.array([], dtype=TEXT)]))
        return cls(np.concatenate(lines) if lines else np.zeros(0, dtype=np.int64), cells, odd)

    def width(self, header: Sequence[str]) -> int:
        """Columns without those at the end that have neither a name nor a cell.

        Spreadsheets write separators for columns that are empty.
        """
        out, most = len(header), max((row.filled for row in self.odd), default=0)
        while not header[out - 1] and most < out and not np.any(self.cells[out - 1] != ""):
            out -= 1
        return out


def _bare(row: Sequence[str]) -> Sequence[str]:
    """A row without empty cells at its end."""
    end = len(row)
    while end and not row[end - 1]:
        end -= 1
    return row[:end]


def _plain_numbers(names: list[str], cells: list[NDArray[Any]], separator: str) -> list[str]:
    """Give numbers decimal points and nothing else, in place; notes about them.

    Columns without numbers are left as they are: a run's name may be 1.5.
    """
    which = [k for k, name in enumerate(names) if spelled(name) != "run"]
    # a file has one style, so columns that are ours show it, if there are any
    ours = [k for k in which if QUANTITY.fullmatch(spelled(names[k]))] or which
    odd = {k for k in which if not OF_NUMBERS.fullmatch("".join(cells[k]))}
    style = Style([cells[k] for k in ours] if odd else [], comma=separator != ",")
    for k in which if style.comma else odd:
        cells[k] = np.array([style.plain(cell) for cell in cells[k]], dtype=TEXT)
    return style.notes()


def _without_statistics(
    names: list[str], cells: list[NDArray[Any]], lines: NDArray[np.int64], word: str
) -> tuple[int, list[str]]:
    """How many rows there are without those below that are computed from them, and a note.

    Such a row begins with a word for it. As the name of a run that word counts only where the row
    has no whole command, or where it is a mean.
    """

    def row_at(k: int) -> list[str]:
        return [column[k] for column in cells]

    commands = [k for k, name in enumerate(names) if spelled(name).startswith(("cmd_", "length_"))]
    end = len(lines)
    while end and (said := is_statistic(row := row_at(end - 1))):
        named = spelled(names[row.index(said)]) == "run"
        if named and all(row[k] for k in commands) and not _MEANS.match(said):
            break
        end -= 1
    if end == len(lines):
        return end, []
    left = [f"{lines[k]} ({is_statistic(row_at(k))})" for k in range(end, len(lines))]
    noun = plural(len(left), word)
    return end, [f"Left out: {noun} {some(left, 8)}, computed from the other rows."]


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
    path: Path, numbered: Iterable[tuple[int, str]], separator: str
) -> Iterator[tuple[int, list[str]]]:
    """Rows of cells, each with its first line."""
    begun: list[int] = []  # lines of the row that is being read

    def lines() -> Iterator[str]:
        for number, line in numbered:
            begun.append(number)
            yield line

    blanks = separator != "\t"
    try:
        for row in csv.reader(lines(), delimiter=separator, strict=True, skipinitialspace=blanks):
            yield begun[0], row
            begun.clear()
    except csv.Error as error:
        text = f"cannot be split into cells: {error}; look for a quotation mark without its partner"
        raise InputFileError.at(path, text, line=begun[0]) from None


def _check_cell_counts(
    path: Path, header_line: int, header: list[str], grid: _Grid, word: str
) -> None:
    n_columns, faults = len(header), list[tuple[int, str]]()
    for row in grid.odd:
        if row.again:
            text = f"expected a row of cells, got the header ({word} {header_line}) again; are two "
            text += "files in one? Give them one at a time"
            faults.append((row.line, text))
        elif row.count < n_columns or row.filled > n_columns:
            text = (
                f"expected {counted(n_columns, 'cell')} as in the header ({word} {header_line}), "
                f"got {counted(row.count, 'cell')}"
            )
            if row.line == grid.lines[-1] and row.count < n_columns:
                text += "; it is the last line: is the file cut off?"
            if row.count > n_columns:
                text += (
                    "; a decimal comma splits a number in two: write 1.5, not 1,5, or put "
                    "semicolons between cells"
                )
            faults.append((row.line, text))
    if faults:
        raise _first_few(path, faults, None, word)


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
        names = tuple(name.strip() for name in content.column_names)
        cells = [
            np.array(["" if v is None else str(v).strip() for v in column.to_pylist()], dtype=TEXT)
            for column in content.columns
        ]
    except UnicodeDecodeError as error:
        text = f"expected names and texts in UTF-8, got bytes that are not ({error.object[:20]!r})"
        raise InputFileError.at(path, f"{text}; write the file again") from None
    except (pyarrow.ArrowException, OSError) as error:
        raise InputFileError.at(path, f"cannot be read as Parquet: {error}") from None
    if content.num_rows == 0:
        raise InputFileError.at(path, "has columns but no rows; expected one row per resting pose")
    return Table(
        path=path, names=names, line=np.arange(1, content.num_rows + 1), header_line=None,
        cells=cells,
    )  # fmt: skip


# The text of a CSV, as it is read above: every file of rows is written here.


def table_text(columns: Mapping[str, Sequence[Any] | Array], digits: int | None = None) -> str:
    """Columns of one length by name as CSV, with so many significant digits, or all.

    Numbers that are missing or not finite are empty cells.
    """
    return "".join(table_lines(columns, digits))


def table_lines(
    columns: Mapping[str, Sequence[Any] | Array], digits: int | None = None
) -> Iterator[str]:
    """The lines of :func:`table_text`."""
    yield ",".join(columns) + "\n"
    for row in zip(*columns.values(), strict=True):
        yield ",".join(_cell(value, digits) for value in row) + "\n"


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
