"""The lengths that the winches really pay out, command by command."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.twin.robot import TrueRobot
from crosscheck.twin.world import World
from seecr.commands import Commands
from seecr.pose import Array, pose_add, pose_difference, transform_points

# Number of points on the way to the first row of a run, and from row to row. The laws of cables
# with history take each step between two points as one in which the stretch does not turn round.
_APPROACH, _BETWEEN = 12, 8
# Parts of the way between two points in which winches are checked for reversals.
_WATCHED = 64


@dataclass(frozen=True, eq=False)
class Waypoints:
    """The commands with all points on the path, N in all.

    Attributes:
        pose: (N, 7) commanded; lengths: (N, m) [m] commanded, or None. told: whether these are told
            lengths, relative to the reference pose's rest lengths.
        row: (N,) the row that a point belongs to; is_row: (N,) whether it is that row.
        fresh: (N,) whether a run starts here, at rest: at the reference pose or its first row.
        elapsed: (N,) [s] since the point before.
    """

    pose: Array
    lengths: Array | None
    told: bool
    row: NDArray[np.int64]
    is_row: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    elapsed: Array


def waypoints_of(
    true: TrueRobot, commands: Commands, steps: NDArray[np.integer] | None = None
) -> Waypoints:
    """Every run from the reference pose straight to its first row, then from row to row.

    A run that starts at its first row has no way to it; a load changes before the motion.

    Args:
        true: the robot.
        commands: n rows.
        steps: (n,) numbers of points on the way to each row; by default twelve to the first row of
            a run, and eight from row to row.
    """
    robot, n = true.robot, len(commands)
    every = np.where(commands.starts, _APPROACH, _BETWEEN) if steps is None else steps
    clock = np.zeros(n) if commands.time is None else commands.time
    points: list[tuple[Array, Array, int, bool, bool, float]] = []
    none = np.zeros(0)
    guide = _guide(true)
    for k, starts, here in zip(range(n), commands.starts, commands.starts_here, strict=True):
        passed = max(float(clock[k] - clock[k - 1]), 0.0) if k else 0.0
        before = robot.reference_pose if starts else commands.pose[k - 1]
        paid, told = none, none
        if commands.lengths is not None:
            told = commands.lengths[k]
            paid = robot.rest_lengths if starts else commands.lengths[k - 1]
        if here:
            points.append((commands.pose[k], told, k, True, True, passed))
            continue
        if starts:
            points.append((robot.reference_pose, paid, k, False, True, passed))
            passed = 0.0
        elif _reloaded(commands, k):
            points.append((before, paid, k, False, False, 0.0))
        parts = np.arange(1, every[k] + 1) / every[k]
        poses = [*_straight_way(guide, before, commands.pose[k], parts[:-1]), commands.pose[k]]
        for pose, part in zip(poses, parts, strict=True):
            length = paid + part * (told - paid)
            points.append((pose, length, k, part == 1.0, False, passed / every[k]))
    path, lengths, *others = (np.array(part) for part in zip(*points, strict=True))
    return Waypoints(path, None if commands.lengths is None else lengths, commands.told, *others)


def _reloaded(commands: Commands, k: int) -> bool:
    """Whether a row has another load than the row before."""
    loads = commands.loads
    if loads is None:
        return False
    return any(
        not np.array_equal(values[k], values[k - 1], equal_nan=True)
        for values in (loads.mass, loads.centre, loads.wrench)
    )


def _guide(true: TrueRobot) -> World | None:
    """The robot as described, to be moved along its joints; None for a free platform."""
    if not true.robot.joints:
        return None
    return World(replace(_bare(true), pulley_radius=0.0))


def _straight_way(guide: World | None, before: Array, after: Array, parts: Array) -> Array:
    """Poses (k, 7) at fractions (k,) of a path, straight in pose or in joint values."""
    if guide is None:
        return pose_add(before, parts[:, None] * pose_difference(after, before))
    n = guide.places.n_platform
    ends = []
    for pose in (before, after):
        guide.place(pose)
        ends.append(guide.data.qpos[:n].copy())
    poses = np.empty((len(parts), 7))
    for k, part in enumerate(parts):
        guide.data.qpos[:n] = ends[0] + part * (ends[1] - ends[0])
        guide.update()
        poses[k] = guide.pose()
    return poses


def paid_out(true: TrueRobot, path: Waypoints, temperature: Array | None) -> Array:
    """Rest lengths (N, m) [m] at the points of a path.

    Args:
        true: the robot.
        path: its commands.
        temperature: (n,) [deg C] of the rows, or None.
    """
    absolute = path.lengths is not None and not path.told
    if path.lengths is None:
        told = _straight_change(true, path.pose)
    else:
        told = path.lengths - (0.0 if absolute else true.robot.rest_lengths)
    turned = told
    if true.backlash > 0.0:
        # lengths are commanded evenly: nothing reverses between two points
        watched = _watched(true, path) if path.lengths is None else [told[:0]] * len(told)
        turned = _with_play(told, watched, path.fresh, 0.5 * true.backlash)
    paid = (1.0 + true.gain) * turned + true.offset
    zero = 0.0 if absolute else 1.0
    for sine, cosine, radius in true.run_out:
        angle = told / radius
        paid = paid + sine * np.sin(angle) + cosine * (np.cos(angle) - zero)
    if not absolute:
        paid = paid + _zero(true)
    if temperature is not None and true.expansion != 0.0:
        warmer = temperature[path.row] - true.zero_temperature
        paid = paid * (1.0 + true.expansion * warmer)[:, None]
    return np.asarray(paid)


def _straight_change(true: TrueRobot, poses: Array) -> Array:
    """Straight lengths of the described robot minus those at its reference, (N, m) [m]."""
    return _straight(true, poses) - _straight(true, true.robot.reference_pose[None])


def _straight(true: TrueRobot, poses: Array) -> Array:
    robot = true.robot
    anchors = transform_points(poses, robot.anchor_points)
    return np.asarray(np.linalg.norm(anchors - robot.exit_points, axis=-1))


def _watched(true: TrueRobot, path: Waypoints) -> list[Array]:
    """Lengths (k, m) [m] commanded on the way to each of N points, in order.

    The squared length is taken at even steps. At a reversal it is replaced by the vertex of the
    parabola through a step and its neighbours, which is exact for a translation.
    """
    guide, home = _guide(true), _straight(true, true.robot.reference_pose[None])[0]
    # one step more at either end, to see reversals there too
    parts = np.arange(-1, _WATCHED + 2) / _WATCHED
    watched = []
    for k, pose in enumerate(path.pose):
        before = pose if path.fresh[k] else path.pose[k - 1]
        square = _straight(true, _straight_way(guide, before, pose, parts)) ** 2
        watched.append(np.sqrt(_with_vertices(square, parts[1:-1])) - home)
    return watched


def _with_vertices(value: Array, parts: Array) -> Array:
    """Values (k + 2, m) without the outer ones, at fractions (k,) of a path, with exact extrema."""
    earlier, now, later = value[:-2], value[1:-1], value[2:]
    rise, bend = 0.5 * (later - earlier), later - 2.0 * now + earlier
    near = (np.abs(rise) <= 0.5 * np.abs(bend)) & (bend != 0.0)
    steps = np.where(near, -rise / np.where(near, bend, 1.0), 0.0)
    at = parts[:, None] + steps * (parts[1] - parts[0])
    inside = near & (at > 0.0) & (at < 1.0)
    return np.where(inside, np.maximum(now + 0.5 * rise * steps, 0.0), now)


def _with_play(told: Array, watched: list[Array], fresh: NDArray[np.bool_], half: float) -> Array:
    """The drum stands still until the motor has taken up the play; it is centred at first."""
    drum = told.copy()
    for k in range(1, len(told)):
        if not fresh[k]:
            drum[k] = drum[k - 1]
            for motor in (*watched[k], told[k]):
                drum[k] = np.minimum(np.maximum(drum[k], motor - half), motor + half)
    return drum


def _zero(true: TrueRobot) -> Array:
    """Lengths (m,) [m] when the winches were zeroed, over the true geometry, as MuJoCo has it."""
    robot = true.robot
    bare = _bare(true)
    world = World(bare)
    if true.robot.joints and not np.array_equal(true.zero_pose, robot.reference_pose):
        # misplaced by hand, and so off its joints: placed as a free body
        world = World(replace(bare, robot=replace(robot, joints=())))
    world.place(true.zero_pose)
    if not world.wraps:
        raise CrosscheckError(
            f"robot {robot.name}: pulley_radius {true.pulley_radius:g} m leaves a cable no path "
            "over its sheave at the reference pose; expected anchor points aside of exit points"
        )
    pretension = robot.rest_lengths - _straight(true, robot.reference_pose[None])[0]
    return np.asarray(world.cable_lengths() + pretension)


def _bare(true: TrueRobot) -> TrueRobot:
    """The robot with no moving parts but the platform and its sheaves."""
    rigid = replace(true, compliance=0.0, compliance_up=0.0, winch_side=0.0)
    return replace(rigid, cable_weight=0.0, friction=0.0)
