"""Platforms on slide and hinge joints: from joint values to poses, and back."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import (
    Array,
    cross,
    pose_difference,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
)

# Allowed distance of a commanded pose from what the joints reach [robot's length, or rad].
_OFF_MANIFOLD = 1e-6
# Poses nearer than this [m or robot's length, rad] are the same but for rounding.
_EXACT = 1e-15
# Changes of a pose below this are rounding [m or robot's length, rad]; so many values show them.
_ROUNDING, _TRIES = 1e-12, 8
# Motions of joints are independent if one is not this near to a combination of the others.
_INDEPENDENT = 1e-9


def pose_of_values(robot: Robot, values: Array) -> tuple[Array, Array]:
    """Poses (n, 7), and the joints there (n, d, 7), for joint values (n, d) [m, rad].

    A joint is a row of kind (0 slide, 1 hinge), axis and point in the base frame. The first joint
    is the outermost, as in MJCF (product of exponentials from the reference pose).
    """
    values = np.atleast_2d(np.asarray(values, float))
    n = len(values)
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    shift = np.zeros((n, 3))  # x -> turn(x - o) + o + shift, with o the reference position
    origin = robot.reference_pose[:3]
    screws = np.zeros((n, len(robot.joints), 7))
    for j, joint in enumerate(robot.joints):
        axis = quat_rotate(turn, joint.axis)
        point = quat_rotate(turn, joint.point - origin) + origin + shift
        screws[:, j, 0] = 1.0 if joint.kind == "hinge" else 0.0
        screws[:, j, 1:4], screws[:, j, 4:7] = axis, point
        if joint.kind == "slide":
            shift = shift + axis * values[:, j : j + 1]
            continue
        own = quat_from_rotvec(axis * values[:, j : j + 1])
        shift = point + quat_rotate(own, origin + shift - point) - origin
        turn = quat_multiply(own, turn)
    quat = quat_multiply(turn, robot.reference_pose[3:])
    return np.concatenate([origin + shift, quat], axis=1), screws


def locked(robot: Robot) -> NDArray[np.bool_]:
    """(6,) which parts of the pose no joint changes: x y z, and rotations about x y z."""
    if not robot.joints:
        return np.zeros(6, dtype=bool)
    # any values will do: a part that they change has a rate almost everywhere
    values = np.random.default_rng(0).uniform(-1.0, 1.0, (_TRIES, len(robot.joints)))
    pose, _screws = pose_of_values(robot, values)
    off = np.abs(pose_difference(pose, np.tile(robot.reference_pose, (_TRIES, 1))))
    size = np.repeat([max(robot.length, 1.0), 1.0], 3)
    return np.asarray(np.all(off <= _ROUNDING * size, axis=0))


@lru_cache(maxsize=16)
def freedoms(robot: Robot) -> tuple[int, int, int]:
    """Independent motions of the platform: all, rotations that keep its origin, all rotations.

    They are 6, 3 and 3 for a free platform. A hinge beside the origin needs slides to keep it.
    """
    if not robot.joints:
        return 6, 3, 3
    # almost anywhere, joints move the platform in as many ways as they ever do
    values = np.random.default_rng(0).uniform(-1.0, 1.0, (_TRIES, len(robot.joints)))
    values = values * np.where(robot.hinges, 1.0, robot.length)
    poses, screws = pose_of_values(robot, values)
    columns = motion_columns(screws, poses[:, :3])
    columns = columns / np.where(robot.hinges, robot.length, 1.0)
    columns[:, 3:] *= robot.length
    whole, moving, turning = (
        int(np.linalg.matrix_rank(part, rtol=_INDEPENDENT).max())
        for part in (columns, columns[:, :3], columns[:, 3:])
    )
    return whole, whole - moving, turning


def values_of_pose(robot: Robot, poses: Array) -> tuple[Array, Array]:
    """Joint values (n, d) that bring the platform to poses (n, 7), and the joints there.

    Raises:
        InputError: the joints cannot reach a pose.
    """
    poses = np.atleast_2d(np.asarray(poses, float))
    values, reached, screws = _nearest(robot, poses)
    off = _off_joints(robot, poses, reached)
    if off is not None:
        which = f"commanded pose {off[0]}" if len(poses) > 1 else "the commanded pose"
        raise InputError(
            f"robot {robot.name}: its joints cannot reach {which}, it is off by "
            f"{off[1]}; expected a pose that they can reach"
        )
    return values, screws


def _nearest(robot: Robot, poses: Array) -> tuple[Array, Array, Array]:
    """Joint values (n, d) that bring the platform nearest to poses (n, 7), by Newton steps.

    Also returns the poses that it reaches, and the joints there, as :func:`pose_of_values` does.
    """
    values, before = np.zeros((len(poses), len(robot.joints))), np.inf
    exact = _EXACT * np.repeat([max(robot.length, 1.0), 1.0], 3)
    for _ in range(50):
        reached, screws = pose_of_values(robot, values)
        miss = pose_difference(poses, reached)
        if np.all(np.abs(miss) <= exact):
            return values, reached, screws
        columns = motion_columns(screws, reached[:, :3])
        if not (np.isfinite(columns).all() and np.isfinite(miss).all()):
            break  # so far away that rounding is longer than the robot
        step = np.einsum("nkd,nd->nk", np.linalg.pinv(columns), miss)
        values = values + step
        size = float(np.max(np.abs(step) / (1.0 + np.abs(values)), initial=0.0))
        # this close to convergence, steps that do not shrink are rounding
        if size < 1e-14 or 0.5 * before <= size < 1e-12:
            break
        before = size
    return values, *pose_of_values(robot, values)


def reachable(robot: Robot, poses: Array) -> Array:
    """The poses (n, 7) that the robot's joints can reach nearest to ``poses``."""
    return _nearest(robot, poses)[1] if robot.joints else poses


def _off_joints(robot: Robot, poses: Array, reached: Array) -> tuple[int, str] | None:
    """The row farthest from what the joints can reach, and its distance; None if none is."""
    miss = np.abs(pose_difference(poses, reached)) / np.repeat([robot.length, 1.0], 3)
    miss = np.where(np.isnan(miss), np.inf, miss)
    if not np.any(miss > _OFF_MANIFOLD):
        return None
    row, part = np.unravel_index(np.argmax(miss), miss.shape)
    size = miss[row, part] * (robot.length if part < 3 else 1.0)
    return int(row), f"{size:.3g} {'m' if part < 3 else 'rad'} in {'xyz'[part % 3]}"


def off_joints(robot: Robot, poses: Array) -> tuple[int, str] | None:
    """The row of poses (n, 7) that is farthest from what the joints can reach, and its distance.

    None if all can be reached; a platform with a free joint reaches all.
    """
    if not robot.joints:
        return None
    return _off_joints(robot, poses, _nearest(robot, poses)[1])


def motion_columns(screws: Array, position: Array) -> Array:
    """Derivatives (n, 6, d) of poses at positions (n, 3) by joint values; screws are (n, d, 7)."""
    axis, point, hinge = screws[..., 1:4], screws[..., 4:7], screws[..., :1]
    linear = np.where(hinge == 1.0, cross(axis, position[:, None] - point), axis)
    return np.swapaxes(np.concatenate([linear, axis * hinge], axis=-1), 1, 2)
