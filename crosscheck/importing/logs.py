"""Files of other programs as rows of cells, and the tracker's log that is made of them."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seecr.columns.csv import show, taken_for
from seecr.counted import counted, some
from seecr.errors import InputFileError
from seecr.files import read_text
from seecr.pose import LARGEST, Array, quat_conjugate, quat_multiply, quat_rotate

# Rotates axes with Y up, as on screens, to axes with Z up: by 90 degrees about x.
_UPRIGHT = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
_MOST_NAMED = 12
# Positions of 0 0 0 are real if others are nearer to it than this part of the way that they span.
_NEAR = 0.01


@dataclass(frozen=True, eq=False)
class Stream:
    """One body in time, in the tracker's frame.

    Attributes:
        path: the file. t_s: (n,) [s], increasing. line: (n,) in the file.
        position: (n, 3) [m], NaN where it was lost.
        quat_wxyz: (n, 4), NaN where it was lost, or None.
    """

    path: Path
    t_s: Array
    line: NDArray[np.int64]
    position: Array
    quat_wxyz: Array | None = None

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(n,) whether the body was seen completely."""
        parts = [self.position] if self.quat_wxyz is None else [self.position, self.quat_wxyz]
        return np.asarray(np.isfinite(np.concatenate(parts, axis=1)).all(axis=1))

    def error(self, text: str, row: int | None = None) -> InputFileError:
        """An error in the file, at a row counted from 0."""
        return InputFileError.at(self.path, text, line=None if row is None else int(self.line[row]))


@dataclass(frozen=True, eq=False)
class Logged:
    """The content of a file.

    Attributes:
        path: the file. t_s: (n,) [s]. line: (n,) in the file.
        bodies: by name, position (n, 3) [m] and quaternions (n, 4) or None.
        markers: by name, positions (n, 3) [m].
        up: the axis that points up in it, "y" or "z".
        notes: what was done in reading it.
        began: the time of day at which t_s is 0, if the file states it.
    """

    path: Path
    t_s: Array
    line: NDArray[np.int64]
    bodies: Mapping[str, tuple[Array, Array | None]]
    markers: Mapping[str, Array]
    up: str = "z"
    notes: tuple[str, ...] = ()
    began: datetime | None = None

    def upright(self) -> Logged:
        """The same with Z up; a body without rotation stays so."""
        if self.up == "z":
            return self
        back = quat_conjugate(_UPRIGHT)

        def turned(quat: Array | None) -> Array | None:
            return None if quat is None else quat_multiply(quat_multiply(_UPRIGHT, quat), back)

        return replace(
            self,
            bodies={k: (quat_rotate(_UPRIGHT, p), turned(q)) for k, (p, q) in self.bodies.items()},
            markers={k: quat_rotate(_UPRIGHT, p) for k, p in self.markers.items()},
            up="z",
            notes=(*self.notes, "Y is up in the file: turned by 90 deg about x, so that Z is up"),
        )

    def seen_only(self) -> Logged:
        """The same without positions of exactly 0 0 0, which stand for "not seen"."""
        lost: list[str] = []

        def hidden(name: str, position: Array) -> NDArray[np.bool_]:
            rows = _not_seen(position)
            if rows.any():
                lost.append(f"{name} in {counted(int(rows.sum()), 'row')}")
            return rows[:, None]

        bodies: dict[str, tuple[Array, Array | None]] = {}
        for name, (place, quat) in self.bodies.items():
            rows = hidden(name, place)
            turned = None if quat is None else np.where(rows, np.nan, quat)
            bodies[name] = (np.where(rows, np.nan, place), turned)
        markers = {n: np.where(hidden(n, p), np.nan, p) for n, p in self.markers.items()}
        if not lost:
            return self
        note = f"positions of exactly 0 0 0 count as not seen: {some(lost, _MOST_NAMED)}"
        return replace(self, bodies=bodies, markers=markers, notes=(*self.notes, note))

    def body(self, name: str | None) -> Stream:
        """The named body, or the only one.

        Raises:
            InputFileError: none, several, or not that one.
        """
        found = list(self.bodies)
        if name is None and len(found) == 1:
            name = found[0]
        if name is None:
            what = (
                f"{len(found)} rigid bodies ({some(found, _MOST_NAMED)})"
                if found
                else "no rigid body"
            )
            todo = "name one with --body" if found else "name its markers with --markers"
            raise InputFileError.at(self.path, f"expected one rigid body, got {what}; {todo}")
        if name not in self.bodies:
            raise self._unknown("rigid body", name, found)
        return Stream(self.path, self.t_s, self.line, *self.bodies[name])

    def marker(self, name: str) -> Array:
        """The positions (n, 3) [m] of a marker.

        Raises:
            InputFileError: there is no such marker.
        """
        if name not in self.markers:
            raise self._unknown("marker", name, self.markers)
        return self.markers[name]

    def _unknown(self, what: str, name: str, known: Iterable[str]) -> InputFileError:
        near = difflib.get_close_matches(name, list(known), n=_MOST_NAMED, cutoff=0.0)
        there = ", ".join(near) or "none"
        text = f"has no {what} {name!r}; expected one of those it has, nearest first: {there}"
        return InputFileError.at(self.path, text)


def _not_seen(position: Array) -> NDArray[np.bool_]:
    """(n,) rows of exactly 0 0 0 in positions (n, 3) none of which else is near there."""
    zero = np.asarray(np.all(position == 0.0, axis=1))
    others = position[~zero & np.isfinite(position).all(axis=1)]
    if not zero.any() or len(others) == 0:
        return zero & False
    span = float(np.linalg.norm(np.ptp(others, axis=0)))
    near = float(np.min(np.linalg.norm(others, axis=1)))
    return zero & (near > _NEAR * span)


# Files of other programs as rows of cells with their lines; blocks of numbers under labels.

Row = list[str]

_SEPARATORS = (",", ";", "\t")
_CUT_OFF = "it is the last line: is the file cut off? Export it again"
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
    """Unit quaternions (n, 4) of values as read; rows of zeros, as of a body not seen, are NaN.

    Raises:
        InputFileError: one is not of length 1; ``refuse`` makes it of a text and a row from 0.
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

    @classmethod
    def of(cls, rows: FileRows, label_row: int, body: range) -> Block:
        """The block of these rows.

        Raises:
            InputFileError: it has no rows, or the last one is shorter than the others.
        """
        if len(body) == 0:
            text = "has labels but no rows of frames; is the file cut off?"
            raise rows.error(text, body.start - 1)
        least = min((len(rows.cells[row]) for row in body[:-1]), default=0)
        last = len(rows.cells[body[-1]])
        if last < least:
            text = f"expected {counted(least, 'cell')} as in the rows before, got {last}"
            raise rows.error(f"{text}; {_CUT_OFF}", body[-1])
        return cls(rows, label_row, body)

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

    def quaternions(self, columns: Sequence[int]) -> Array:
        """Unit quaternions (n, 4) of four columns; see :func:`unit_quaternions`."""
        return unit_quaternions(
            self.numbers(columns), lambda text, row: self.rows.error(text, self.body[row])
        )

    def _fault(self, row: int, columns: Sequence[int]) -> InputFileError:
        cells = self.rows.cells[row]
        if len(cells) <= max(columns):
            text = (
                f"expected {counted(len(self.labels), 'cell')} as in the row of labels (line "
                f"{self.label_row + 1}), got {len(cells)}"
            )
            text += f"; {_CUT_OFF}" if row == self.body[-1] else ""
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
