"""Files of other programs as rows of cells with their lines; blocks of numbers under labels."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seecr.columns.csv import show, taken_for
from seecr.counted import counted
from seecr.errors import InputFileError
from seecr.files import read_text
from seecr.pose import LARGEST, Array

Row = list[str]

_SEPARATORS = (",", ";", "\t")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class FileRows:
    """A file's rows.

    Attributes:
        path: the file. cells: of each line, stripped; none for an empty line.
    """

    path: Path
    cells: Sequence[Row]

    @classmethod
    def of(cls, path: Path, expected: str) -> FileRows:
        """Read a file whose cells are separated by commas, semicolons or tabs.

        Raises:
            InputFileError: missing, not UTF-8 or empty.
        """
        lines = read_text(path, expected).split("\n")
        if not any(line.strip() for line in lines):
            raise InputFileError.at(path, f"is empty; {expected}")
        head = "".join(lines[:20])
        mark = max(_SEPARATORS, key=head.count)
        reader = csv.reader((line.replace('"', "") if line.count('"') % 2 else line
                             for line in lines), delimiter=mark)  # fmt: skip
        try:
            cells = [[cell.strip() for cell in row] for row in reader]
        except csv.Error as error:
            text = f"cannot be split into cells: {error}; {expected}"
            raise InputFileError.at(path, text, line=reader.line_num) from None
        if mark != ",":
            cells = [
                [c.replace(",", ".") if _DECIMAL_COMMA.fullmatch(c) else c for c in row]
                for row in cells
            ]
        return cls(path, cells)

    def error(self, text: str, row: int | None = None, column: str | None = None) -> InputFileError:
        """An error at a row, counted from 0."""
        line = None if row is None else row + 1
        return InputFileError.at(self.path, text, line=line, column=column)

    @property
    def first(self) -> int:
        """The first row that is not empty."""
        return next(k for k, row in enumerate(self.cells) if any(row))

    def taken_for(self) -> str:
        """What kind of file this seems to be, and what to do with it; "" if unknown."""
        names = self.cells[self.first]
        if any(name.startswith(("cmd_", "meas_")) for name in names):
            return "; these are columns of a log: crosscheck import poses"
        return taken_for(names)


def unit_quaternions(values: Array, refuse: Callable[[str, int], InputFileError]) -> Array:
    """Unit quaternions (n, 4) of what a file has; rows of zeros, as of a body not seen, are NaN.

    Args:
        values: (n, 4) as read, NaN if missing.
        refuse: makes the error of a text and a row, counted from 0.

    Raises:
        InputFileError: a quaternion that is not of length 1.
    """
    size = np.linalg.norm(values, axis=1)
    size[size == 0.0] = np.nan
    wrong = np.flatnonzero(np.abs(size - 1.0) > 0.01)
    if len(wrong):
        k = int(wrong[0])
        raise refuse(f"expected a quaternion of length 1, got {size[k]:.3g}; export it again", k)
    return np.asarray(values / size[:, None])


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of numbers under a row of labels.

    Attributes:
        rows: the file. label_row: index of the labels. body: indices of the numbers.
    """

    rows: FileRows
    label_row: int
    body: range

    @property
    def labels(self) -> Row:
        """The cells of the row of labels."""
        return self.rows.cells[self.label_row]

    @property
    def line(self) -> NDArray[np.int64]:
        """(n,) line of each row of numbers in the file, from 1."""
        return np.arange(self.body.start + 1, self.body.stop + 1)

    def numbers(self, columns: Sequence[int]) -> Array:
        """The numbers (n, k) of some columns; NaN for empty cells.

        Raises:
            InputFileError: a row that is too short, or a cell that is not a finite number.
        """
        out = np.empty((len(self.body), len(columns)))
        for k, row in enumerate(self.body):
            cells = self.rows.cells[row]
            try:
                out[k] = [float(cells[c]) if cells[c] else np.nan for c in columns]
            except (IndexError, ValueError):
                raise self._fault(row, columns) from None
        if np.any(np.abs(out) > LARGEST):
            k = int(np.argmax((np.abs(out) > LARGEST).any(axis=1)))
            raise self._fault(self.body[k], columns)
        return out

    def _fault(self, row: int, columns: Sequence[int]) -> InputFileError:
        cells = self.rows.cells[row]
        if len(cells) <= max(columns):
            text = (
                f"expected {counted(len(self.labels), 'cell')} as in the row of labels (line "
                f"{self.label_row + 1}), got {len(cells)}"
            )
            if row == self.body[-1]:
                text += "; it is the last line: is the file cut off? Export it again"
            return self.rows.error(text, row)
        for c in columns:
            try:
                wrong = abs(float(cells[c] or "nan")) > LARGEST
            except ValueError:
                wrong = True
            if wrong:
                text = f"expected a number, got {show(cells[c])}; export the file again"
                return self.rows.error(text, row, self.labels[c] or f"number {c + 1}")
        raise AssertionError("a row without a fault")

    def check_whole(self) -> None:
        """Refuse a last row that is shorter than the others: the file was cut off."""
        sizes = {len(self.rows.cells[row]) for row in self.body[:-1]}
        last = len(self.rows.cells[self.body[-1]])
        if sizes and last < min(sizes):
            text = f"expected {counted(min(sizes), 'cell')} as in the rows before, got {last}"
            raise self.rows.error(
                f"{text}; it is the last line: is the file cut off? Export it again", self.body[-1]
            )

    def check_times(self, t_s: Array, label: str) -> None:
        """Refuse times (n,) [s] that are missing or do not increase."""
        wrong = np.flatnonzero(~(np.diff(t_s, prepend=-np.inf) > 0.0))
        if len(wrong) == 0:
            return
        k = int(wrong[0])
        before = "" if k == 0 else f" after {t_s[k - 1]:.9g} s"
        text = (
            f"expected times that increase{before}, got {t_s[k]:.9g} s; are two recordings in one "
        )
        raise self.rows.error(f"{text}file? Export them one at a time", self.body[k], label)


def check_body(rows: FileRows, body: range, what: str) -> None:
    """Refuse a block without rows."""
    if len(body) == 0:
        raise rows.error(f"has labels but no rows of {what}; is the file cut off?", body.start - 1)
