"""A tracker's log, whatever file it came from: bodies and markers in time."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted, some
from seecr.errors import InputFileError
from seecr.pose import Array, quat_conjugate, quat_multiply, quat_rotate

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
        bodies, markers = dict(self.bodies), dict(self.markers)
        lost: list[str] = []
        for name, (position, quat) in self.bodies.items():
            rows = _not_seen(position)
            if rows.any():
                nothing = rows[:, None]
                bodies[name] = (
                    np.where(nothing, np.nan, position),
                    None if quat is None else np.where(nothing, np.nan, quat),
                )
                lost.append(f"{name} in {counted(int(rows.sum()), 'row')}")
        for name, position in self.markers.items():
            rows = _not_seen(position)
            if rows.any():
                markers[name] = np.where(rows[:, None], np.nan, position)
                lost.append(f"{name} in {counted(int(rows.sum()), 'row')}")
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
