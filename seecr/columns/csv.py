"""A file of rows and named columns, CSV or Parquet, as text with the line of each cell.

This module does not know what a column means. Errors name the line and column of the mistake.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
_MEANS = re.compile("mean|average|avg|mittel|durchschnitt|moyenne", re.IGNORECASE)

_PARQUET_MAGIC = b"PAR1"
_TEXT_BEGINNINGS = {"{": "JSON", "[": "JSON or TOML", "<": "XML, such as a robot's MJCF"}
# First cells of the files of each program.
VICON = ("segments", "trajectories", "devices", "joints", "model outputs")
_QUALISYS = "no_of_frames"
_SEPARATORS = (",", ";", "\t")


@dataclass(frozen=True, eq=False)
class Table:
    """Named columns of text cells.

    Attributes:
        path: the file.
        names: of the columns, stripped, as in the header.
        line: (n,) line at which each row begins, counted from 1.
        header_line: line of the header; None if the file has no lines.
        cells: for each column the stripped texts, (n,) each; numbers with decimal points.
        word: how people count in it: "line", or "row" of a workbook.
        notes: sentences for the reader: what was left out or understood.
    """

    path: Path
    names: tuple[str, ...]
    line: NDArray[np.int64]
    header_line: int | None
    cells: Sequence[Sequence[str]]
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
            values = np.array(list(map(float, cells)))
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

    def _faults(self, index: int, cells: Sequence[str], blank_is_nan: bool) -> InputFileError:
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
    return _read_csv(path, text, notes)


def _read_csv(path: Path, text: str, notes: list[str]) -> Table:
    numbered = [
        (number, line)
        for number, line in enumerate(io.StringIO(text, newline=""), start=1)
        if line.strip() and not (line.lstrip()[0] == "#" and is_comment(line))
    ]
    # so Excel says what separates the cells below
    said = re.fullmatch(r'"?sep=(.)"?', numbered[0][1].strip()) if numbered else None
    numbered = numbered[1:] if said else numbered
    if not numbered:
        raise InputFileError.at(path, f"is empty; {EXPECTED_FILE}")
    _check_first_line(path, *numbered[0])
    split = said[1] if said else "[,;\t]"
    titles, above = _titles(((number, re.split(split, line)) for number, line in numbered), "line")
    numbered = numbered[titles:]
    separator = said[1] if said else _separator(path, *numbered[0])
    rows = _csv_rows(path, numbered, separator)
    return _of_rows(path, rows, separator, "line", [*notes, *above])


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
    path: Path, rows: list[tuple[int, list[str]]], separator: str, word: str, notes: Sequence[str]
) -> Table:
    """The table of rows with their lines, the header first; those without any text are none."""
    stripped = [(line, [cell.strip() for cell in row]) for line, row in rows]
    stripped = [(line, row) for line, row in stripped if any(row)]
    if not stripped:
        raise InputFileError.at(path, f"is empty; {EXPECTED_FILE}")
    if names := numbered_headers(stripped[0][1]):
        stripped = [(stripped[0][0], names), *stripped]
    (header_line, header), *body = stripped
    while not header[-1] and not any(any(row[len(header) - 1 :]) for _, row in body):
        header = header[:-1]  # spreadsheets write separators for columns that are empty
    body = [(line, _trimmed(row, len(header))) for line, row in body]
    _check_cell_counts(path, header_line, header, body, word)
    body, left_out = _without_statistics(header, body, word)
    if not body:
        text = "has a header but no rows; expected one row per resting pose"
        raise InputFileError.at(path, text, line=header_line, line_word=word)
    cells = [list(column) for column in zip(*(row for _, row in body), strict=True)]
    cells, said = _plain_numbers(header, cells, separator)
    lines = np.array([line for line, _ in body])
    notes = (*notes, *left_out, *said)
    return Table(path, tuple(header), lines, header_line, cells, word, notes)


def _trimmed(row: list[str], width: int) -> list[str]:
    """A row without empty cells beyond the header's."""
    return row[:width] if len(row) > width and not any(row[width:]) else row


def _plain_numbers(
    names: list[str], cells: list[list[str]], separator: str
) -> tuple[list[list[str]], list[str]]:
    """Cells whose numbers have decimal points and nothing else, and notes about them.

    Columns without numbers are left as they are: a run's name may be 1.5.
    """
    which = [k for k, name in enumerate(names) if spelled(name) != "run"]
    # a file has one style, so columns that are ours show it, if there are any
    ours = [k for k in which if QUANTITY.fullmatch(spelled(names[k]))] or which
    odd = {k for k in which if not OF_NUMBERS.fullmatch("".join(cells[k]))}
    style = Style((cell for k in ours for cell in cells[k] if odd), comma=separator != ",")
    for k in which if style.comma else odd:
        cells[k] = [style.plain(cell) for cell in cells[k]]
    return cells, style.notes()


def _without_statistics(
    names: list[str], body: list[tuple[int, list[str]]], word: str
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """The rows without those below them that are computed from them, and a note.

    Such a row begins with a word for it. As the name of a run that word counts only where the row
    has no whole command, or where it is a mean.
    """
    commands = [k for k, name in enumerate(names) if spelled(name).startswith(("cmd_", "length_"))]
    end = len(body)
    while end and (said := is_statistic(body[end - 1][1])):
        row = body[end - 1][1]
        named = spelled(names[row.index(said)]) == "run"
        if named and all(row[k] for k in commands) and not _MEANS.match(said):
            break
        end -= 1
    if end == len(body):
        return body, []
    named_rows = [f"{line} ({is_statistic(row)})" for line, row in body[end:]]
    noun = plural(len(named_rows), word)
    text = f"Left out: {noun} {some(named_rows, 8)}, computed from the other rows."
    return body[:end], [text]


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
    path: Path, header_line: int, header: list[str], body: list[tuple[int, list[str]]], word: str
) -> None:
    n_columns, faults = len(header), list[tuple[int, str]]()
    for line, row in body:
        if row == header:
            text = f"expected a row of cells, got the header ({word} {header_line}) again; are two "
            text += "files in one? Give them one at a time"
            faults.append((line, text))
        elif len(row) != n_columns:
            text = (
                f"expected {counted(n_columns, 'cell')} as in the header ({word} {header_line}), "
                f"got {counted(len(row), 'cell')}"
            )
            if line == body[-1][0] and len(row) < n_columns:
                text += "; it is the last line: is the file cut off?"
            if len(row) > n_columns:
                text += (
                    "; a decimal comma splits a number in two: write 1.5, not 1,5, or put "
                    "semicolons between cells"
                )
            faults.append((line, text))
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
            ["" if value is None else str(value).strip() for value in column.to_pylist()]
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
