"""Platforms on slide and hinge joints: from joint values to poses, and back."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, cross, pose_difference

OFF_MANIFOLD = 1e-6
"""Allowed distance of a commanded pose from what joints reach [robot's length, or rad]."""
# Poses nearer than this [m or robot's length, rad] are the same but for rounding.
_EXACT = 1e-15
# Changes of a pose below this are rounding [m or robot's length, rad]; so many values show them.
_ROUNDING, _TRIES = 1e-12, 8
# Motions of joints are independent if one is not this near to a combination of the others.
_INDEPENDENT = 1e-9
# Most that a hinge turns in one of Newton's steps [rad]: longer ones lead anywhere.
_LONGEST_TURN = 1.0


def pose_of_values(robot: Robot, values: Array) -> tuple[Array, Array]:
    """Poses (n, 7), and the joints there (n, d, 7), for joint values (n, d) [m, rad].

    A joint is a row of kind (0 slide, 1 hinge), axis and point in the base frame. The first joint
    is the outermost, as in MJCF (product of exponentials from the reference pose).
    """
    from seecr.compiled.joint_kinematics import (
        N_CURRENT,  # takes a while to import
        place_home_batch,
    )

    values = np.array(np.atleast_2d(values), float, order="C")
    poses = np.empty((len(values), 7))
    current = np.empty((*values.shape, N_CURRENT))
    home = robot.reference_pose.copy()
    place_home_batch(_home_screws(robot), values, home, poses, current)
    return poses, current[..., :7].copy()


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


def shifts(robot: Robot) -> Array:
    """(k, 3) orthonormal directions along which joints move the platform without turning it.

    They are those at the reference pose: three of a free platform, two of a planar one.
    """
    if not robot.joints:
        return np.eye(3)
    pose, screws = pose_of_values(robot, np.zeros((1, len(robot.joints))))
    columns = motion_columns(screws, pose[:, :3])[0] / np.where(robot.hinges, robot.length, 1.0)
    _left, sizes, right = np.linalg.svd(robot.length * columns[3:])
    still = right[int(np.sum(sizes > _INDEPENDENT)) :]
    _left, sizes, right = np.linalg.svd(still @ columns[:3].T)
    return np.asarray(right[: int(np.sum(sizes > _INDEPENDENT))])


def values_of_pose(robot: Robot, poses: Array) -> tuple[Array, Array]:
    """Joint values (n, d) that bring the platform to poses (n, 7), and the joints there.

    Raises:
        InputError: the joints cannot reach a pose.
    """
    poses = np.atleast_2d(np.asarray(poses, float))
    values, reached, screws, certain = _nearest(robot, poses)
    off = None if certain else _off_joints(robot, poses, reached)
    if off is not None:
        which = f"commanded pose {off[0]}" if len(poses) > 1 else "the commanded pose"
        raise InputError(
            f"robot {robot.name}: its joints cannot reach {which}, it is off by "
            f"{off[1]}; expected a pose that they can reach"
        )
    return values, screws


def _nearest(robot: Robot, poses: Array) -> tuple[Array, Array, Array, bool]:
    """Joint values (n, d) that bring the platform nearest to poses (n, 7).

    Also returns the poses that it reaches, and the joints there, as :func:`pose_of_values` does;
    and whether all are known to be those that were asked for.
    """
    values, reached, screws, off = _in_closed_form(robot, poses)
    left = np.flatnonzero(off > _ROUNDING)
    if len(left):
        values[left] = _searched(robot, poses[left], values[left], off[left])
        reached[left], screws[left] = pose_of_values(robot, values[left])
    return values, reached, screws, len(left) == 0


def _in_closed_form(robot: Robot, poses: Array) -> tuple[Array, Array, Array, Array]:
    """Values (n, d), poses that they lead to, joints there, and how far off these are (n,).

    The distance is in robot's lengths or rad, and infinite where there is no closed form.
    """
    from seecr.compiled.joint_kinematics import (
        N_CURRENT,  # takes a while to import
        N_SCRATCH,
        reach_batch,
    )

    home = _home_screws(robot)
    n, d = len(poses), len(home)
    values, reached, current = np.empty((n, d)), np.empty((n, 7)), np.empty((n, d, N_CURRENT))
    off = np.empty(n)
    reach_batch(
        home, robot.reference_pose.copy(), np.array(poses, order="C"), max(robot.length, 1.0),
        _ROUNDING, values, reached, current, off, np.empty((3, N_SCRATCH)),
    )  # fmt: skip
    return values, reached, current[..., :7].copy(), off


@lru_cache(maxsize=16)
def _home_screws(robot: Robot) -> Array:
    """The joints (d, 7) at the reference pose, as :func:`pose_of_values` returns them."""
    return np.array(
        [[float(joint.kind == "hinge"), *joint.axis, *joint.point] for joint in robot.joints]
    ).reshape(-1, 7)


def _searched(robot: Robot, poses: Array, values: Array, off: Array) -> Array:
    """Joint values (n, d) nearest to poses, by Newton's steps from values that are ``off`` (n,).

    If there is no closed form, they begin at the reference pose, and where that does not lead to
    the pose, at other angles: from some starts they end elsewhere.
    """
    unknown = np.isinf(off)
    best = _by_newton(robot, poses, np.where(unknown[:, None], 0.0, values))
    least = _far(robot, poses, best)
    turns = np.random.default_rng(0).uniform(-np.pi, np.pi, (_TRIES, len(robot.joints)))
    for start in turns * robot.hinges:
        rows = np.flatnonzero(unknown & (least > OFF_MANIFOLD) & np.isfinite(poses).all(axis=1))
        if len(rows) == 0:
            break
        found = _by_newton(robot, poses[rows], np.tile(start, (len(rows), 1)))
        far = _far(robot, poses[rows], found)
        better = far < least[rows]
        best[rows[better]], least[rows[better]] = found[better], far[better]
    return best


def _far(robot: Robot, poses: Array, values: Array) -> Array:
    """How far (n,) [robot's length, rad] joint values are from bringing the platform to poses."""
    return np.asarray(_missed(robot, poses, pose_of_values(robot, values)[0]).max(axis=1))


def _missed(robot: Robot, poses: Array, reached: Array) -> Array:
    """How far (n, 6) [robot's length, rad] parts of poses are off; infinite without a number."""
    miss = np.abs(pose_difference(poses, reached)) / np.repeat([robot.length, 1.0], 3)
    return np.where(np.isnan(miss), np.inf, miss)


def _by_newton(robot: Robot, poses: Array, values: Array) -> Array:
    """Joint values (n, d) after Newton's steps towards poses (n, 7), as long as these help."""
    before = np.inf
    exact = _EXACT * np.repeat([max(robot.length, 1.0), 1.0], 3)
    for _ in range(50):
        reached, screws = pose_of_values(robot, values)
        miss = pose_difference(poses, reached)
        if np.all(np.abs(miss) <= exact):
            break
        columns = motion_columns(screws, reached[:, :3])
        # some may be so far away that rounding is longer than the robot: they stay there
        lost = ~(np.isfinite(columns).all(axis=(1, 2)) & np.isfinite(miss).all(axis=1))
        columns[lost], miss[lost] = 0.0, 0.0
        step = np.einsum("nkd,nd->nk", np.linalg.pinv(columns), miss)
        turn = np.max(np.abs(step), axis=1, where=robot.hinges, initial=0.0)
        step /= np.maximum(turn / _LONGEST_TURN, 1.0)[:, None]
        values = values + step
        size = float(np.max(np.abs(step) / (1.0 + np.abs(values)), initial=0.0))
        # this close to convergence, steps that do not shrink are rounding
        if size < 1e-14 or 0.5 * before <= size < 1e-12:
            break
        before = size
    return values


def reachable(robot: Robot, poses: Array) -> Array:
    """The poses (n, 7) that the robot's joints can reach nearest to ``poses``."""
    return _nearest(robot, poses)[1] if robot.joints else poses


def _off_joints(robot: Robot, poses: Array, reached: Array) -> tuple[int, str] | None:
    """The row farthest from what the joints can reach, and its distance; None if none is."""
    miss = _missed(robot, poses, reached)
    if not np.any(miss > OFF_MANIFOLD):
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
