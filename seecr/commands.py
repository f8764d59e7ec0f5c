"""Commands to the winches and known loads, row by row, and the path through them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import motion_columns, pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import LARGEST, Array, all_finite, cross, pose_add, pose_difference, quat_rotate

# Known loads: what the platform carried in each row.


@dataclass(frozen=True, eq=False)
class Loads:
    """Known payloads and external wrenches of n rows, such as weights hung on the platform.

    A payload's weight follows the model's gravity. It is attached before the way to its row begins.

    Attributes:
        mass: (n,) [kg] of the payload.
        centre: (n, 3) [m] of the payload, in the platform's frame; NaN if it is the platform's own
            centre of mass, including any effect on that.
        wrench: (n, 6) [N, N m] force at the platform's origin and moment, base frame.
    """

    mass: Array
    centre: Array
    wrench: Array

    @classmethod
    def of(
        cls,
        n: int,
        mass: Array | None = None,
        centre: Array | None = None,
        wrench: Array | None = None,
    ) -> Loads:
        """Loads of n rows; one number or vector applies to all rows, None means no load.

        Raises:
            InputError: a shape that does not fit n rows, or numbers that are not finite.
        """
        return cls(
            _filled("payload mass", mass, 0.0, (n,)),
            _filled("payload centre", centre, np.nan, (n, 3)),
            _filled("wrench", wrench, 0.0, (n, 6)),
        )

    def __len__(self) -> int:
        return len(self.mass)

    def rows(self, index: NDArray[np.integer]) -> Loads:
        """The loads of some rows."""
        return Loads(self.mass[index], self.centre[index], self.wrench[index])

    def followed_by(self, other: Loads) -> Loads:
        """These rows, then those of another."""
        return Loads(
            *(
                np.concatenate([getattr(self, name), getattr(other, name)])
                for name in ("mass", "centre", "wrench")
            )
        )

    @property
    def kinds(self) -> NDArray[np.int64]:
        """(n,) number of each row's load among the different loads."""
        loaded = self.mass[:, None] != 0.0
        # NaN (the platform's own centre) equals NaN, and the centre does not matter without a
        # payload
        own = np.isnan(self.centre) & loaded
        centre = np.where(loaded & ~own, self.centre, 0.0)
        table = np.concatenate([self.mass[:, None], own, centre, self.wrench], axis=1)
        return np.asarray(np.unique(table, axis=0, return_inverse=True)[1].reshape(-1))

    @property
    def changes(self) -> NDArray[np.bool_]:
        """(n,) rows with another load than the row before."""
        return np.concatenate([[False], np.diff(self.kinds) != 0])


def _filled(name: str, value: Array | None, otherwise: float, shape: tuple[int, ...]) -> Array:
    given = np.asarray(otherwise if value is None else value, float)
    try:
        out = np.array(np.broadcast_to(given, shape))
    except ValueError:
        raise InputError(f"{name} must be {shape}, got {given.shape}") from None
    if not all_finite(out[~np.isnan(out)]) or (otherwise == 0.0 and np.isnan(out).any()):
        raise InputError(f"{name} must be finite numbers, none beyond {LARGEST:g}, got {given}")
    return out


