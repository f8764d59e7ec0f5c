"""How far the platform is from where it was wanted, whatever a model predicts: tracking errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.fit.least_squares.problem import BY_NAME, Kind, Problem
from crosscheck.fit.least_squares.state import State
from crosscheck.measurements.data import Measurements
from seecr.description.joints import locked
from seecr.pose import Array
from seecr.units import in_unit, short

# The kinds of readings that have a wanted value, with the columns of a wanted pose.
_PARTS = (("position", slice(0, 3)), ("orientation", slice(3, 7)))


@dataclass(frozen=True)
class Away:
    """Distances of one kind, such as of positions.

    Attributes:
        kind: "position" or "orientation". unit: unit of the numbers. rows: number of rows.
        rms, max: root mean square and largest of the rows' distances: lengths of whole vectors.
        row, line: where the largest is, counted from 0, and in its file.
    """

    kind: str
    unit: str
    rows: int
    rms: float
    max: float
    row: int
    line: int


@dataclass(frozen=True)
class Tracking:
    """How far readings are from the wanted poses.

    Attributes:
        wanted: whether these are stated (columns ``want_*``); else they are the commanded poses.
        through_tracker: whether the model's tracker does not read poses as they are. Readings are
            then compared with what it would read at the wanted poses.
        away: distances by kind.
    """

    wanted: bool
    through_tracker: bool
    away: tuple[Away, ...]

    def as_json(self) -> dict[str, Any]:
        """As in ``comparison.json``: null for a kind that was not read or not wanted."""
        by_kind = {one.kind: one for one in self.away}
        return {
            "from": "wanted" if self.wanted else "commanded",
            "through_tracker": self.through_tracker,
            **{kind: by_kind.get(kind) for kind, _columns in _PARTS},
        }

    @property
    def title(self) -> str:
        """What the distances are of, in words."""
        words = "off the wanted poses" if self.wanted else "off the commanded poses"
        return f"{words}, read through the model's tracker" if self.through_tracker else words

    def words(self, data: Measurements) -> str:
        """The distances in one line, with the places of the largest in the data."""
        parts = []
        for one in self.away:
            factor, unit = in_unit(one.unit)
            rms, most = short(factor * one.rms), short(factor * one.max)
            parts.append(
                f"{one.kind} {rms} {unit} rms, {most} {unit} at most (line {data.place(one.row)})"
            )
        return f"{self.title}: {'; '.join(parts)}"


def tracking(problem: Problem, state: State) -> Tracking | None:
    """How far the readings of a problem are from the wanted poses, else from the commanded ones.

    All rows count, also those for which the model has no equilibrium. Directions that the joints
    lock do not count: no command moves the platform there. The model matters only for what its
    tracker reads.

    Returns:
        the distances; None if no reading has a wanted value.
    """
    data = problem.data
    poses = data.command_pose if data.wanted is None else data.wanted
    if poses is None:
        return None
    there = np.asarray(np.isfinite(poses))
    whole = np.where(there, poses, problem.robot.reference_pose)
    seen = problem.experiment.readings_at(state.terms.effects, whole)
    as_they_are = (whole[:, :3], whole[:, 3:])
    through = not all(map(np.array_equal, (seen.position, seen.quat_wxyz), as_they_are))
    raw, moves = problem.residuals(seen), ~locked(problem.robot)
    away = []
    for name, columns in _PARTS:
        kind = BY_NAME[name]
        given = there[:, columns]
        if name == "orientation":  # of a quaternion no part is wanted by itself
            given = np.repeat(np.all(given, axis=1, keepdims=True), 3, axis=1)
        both = given & problem.measured[:, kind.columns] & moves[kind.columns]
        one = _away(problem, kind, np.where(both, raw[:, kind.columns], np.nan))
        away += [] if one is None else [one]
    return Tracking(data.wanted is not None, through, tuple(away)) if away else None


def _away(problem: Problem, kind: Kind, off: Array) -> Away | None:
    """The distances of errors (n, 3) of one kind, NaN where nothing was read or wanted."""
    rows = np.flatnonzero(np.isfinite(off).any(axis=1))
    if len(rows) == 0:
        return None
    sizes = np.linalg.norm(np.nan_to_num(off[rows]), axis=1)
    top = int(np.argmax(sizes))
    row = int(rows[top])
    return Away(
        kind=kind.name,
        unit=kind.si,
        rows=len(rows),
        rms=float(np.sqrt(np.mean(sizes**2))),
        max=float(sizes[top]),
        row=row,
        line=int(problem.data.line[row]),
    )
