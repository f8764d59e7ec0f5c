"""Where along a sweep cables go slack: the stretches of its way with the same slack cables.

Between two commands with different slack cables the way is halved until the change is known to a
tolerance (bisection); if other cables are slack in the middle, both halves are searched.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr.arguments import finite
from seecr.commands import Commands
from seecr.effects.edits import setup_with
from seecr.equilibrium.following import moved, step_between
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import Array
from seecr.prediction.experiment import effects_of
from seecr.prediction.model import GivenEffects
from seecr.result import COORDINATES, Record, Result, named
from seecr.statics.solution import Solution, Status, check_solution
from seecr.statics.starts import Commanded, commands_from
from seecr.units import millimetres

# Most halvings, and most changes that are searched at a time: beyond, rounding decides what is
# slack.
_ROUNDS, _MOST = 60, 4096

_Key = tuple[bool, ...] | None
"""Which cables are slack; None where the platform does not come to rest."""


@dataclass(frozen=True, eq=False, repr=False)
class SlackSpan(Result):
    """A stretch of a sweep on which the same cables are slack.

    Attributes:
        run: number of the continuous motion that it belongs to, counted from 0.
        slack: names of the slack cables; None where the platform does not come to rest.
        rows: where it begins and ends, in rows of the sweep counted from 0: 2.5 is half way from
            row 2 to row 3.
        first, last: (7,) commanded poses there.
        width: [m] length of the commanded way of the platform's origin.
        turn: [rad] angle that the command turns by.
        within: [m] to which its beginning and its end are known, rotations times the robot's
            length; 0 at the ends of a run.
    """

    run: int
    slack: tuple[str, ...] | None
    rows: tuple[float, float]
    first: Array
    last: Array
    width: float
    turn: float
    within: tuple[float, float]

    @property
    def words(self) -> str:
        """What is slack there."""
        if self.slack is None:
            return "not at rest, or free to move"
        return f"{len(self.slack)} slack{': ' if self.slack else ''}{' '.join(self.slack)}"

    def lines(self) -> list[str]:
        """One line: where, how wide, and which cables."""
        places = (
            " ".join(f"{value + 0.0:.4f}" for value in 1e3 * pose[:3])
            for pose in (self.first, self.last)
        )
        return [f"x y z {' to '.join(places)} mm, {millimetres(self.width)} wide: {self.words}"]

    def as_json(self) -> Record:
        """One entry of ``zones`` in ``sweep.json``."""
        return {
            "run": self.run,
            "slack": self.slack,
            "slack_cables": None if self.slack is None else len(self.slack),
            "from": self.first,
            "to": self.last,
            "from_row": self.rows[0],
            "to_row": self.rows[1],
            "width_m": self.width,
            "turn_rad": self.turn,
            "from_within_m": self.within[0],
            "to_within_m": self.within[1],
        }

    def records(self) -> Sequence[Record]:
        """One row."""
        told = self.as_json()
        sizes = ("width_m", "turn_rad", "from_within_m", "to_within_m")
        return [
            {
                "run": self.run,
                "slack_cables": told["slack_cables"],
                "slack": None if self.slack is None else " ".join(self.slack),
                **named("from_{}", COORDINATES, self.first),
                **named("to_{}", COORDINATES, self.last),
                **{size: told[size] for size in sizes},
            }
        ]


def slack_spans(
    solution: Solution,
    commands: Commanded | None = None,
    *,
    effects: GivenEffects = (),
    tolerance: float = 1e-6,
) -> tuple[SlackSpan, ...]:
    """The stretches of a sweep with the same slack cables, with their widths (paper, Figs 7, 11).

    The command goes straight from row to row of a run. A stretch that is left again before the next
    row is not seen, if the same cables are slack in both rows. Rows at which one of SciPy's
    searches gave up are passed by: they say nothing about the robot.

    Args:
        solution: of the sweep's commanded poses. If it was followed, so are the changes: from the
            row before, in steps that are halved. If it has a history, they are not searched: they
            are half way between rows, and known to within that.
        commands: its commands, with runs and loads; default: one run of ``solution.command``. A
            load hangs from the beginning of the way to its row.
        effects: those of the solution.
        tolerance: [m] within which changes are found, rotations times the robot's length.

    Returns:
        the stretches, in the order of the sweep.

    Raises:
        InputError: not a solution, other commands than its own, lengths, or a tolerance that is not
            above zero.

    Example:
        ``seecr.slack_spans(solution)``
    """
    check_solution(solution)
    near = finite(tolerance, "tolerance")
    if near.shape or not near > 0.0:
        raise InputError(f"tolerance must be one number above zero [m], got {tolerance!r}")
    robot = solution.robot
    told = commands_from(solution.command if commands is None else commands, robot)
    if told.lengths is not None:
        raise InputError("slack_spans needs commanded poses (n, 7); got lengths")
    if told.pose.shape != solution.command.shape or np.any(told.pose != solution.command):
        raise InputError("slack_spans: expected the commands of the solution, got other poses")
    if len(told) == 0:
        return ()
    setup = setup_with(effects_of(effects, robot), robot, told)
    fixed = setup.has_history or bool(setup.laws)
    solved = np.flatnonzero([status is not Status.GAVE_UP for status in solution.status])
    if len(solved) == 0:
        return ()
    way = _Way(solution, told, effects)
    if len(solved) < len(told):
        way = _Way(solution.rows(solved), told.rows(solved), effects)
    spans = way.spans(way.changes(np.inf if fixed else float(near)))
    return tuple(_renumbered(span, solved, told) for span in spans)


def _renumbered(span: SlackSpan, rows: NDArray[np.intp], commands: Commands) -> SlackSpan:
    """A stretch of a way through some rows (k,) of commands, with the rows and runs of all."""
    first, last = np.interp(span.rows, np.arange(len(rows)), rows)
    runs = np.cumsum(commands.starts) - 1
    return replace(span, rows=(float(first), float(last)), run=int(np.unique(runs[rows])[span.run]))


@dataclass(frozen=True, eq=False)
class _Change:
    """Where on the way from row k the slack cables change: between parts a and b of it.

    ``rest`` (7,) is where the platform rests at a, NaN where it does not.
    """

    k: int
    a: float
    b: float
    before: _Key
    after: _Key
    rest: Array

    @property
    def at(self) -> float:
        """In rows."""
        return self.k + 0.5 * (self.a + self.b)


@dataclass(frozen=True, eq=False)
class _Way:
    """A sweep, and how it is searched between its rows."""

    solution: Solution
    commands: Commands
    effects: GivenEffects

    @property
    def steps(self) -> Array:
        """(n - 1, d) [m] from row to row, rotations times the robot's length."""
        poses = self.commands.pose
        return step_between(self.solution.robot, poses[1:], poses[:-1])

    def poses(self, at: Array) -> Array:
        """Commanded poses (k, 7) at places on the way, in rows (k,)."""
        if len(self.commands) == 1:
            return np.repeat(self.commands.pose, len(at), axis=0)
        row = np.clip(np.floor(at).astype(int), 0, len(self.commands) - 2)
        step = (at - row)[:, None] * self.steps[row]
        return moved(self.solution.robot, self.commands.pose[row], step)

    def changes(self, tolerance: float) -> list[_Change]:
        """All changes between rows of a run, in their order, each known to a tolerance [m]."""
        keys, starts, rests = _keys(self.solution), self.commands.starts, self.solution.pose
        pairs = [k for k in range(len(keys) - 1) if not starts[k + 1] and keys[k] != keys[k + 1]]
        found = [_Change(k, 0.0, 1.0, keys[k], keys[k + 1], rests[k]) for k in pairs]
        if not found or not np.isfinite(tolerance):
            return found
        size = np.linalg.norm(self.steps, axis=1)
        for _ in range(_ROUNDS):
            wide = [c for c in found if (c.b - c.a) * size[c.k] > tolerance]
            if not wide or len(wide) > _MOST:
                break
            done = [c for c in found if (c.b - c.a) * size[c.k] <= tolerance]
            found = [*done, *self._halved(wide)]
        return sorted(found, key=lambda change: change.at)

    def _halved(self, changes: Sequence[_Change]) -> Iterator[_Change]:
        row = np.array([c.k for c in changes])
        middle = np.array([0.5 * (c.a + c.b) for c in changes])
        # on the way to a row its load hangs already
        trial = replace(
            self.commands.rows(row + 1), pose=self.poses(row + middle), run=np.arange(len(row))
        )
        start = None
        if self.solution.jumps is not None:
            # moved with its command, or from the command where it does not rest
            rest = np.array([c.rest for c in changes])
            step = (middle - np.array([c.a for c in changes]))[:, None] * self.steps[row]
            rest = np.where(np.isfinite(rest).all(axis=1, keepdims=True), rest, trial.pose)
            start = moved(self.solution.robot, rest, step)
        found = solve(self.solution.robot, trial, effects=self.effects, start=start)
        each = zip(changes, middle.tolist(), _keys(found), found.pose, strict=True)
        for c, at, key, pose in each:
            if key != c.before:
                yield _Change(c.k, c.a, at, c.before, key, c.rest)
            if key != c.after:
                yield _Change(c.k, at, c.b, key, c.after, pose)

    def spans(self, changes: Sequence[_Change]) -> Iterator[SlackSpan]:
        """The stretches between changes."""
        n, keys = len(self.commands), _keys(self.solution)
        first = np.flatnonzero(self.commands.starts)
        size = np.linalg.norm(self.steps, axis=1) if n > 1 else np.zeros(0)
        for run, (start, after) in enumerate(zip(first, [*first[1:], n], strict=True)):
            own = [c for c in changes if start <= c.k < after - 1]
            edges = [float(start), *(c.at for c in own), float(after - 1)]
            within = [0.0, *(0.5 * (c.b - c.a) * float(size[c.k]) for c in own), 0.0]
            slack = [keys[start], *(c.after for c in own)]
            for i, key in enumerate(slack):
                rows = edges[i], edges[i + 1]
                yield self._span(run, key, rows, (within[i], within[i + 1]))

    def _span(
        self, run: int, key: _Key, rows: tuple[float, float], within: tuple[float, float]
    ) -> SlackSpan:
        between = np.arange(np.floor(rows[0]) + 1.0, np.ceil(rows[1]))
        poses = self.poses(np.array([rows[0], *between, rows[1]]))
        robot = self.solution.robot
        step = step_between(robot, poses[1:], poses[:-1])
        turned = np.linalg.norm(step[:, robot.hinges], axis=1).sum() / robot.length
        width = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1).sum()
        names = None
        if key is not None:
            names = tuple(n for n, s in zip(robot.cable_names, key, strict=True) if s)
        return SlackSpan(run, names, rows, poses[0], poses[-1], float(width), float(turned), within)


def _keys(solution: Solution) -> list[_Key]:
    """Which cables are slack in each row."""
    rows = zip(solution.slack.tolist(), solution.converged, strict=True)
    return [tuple(slack) if rests else None for slack, rests in rows]
