"""What the winches really pay out, command by command."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.truth.robot import TrueRobot
from crosscheck.truth.world import World
from seecr.pose import Array, pose_add, pose_difference, transform_points
from seecr.setup import Commands

WAYPOINTS = (12, 4)
"""Points looked at on the way to the first row of a run, and from row to row."""


@dataclass(frozen=True, eq=False)
class Way:
    """The commands with all points on the way, N in all.

    Attributes:
        pose: (N, 7) commanded; lengths: (N, m) [m] commanded, or None.
        row: (N,) the row a point belongs to; is_row: (N,) whether it is that row.
        fresh: (N,) at the reference pose, before a run.
        elapsed: (N,) [s] since the point before.
    """

    pose: Array
    lengths: Array | None
    row: NDArray[np.int64]
    is_row: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    elapsed: Array


def way_of(
    true: TrueRobot, commands: Commands, waypoints: tuple[int, int] = WAYPOINTS
) -> Way:
    """Every run from the reference pose straight to its first row, then from row to row."""
    robot, n = true.robot, len(commands)
    run = np.zeros(n, dtype=int) if commands.run is None else commands.run
    clock = np.zeros(n) if commands.time is None else commands.time
    points: list[tuple[Array, Array, int, bool, bool, float]] = []
    none = np.zeros(0)
    for k in range(n):
        starts = k == 0 or run[k] != run[k - 1]
        passed = max(float(clock[k] - clock[k - 1]), 0.0) if k else 0.0
        before = robot.reference_pose if starts else commands.pose[k - 1]
        paid, told = none, none
        if commands.lengths is not None:
            told = commands.lengths[k]
            paid = robot.rest_lengths if starts else commands.lengths[k - 1]
        if starts:
            points.append((robot.reference_pose, paid, k, False, True, passed))
            passed = 0.0
        steps = waypoints[0] if starts else waypoints[1]
        change = pose_difference(commands.pose[k], before)
        for s in range(1, steps + 1):
            part = s / steps
            pose = pose_add(before, part * change) if s < steps else commands.pose[k]
            length = paid + part * (told - paid)
            points.append((pose, length, k, s == steps, False, passed / steps))
    poses, lengths, *others = (np.array(part) for part in zip(*points, strict=True))
    return Way(poses, None if commands.lengths is None else lengths, *others)


def paid_out(true: TrueRobot, way: Way, temperature: Array | None) -> Array:
    """Rest lengths (N, m) [m] at the points of a way.

    Args:
        true: the robot.
        way: its commands.
        temperature: (n,) [deg C] of the rows, or None.
    """
    told = way.lengths if way.lengths is not None else _straight_change(true, way.pose)
    turned = told if true.backlash == 0.0 else _with_play(told, way.fresh, 0.5 * true.backlash)
    paid = (1.0 + true.gain) * turned + true.offset
    zero = 1.0 if way.lengths is None else 0.0
    for sine, cosine, radius in true.run_out:
        angle = told / radius
        paid = paid + sine * np.sin(angle) + cosine * (np.cos(angle) - zero)
    if way.lengths is None:
        paid = paid + _zero(true)
    if temperature is not None and true.expansion != 0.0:
        warmer = temperature[way.row] - true.zero_temperature
        paid = paid * (1.0 + true.expansion * warmer)[:, None]
    return np.asarray(paid)


def _straight_change(true: TrueRobot, poses: Array) -> Array:
    """Straight lengths of the described robot less those at its reference, (N, m) [m]."""
    return _straight(true, poses) - _straight(true, true.robot.reference_pose[None])


def _straight(true: TrueRobot, poses: Array) -> Array:
    robot = true.robot
    anchors = transform_points(poses, robot.anchor_points)
    return np.asarray(np.linalg.norm(anchors - robot.exit_points, axis=-1))


def _with_play(told: Array, fresh: NDArray[np.bool_], half: float) -> Array:
    """The drum stands still until the motor has taken up the play; centred as a run starts."""
    drum = told.copy()
    for k in range(1, len(told)):
        if not fresh[k]:
            drum[k] = np.minimum(np.maximum(drum[k - 1], told[k] - half), told[k] + half)
    return drum


def _zero(true: TrueRobot) -> Array:
    """Lengths (m,) [m] when the winches were zeroed, over the true geometry as MuJoCo has it."""
    robot = true.robot
    bare = replace(true, cable_weight=0.0, compliance=0.0, winch_side=0.0, friction=0.0)
    world = World(bare)
    if true.robot.joints and not np.array_equal(true.zero_pose, robot.reference_pose):
        # misplaced by hand, off its joints too: put there as a free body
        world = World(replace(bare, robot=replace(robot, joints=())))
    world.place(true.zero_pose)
    if not world.wraps:
        raise CrosscheckError(
            f"robot {robot.name}: pulley_radius {true.pulley_radius:g} m leaves a cable no way "
            "over its sheave at the reference pose; expected anchor points aside of exit points"
        )
    pretension = robot.rest_lengths - _straight(true, robot.reference_pose[None])[0]
    return world.cable_lengths() + pretension