@dataclass(frozen=True, eq=False)
class Commands:
    """The commands to a robot, row by row, in time order within a run.

    Attributes:
        pose: (n, 7) commanded poses; if lengths are commanded, where the solver starts.
        lengths: (n, m) [m] commanded rest lengths, or None.
        run: (n,) int, number of the continuous motion that a row belongs to.
        time: (n,) [s] or None.
        temperature: (n,) [deg C] or None.
        passed: (k, n, m) [m] commanded changes of length (or lengths) passed on the way to each
            row, in order: at its start and where cables reverse; None if no effect needs them.
        told: whether lengths are in the plain model's terms: at the reference pose they are the
            robot's rest lengths, and from there the winch turns by the difference. Otherwise they
            are absolute: the whole cable from the exit point on.
        loads: known loads, or None.
        stands: (n,) bool, rows whose run starts at its first row, at rest; other runs start at the
            reference pose. None means that all of them do.
        clock: (n,) int, number of the clock of ``time``; None if there is only one.
        parts: names (n,) of the "file" and the "run" of each row, for effects that have values of
            their own for each.
        line: (n,) line of each row in its file; None without a file.
    """

    pose: Array
    lengths: Array | None = None
    run: NDArray[np.int64] | None = None
    time: Array | None = None
    temperature: Array | None = None
    passed: Array | None = None
    told: bool = False
    loads: Loads | None = None
    stands: NDArray[np.bool_] | None = None
    clock: NDArray[np.int64] | None = None
    parts: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    line: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.pose)

    def rows(self, index: NDArray[np.integer]) -> Commands:
        """Some rows, for what does not depend on the rows before."""

        def of(values: NDArray[Any] | None) -> NDArray[Any] | None:
            return None if values is None else values[index]

        return Commands(
            pose=self.pose[index], lengths=of(self.lengths), run=of(self.run), time=of(self.time),
            temperature=of(self.temperature), told=self.told, stands=of(self.stands),
            clock=of(self.clock), line=of(self.line),
            loads=None if self.loads is None else self.loads.rows(index),
            parts={kind: names[index] for kind, names in self.parts.items()},
        )  # fmt: skip

    @property
    def starts(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run: the first, and those with another run than the row before."""
        fresh = np.zeros(len(self), dtype=bool)
        fresh[:1] = True
        if self.run is not None:
            fresh[1:] = self.run[1:] != self.run[:-1]
        return fresh

    @property
    def absolute(self) -> bool:
        """Whether absolute lengths are commanded."""
        return self.lengths is not None and not self.told

    @property
    def starts_here(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run where they are, not at the reference pose."""
        return self.starts & (False if self.stands is None else self.stands)

    def change(self, robot: Robot) -> Array:
        """Commanded changes of length (n, m) [m] since the winches were zeroed.

        For absolute lengths these are the lengths themselves.
        """
        if self.lengths is None:
            return self.nominal_change(robot)
        return self.lengths - robot.rest_lengths if self.told else self.lengths

    def home(self, robot: Robot) -> Array:
        """The value of ``change`` at the reference pose, (m,) [m]."""
        return robot.rest_lengths if self.absolute else np.zeros(robot.n_cables)

    def before(self, rows: Array, home: Array) -> Array:
        """The values of ``rows`` (n, k) at the start of the way to each row.

        They are those of the row before, or ``home`` (k,) if a run starts there, or those of the
        row itself if its run starts where it is.
        """
        before = np.roll(rows, 1, axis=0)
        before[self.starts] = home
        return np.where(self.starts_here[:, None], rows, before)

    def nominal_change(self, robot: Robot) -> Array:
        """Straight lengths at the commanded poses minus those at the reference pose, (n, m) [m].

        Zero for passive lines.
        """
        if self._kept and self._kept[0][0] is robot:
            return self._kept[0][1]
        change = robot.nominal_lengths(self.pose)
        change -= robot.reference_lengths
        change[:, ~robot.driven] = 0.0  # nothing is paid out for passive lines
        if len(self) <= _MOST_KEPT:
            self._kept[:] = [(robot, change)]
        return change

    # for the last robot asked for, since every trial of a fit asks again
    _kept: list[tuple[Robot, Array]] = field(default_factory=list, repr=False, init=False)


# Rows of which the changes of length are kept: 5 MB with eight cables. Of more they are computed
# again, which takes less than a tenth of solving them.
_MOST_KEPT = 10_000


def play(
    told: Array, starts: NDArray[np.bool_], half_width: Array, passed: Array | None = None
) -> Array:
    """The play operator: an output that lags its input (n, m) by up to the half-width (m,).

    It starts centred at the start of each run (``starts`` (n,)): on that row, or on ``passed[0]``.
    Between rows the input passes through ``passed`` (k, n, m), if given, monotonically in between.
    """
    way = told[None] if passed is None else np.concatenate([passed, told[None]])
    low, high = way[0] - half_width, way[0] + half_width
    low[starts] = high[starts] = way[0, starts]
    # an input moves the output to the nearest point of a band about it. A sequence of inputs acts
    # as one band, too: computed for each row first, then for 2, 4, 8, ... rows
    for at in way[1:]:
        low, high = _band_of_both(low, high, at - half_width, at + half_width)
    rows = 1
    while np.any(low < high):
        low[rows:], high[rows:] = _band_of_both(low[:-rows], high[:-rows], low[rows:], high[rows:])
        rows *= 2
    return np.asarray(low)


def _band_of_both(low: Array, high: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """The band equivalent to ``low`` and ``high`` followed by ``least`` and ``most``."""
    return np.clip(low, least, most), np.clip(high, least, most)


# The path of a robot through its commands: waypoints, and where cables reverse between them.
#
# A run starts at the robot's reference pose (or at its first row, if the commands say so) and goes
# straight to its first row and from row to row, in the platform's degrees of freedom. Loads change
# at the row before, ahead of the motion. Effects with history depend on this path (see
# seecr.compiled.history and `play`).

# Largest motion of the command from waypoint to waypoint [robot's length], and the fewest and most
# waypoints on the way to a row. Where a cable's tension turns between two waypoints, hysteresis and
# friction miss it.
_STEP, _LEAST, _MOST = 0.05, 2, 8
# Reversals of a cable's length are searched in pieces in which the platform turns by less than this
# [rad]. Two reversals in one piece would go unseen; they differ by less than a millionth of an
# anchor point's distance.
_PIECE = 0.02
# Derivative of a squared length that is rounding, relative to the largest squared length; and most
# iterations until it is that small (a few are needed).
_STILL, _ROUNDS = 1e-14, 20


@dataclass(frozen=True, eq=False)
class Path:
    """Rows with the waypoints between them.

    Attributes:
        robot: as described; given: commands of the n rows.
        commands: of all N waypoints.
        rows: (n,) index of each row among the waypoints.
        source: (N,) index of the row that a waypoint belongs to.
        fresh: (N,) bool, waypoints at which a run starts.
        elapsed: (N,) [s] since the waypoint before.
        steps: (n,) numbers of waypoints on the way to each row, with the row.
    """

    robot: Robot
    given: Commands
    commands: Commands
    rows: NDArray[np.integer]
    source: NDArray[np.integer]
    fresh: NDArray[np.bool_]
    elapsed: Array
    steps: NDArray[np.integer]

    @cached_property
    def onward(self) -> NDArray[np.bool_]:
        """(N,) bool, waypoints as far from the one before as that is from its own, on one line."""
        return np.asarray(np.arange(len(self.source)) - (self.rows - self.steps)[self.source] >= 2)

    def on_the_way_to(self, rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(N,) bool, waypoints at or before one of some rows (n,) in its run."""
        run, at = np.cumsum(self.fresh), self.rows[rows]
        last = np.full(run[-1] + 1 if len(run) else 0, -1)
        np.maximum.at(last, run[at], at)
        return np.asarray(np.arange(len(run)) <= last[run])

    @property
    def new_clock(self) -> NDArray[np.bool_]:
        """(N,) bool, waypoints at which another clock begins, including the first."""
        clock = self.commands.clock
        changes = np.zeros(len(self.source), dtype=bool)
        if clock is not None:
            changes[1:] = np.diff(clock) != 0
        changes[:1] = True
        return changes

    @cached_property
    def turning(self) -> Commands:
        """Commands of all waypoints with the reversals in between, for backlash."""
        return turning(self.robot, self.commands)

    @cached_property
    def given_turning(self) -> Commands:
        """Commands of the n rows with the reversals in between."""
        return turning(self.robot, self.given)


def waypoints_of(
    robot: Robot, commands: Commands, waypoints: float | None = None, *, times: int = 1
) -> Path:
    """The waypoints of commands: straight from the reference pose, straight between rows.

    The command moves from one to the next by at most ``waypoints`` [robot's length]; by default a
    twentieth, with two to eight on the way to each row. Each of these steps is taken in so many
    ``times`` as many.
    """
    n = len(commands)
    ways, fresh = _ways(robot, commands), commands.starts
    # the way begins with a waypoint of its own if a run starts or the load changes
    begins = fresh.copy() if commands.loads is None else fresh | commands.loads.changes
    moved = _moved(ways, commands)
    if waypoints is None:
        steps = np.ceil(moved / _STEP).astype(int).clip(_LEAST, _MOST)
    else:
        steps = np.ceil(moved / waypoints).astype(int).clip(1)
    steps = np.where(commands.starts_here, 0, times * steps)
    source = np.repeat(np.arange(n), steps + begins)
    rows = np.cumsum(steps + begins) - 1
    step = np.arange(len(source)) - (rows - steps)[source]
    first = (step == 0) & fresh[source]
    part = step / np.maximum(steps, 1)[source]
    pose = ways.at(source, part)[0]
    pose[first], pose[rows] = robot.reference_pose, commands.pose
    lengths = None
    if commands.lengths is not None:
        last = commands.before(commands.lengths, robot.rest_lengths)
        lengths = last[source] + part[:, None] * (commands.lengths - last)[source]
        lengths[rows] = commands.lengths
    since = _since(commands)
    # a run's clock starts at its first row: until then the robot waits at the reference pose
    elapsed = np.where(fresh, 0.0, since / np.maximum(steps, 1))[source]
    elapsed[step == 0] = np.where(fresh, since, 0.0)[source[step == 0]]
    run = np.zeros(n, dtype=np.int64) if commands.run is None else commands.run
    rows_of = replace(commands, parts={}, line=None).rows(source)
    whole = replace(rows_of, pose=pose, lengths=lengths, run=run[source])
    return Path(robot, commands, whole, rows, source, first, elapsed, steps)


def _moved(ways: _Ways, commands: Commands) -> Array:
    """Motion of the command on the way to each row, (n,), over the robot's length."""
    robot = ways.robot
    if commands.lengths is not None:
        last = commands.before(commands.lengths, robot.rest_lengths)
        return np.asarray(np.abs(commands.lengths - last).max(axis=1) / robot.length)
    hinges = robot.hinges
    return np.asarray(np.linalg.norm(ways.change / np.where(hinges, 1.0, robot.length), axis=1))


def _since(commands: Commands) -> Array:
    """(n,) [s] since the row before; zero where another clock begins."""
    if commands.time is None:
        return np.zeros(len(commands))
    since = np.maximum(np.diff(commands.time, prepend=commands.time[:1]), 0.0)
    if commands.clock is not None:
        since[1:][np.diff(commands.clock) != 0] = 0.0
    return since


@dataclass(frozen=True, eq=False)
class _Ways:
    """The straight ways to n rows, in poses or in joint values.

    Attributes:
        start: (n, 7) poses or (n, d) values; change: (n, 6) or (n, d).
        turn: (n,) [rad] upper bound of the platform's rotation on the way.
    """

    robot: Robot
    start: Array
    change: Array
    turn: Array

    def at(self, row: NDArray[np.integer], part: Array) -> tuple[Array, Array]:
        """Poses (k, 7) at fractions (k,) of the ways to rows (k,), and their derivatives (k, 6)."""
        change = self.change[row]
        moved = part[:, None] * change
        if not self.robot.joints:
            return pose_add(self.start[row], moved), change
        pose, screws = pose_of_values(self.robot, self.start[row] + moved)
        return pose, np.einsum("nkd,nd->nk", motion_columns(screws, pose[:, :3]), change)

    def rates(
        self, row: NDArray[np.integer], part: Array, exits: Array, anchors: Array
    ) -> tuple[Array, Array]:
        """Half the derivatives (k, c) [m^2] of squared lengths, and lengths (k, c) [m]."""
        pose, rate = (one[:, None] for one in self.at(row, part))
        arm = quat_rotate(pose[..., 3:], anchors)
        span = pose[..., :3] + arm - exits
        rates = np.sum(span * (rate[..., :3] + cross(rate[..., 3:], arm)), axis=-1)
        rates[np.abs(rates) < _STILL * np.max(self.robot.reference_lengths) ** 2] = 0.0
        return rates, np.linalg.norm(span, axis=-1)


def _ways(robot: Robot, commands: Commands) -> _Ways:
    if not robot.joints:
        start = commands.before(commands.pose, robot.reference_pose)
        change = pose_difference(commands.pose, start)
        return _Ways(robot, start, change, np.linalg.norm(change[:, 3:], axis=1))
    values = values_of_pose(robot, commands.pose)[0]
    start = commands.before(values, np.zeros(robot.n_dof))
    change = values - start
    return _Ways(robot, start, change, np.abs(change[:, robot.hinges]).sum(axis=1))


def turning(robot: Robot, commands: Commands) -> Commands:
    """The same commands, with what is passed on the way to each row (``Commands.passed``).

    A cable's commanded length reverses between rows where its derivative is zero. Commanded lengths
    never do.
    """
    told = commands.change(robot)
    start = commands.before(told, commands.home(robot))
    if commands.lengths is not None:
        return replace(commands, passed=start[None])
    ways = _ways(robot, commands)
    row, cable, number, length = _turns(ways)
    passed = np.tile(told, (2 + int(np.max(number, initial=-1)), 1, 1))
    passed[0] = start
    passed[1 + number, row, cable] = length - robot.reference_lengths[cable]
    return replace(commands, passed=passed)


def _turns(
    ways: _Ways,
) -> tuple[NDArray[np.integer], NDArray[np.integer], NDArray[np.integer], Array]:
    """Where cables reverse: row, cable, number of reversals before on that way, and length [m]."""
    robot = ways.robot
    # without rotation the squared length is a parabola: its derivative has one zero at most
    pieces = 1 + np.ceil(ways.turn / _PIECE).astype(int)
    row = np.repeat(np.arange(len(pieces)), pieces + 1)
    first = np.cumsum(pieces + 1) - pieces - 1
    part = (np.arange(len(row)) - first[row]) / pieces[row]
    rates = ways.rates(row, part, robot.exit_points, robot.anchor_points)[0]
    turned = ((rates[:-1] < 0.0) != (rates[1:] < 0.0)) & (row[:-1] == row[1:])[:, None]
    at, cable = np.nonzero(turned)
    before = np.cumsum(turned, axis=0) - turned
    on = row[at]
    number = before[at, cable] - before[first[on], cable]
    ends = (part[at], rates[at, cable]), (part[at + 1], rates[at + 1, cable])
    return on, cable, number, _length_at_rest(ways, on, cable, *ends)


def _length_at_rest(
    ways: _Ways, row: NDArray[np.integer], cable: NDArray[np.integer],
    one: tuple[Array, Array], other: tuple[Array, Array],
) -> Array:  # fmt: skip
    """Lengths (k,) [m] of cables (k,) where their derivative is zero between two parts of the way.

    By the Illinois variant of the regula falsi (Dowell and Jarratt, BIT 11, 1971).
    """
    (a, at_a), (b, at_b) = one, other
    exits = ways.robot.exit_points[cable, None]
    anchors = ways.robot.anchor_points[cable, None]
    length = np.zeros(len(row))
    for _ in range(_ROUNDS):
        c = b - at_b * (b - a) / (at_b - at_a)
        rates, lengths = ways.rates(row, c, exits, anchors)
        at_c, length = rates[:, 0], lengths[:, 0]
        if not np.any(at_c):
            break
        across = (at_c < 0.0) != (at_b < 0.0)
        a, at_a = np.where(across, b, a), np.where(across, at_b, 0.5 * at_a)
        b, at_b = c, at_c
    return length
