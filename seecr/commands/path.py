"""The path of a robot through its commands: waypoints, and where cables reverse between them.

A run starts at the robot's reference pose (or at its first row, if the commands say so) and goes
straight to its first row and from row to row, in the platform's degrees of freedom. Loads change at
the row before, ahead of the motion. Effects with history depend on this path (see
:mod:`seecr.compiled.history` and :func:`seecr.commands.data.play`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seecr.commands.data import Commands
from seecr.description.joints import motion_columns, pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array, cross, pose_add, pose_difference, quat_rotate

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


def waypoints_of(robot: Robot, commands: Commands, waypoints: float | None = None) -> Path:
    """The waypoints of commands: straight from the reference pose, straight between rows.

    Args:
        robot: as described.
        commands: n rows.
        waypoints: largest motion of the command between them [robot's length]; by default a
            twentieth, with two to eight waypoints on the way to each row.
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
    steps = np.where(commands.starts_here, 0, steps)
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
    whole = Commands(
        pose=pose,
        lengths=lengths,
        run=(np.zeros(n, dtype=np.int64) if commands.run is None else commands.run)[source],
        time=None if commands.time is None else commands.time[source],
        temperature=None if commands.temperature is None else commands.temperature[source],
        told=commands.told,
        loads=None if commands.loads is None else commands.loads.rows(source),
        stands=None if commands.stands is None else commands.stands[source],
        clock=None if commands.clock is None else commands.clock[source],
    )
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
