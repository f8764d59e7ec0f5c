"""Commands on joints that state a pose in part, or rounded: the nearest pose of the joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import pose_of_values
from seecr.description.robot import Robot
from seecr.pose import Array, pose_difference, rxyz_from_quat

# Changes of joint values [robot's length, rad] by which derivatives are found: the root of the
# rounding of doubles, where errors of both kinds are about the same.
_STEP = 1e-8
# Most of Gauss and Newton's steps, and changes that are rounding.
_STEPS, _SAME = 50, 1e-14
# Joint values are determined if no singular value is this part of the largest one.
_INDEPENDENT = 1e-6
# Poses farther apart [robot's length, rad] than Newton leaves where two of them meet.
_APART = 1e-4
# Starts besides the reference pose, of robots whose hinges turn far.
_TRIES = 8


def determined(robot: Robot, given: NDArray[np.bool_]) -> bool:
    """Whether some parts of the pose (6,), x y z rx ry rz, determine where all joints are.

    That is so almost anywhere or almost nowhere, so a few places show it.
    """
    values = np.random.default_rng(0).uniform(-0.5, 0.5, (_TRIES, len(robot.joints)))
    values = values * _scale(robot)
    slopes = _slopes(robot, values, pose_of_values(robot, values)[0], given)
    sizes = np.linalg.svd(slopes, compute_uv=False)
    count = len(robot.joints)
    if sizes.shape[1] < count:
        return False
    independent = sizes[:, count - 1] > _INDEPENDENT * sizes[:, 0]
    return bool(np.median(independent) > 0.5)


def projected(
    robot: Robot, poses: Array, given: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Poses (n, 7) of the joints that are nearest to others (n, 7) in some parts of these (6,).

    Returns:
        the poses, how far their parts (n, 6) are from what was given [m, rad], 0 in the others, and
        whether another pose (n,) has the same parts, as where an arm may point up or down.
    """
    best = np.tile(robot.reference_pose, (len(poses), 1))
    off, other = np.full((len(poses), 6), np.inf), np.zeros(len(poses), dtype=bool)
    turns = np.random.default_rng(0).uniform(-np.pi, np.pi, (_TRIES, len(robot.joints)))
    for start in np.concatenate([np.zeros((1, len(robot.joints))), turns * robot.hinges]):
        found = _by_gauss(robot, poses, np.tile(start, (len(poses), 1)), given)
        miss = _missed(poses, found, given)
        size, least = _norm(robot, miss), _norm(robot, off)
        nearer = size < least - _STEP
        apart = _norm(robot, pose_difference(found, best)) > _APART
        other = (other & ~nearer) | (apart & (np.abs(size - least) <= _STEP))
        best[nearer], off[nearer] = found[nearer], miss[nearer]
        if not np.any(robot.hinges) or (given.all() and np.all(_norm(robot, off) <= _STEP)):
            break
    return best, off, other


def _norm(robot: Robot, off: Array) -> Array:
    """Lengths (n,) of parts (n, 6) [m, rad], in robot's lengths and rad."""
    return np.asarray(np.linalg.norm(off / np.repeat([robot.length, 1.0], 3), axis=1))


def _scale(robot: Robot) -> Array:
    """(d,) what each joint's value is counted in [m, rad]."""
    return np.where(robot.hinges, 1.0, robot.length)


def _missed(poses: Array, reached: Array, given: NDArray[np.bool_]) -> Array:
    """Parts (n, 6) [m, rad] by which poses (n, 7) are off others; 0 where they are not given."""
    off = pose_difference(poses, reached)
    if not given[3:].all():  # single angles are those of R = Rx Ry Rz
        turn = rxyz_from_quat(poses[:, 3:]) - rxyz_from_quat(reached[:, 3:])
        off[:, 3:] = (turn + np.pi) % (2.0 * np.pi) - np.pi
    return np.where(given, off, 0.0)


def _slopes(robot: Robot, values: Array, at: Array, given: NDArray[np.bool_]) -> Array:
    """Derivatives (n, 6, d) of the given parts by joint values (n, d), both scaled."""
    scale, out = _scale(robot), np.empty((len(values), 6, len(robot.joints)))
    for k in range(len(robot.joints)):
        step = np.zeros(len(robot.joints))
        step[k] = _STEP * scale[k]
        out[:, :, k] = _missed(pose_of_values(robot, values + step)[0], at, given) / _STEP
    out[:, :3] /= robot.length
    return out


def _by_gauss(robot: Robot, poses: Array, values: Array, given: NDArray[np.bool_]) -> Array:
    """The poses (n, 7) that Gauss and Newton's steps from joint values (n, d) lead to."""
    scale, size = _scale(robot), np.repeat([robot.length, 1.0], 3)
    for _ in range(_STEPS):
        at = pose_of_values(robot, values)[0]
        slopes = _slopes(robot, values, at, given)
        step = np.einsum("ndk,nk->nd", np.linalg.pinv(slopes), _missed(poses, at, given) / size)
        step /= np.maximum(np.max(np.abs(step), axis=1, initial=0.0), 1.0)[:, None]
        values = values + step * scale
        if np.max(np.abs(step), initial=0.0) <= _SAME:
            break
    return pose_of_values(robot, values)[0]
