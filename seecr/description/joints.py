"""Platforms on slide and hinge joints: from joint values to poses, and back.

A pose may state a part of its coordinates, or be rounded: then the nearest pose of the joints is
meant. And the motions that are left to a platform: by its joints, and beside its cables.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import (
    Array,
    cross,
    pose_difference,
    quat_from_rxyz,
    quat_rotate,
    rxyz_from_quat,
    transform_points,
)

OFF_MANIFOLD = 1e-6
"""Allowed distance of a commanded pose from what joints reach [robot's length, or rad]."""
# Poses nearer than this [m or robot's length, rad] are the same but for rounding.
_EXACT = 1e-15
# Changes of a pose below this are rounding [m or robot's length, rad].
_ROUNDING = 1e-12
# So many joint values show what almost all do, and so many starts find what few miss.
_TRIES = 8
# Motions of joints are independent if one is not this near to a combination of the others.
_INDEPENDENT = 1e-9
# The same of rates of parts of a pose, almost anywhere.
_DETERMINED = 1e-6
# Distances that differ by less are the same, and poses farther apart are others
# [robot's length, rad].
_AS_NEAR, _APART = 1e-8, 1e-4
# Most that a hinge turns in one of Newton's steps [rad]: longer ones lead anywhere.
_LONGEST_TURN = 1.0
_WHOLE = np.ones(6, dtype=bool)


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


def _somewhere(robot: Robot) -> Array:
    """Joint values (k, d) [m, rad] of a few poses: what is so almost anywhere is so there."""
    size = np.where(robot.hinges, 1.0, robot.length)
    return np.random.default_rng(0).uniform(-1.0, 1.0, (_TRIES, robot.n_dof)) * size


def locked(robot: Robot) -> NDArray[np.bool_]:
    """(6,) which parts of the pose no joint changes: x y z, and rotations about x y z."""
    if not robot.joints:
        return np.zeros(6, dtype=bool)
    pose, _screws = pose_of_values(robot, _somewhere(robot))
    off = np.abs(pose_difference(pose, np.tile(robot.reference_pose, (_TRIES, 1))))
    size = np.repeat([max(robot.length, 1.0), 1.0], 3)
    return np.asarray(np.all(off <= _ROUNDING * size, axis=0))


def changeable(robot: Robot) -> NDArray[np.bool_]:
    """(6,) which of x y z rx ry rz of the platform can change at all."""
    if not robot.joints:
        return _WHOLE.copy()
    poses, _screws = pose_of_values(robot, 0.5 * _somewhere(robot))
    moved = np.concatenate([poses[:, :3], rxyz_from_quat(poses[:, 3:])], axis=1)
    return np.asarray(np.ptp(moved, axis=0) > 1e-9)


@lru_cache(maxsize=16)
def freedoms(robot: Robot) -> tuple[int, int, int]:
    """Independent motions of the platform: all, rotations that keep its origin, all rotations.

    They are 6, 3 and 3 for a free platform. A hinge beside the origin needs slides to keep it.
    """
    if not robot.joints:
        return 6, 3, 3
    # almost anywhere, joints move the platform in as many ways as they ever do
    poses, screws = pose_of_values(robot, _somewhere(robot))
    columns = motion_columns(screws, poses[:, :3])
    columns = columns / np.where(robot.hinges, robot.length, 1.0)
    columns[:, 3:] *= robot.length
    whole, moving, turning = (
        int(np.linalg.matrix_rank(part, rtol=_INDEPENDENT).max())
        for part in (columns, columns[:, :3], columns[:, 3:])
    )
    return whole, whole - moving, turning


def determined(robot: Robot, given: NDArray[np.bool_]) -> bool:
    """Whether some parts of the pose (6,), x y z rx ry rz, determine where all joints are.

    That is so almost anywhere or almost nowhere, so a few places show it.
    """
    poses, screws = pose_of_values(robot, 0.5 * _somewhere(robot))
    rates = _rates(robot, poses, screws, given) * np.where(robot.hinges, 1.0, robot.length)
    sizes, count = np.linalg.svd(rates, compute_uv=False), robot.n_dof
    if sizes.shape[1] < count:
        return False
    return bool(np.median(sizes[:, count - 1] > _DETERMINED * sizes[:, 0]) > 0.5)


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
    found = _nearest(robot, poses)
    if (off := found.farthest(robot)) is not None:
        which = f"commanded pose {off[0]}" if len(poses) > 1 else "the commanded pose"
        raise InputError(
            f"robot {robot.name}: its joints cannot reach {which}, it is off by "
            f"{off[1]}; expected a pose that they can reach"
        )
    return found.values, found.screws


def reachable(robot: Robot, poses: Array) -> Array:
    """The poses (n, 7) that the robot's joints can reach nearest to ``poses``."""
    return _nearest(robot, poses).poses if robot.joints else poses


def off_joints(robot: Robot, poses: Array) -> tuple[int, str] | None:
    """The row of poses (n, 7) that is farthest from what the joints can reach, and its distance.

    None if all can be reached; a platform with a free joint reaches all.
    """
    return _nearest(robot, poses).farthest(robot) if robot.joints else None


def projected(
    robot: Robot, poses: Array, given: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Poses (n, 7) of the joints that are nearest to others (n, 7) in some parts of these (6,).

    Returns:
        the poses, how far their parts (n, 6) are from what was given [m, rad], 0 in the others, and
        whether another pose (n,) has the same parts, as where an arm may point up or down.
    """
    found = _nearest(robot, poses, given)
    return found.poses, found.off, found.other


@dataclass(frozen=True, eq=False)
class _Nearest:
    """The nearest that joints bring the platform to n poses.

    Attributes:
        values: (n, d) of the joints. poses: (n, 7) there. screws: (n, d, 7) the joints there.
        off: (n, 6) [m, rad] what is missing, 0 where it is rounding.
        other: (n,) whether other joint values are as near.
    """

    values: Array
    poses: Array
    screws: Array
    off: Array
    other: NDArray[np.bool_]

    def farthest(self, robot: Robot) -> tuple[int, str] | None:
        """The row that is farthest off, and its distance; None if all poses are reached."""
        if not self.off.any():  # as in most calls
            return None
        miss = np.abs(self.off) / np.repeat([robot.length, 1.0], 3)
        miss[np.isnan(miss)] = np.inf
        if not np.any(miss > OFF_MANIFOLD):
            return None
        row, part = np.unravel_index(np.argmax(miss), miss.shape)
        size = miss[row, part] * (robot.length if part < 3 else 1.0)
        return int(row), f"{size:.3g} {'m' if part < 3 else 'rad'} in {'xyz'[part % 3]}"


def _nearest(robot: Robot, poses: Array, given: NDArray[np.bool_] = _WHOLE) -> _Nearest:
    """The nearest that joints bring the platform to poses (n, 7), in the given parts (6,).

    Where there is no closed form, Newton's steps begin at the reference pose, and where these do
    not lead to the pose, at other angles: from some starts they end elsewhere.
    """
    values, reached, screws, far = _in_closed_form(robot, poses)
    off, other = np.zeros((len(poses), 6)), np.zeros(len(poses), dtype=bool)
    if not given.all():
        far[:] = np.inf
    left = np.flatnonzero(far > _ROUNDING)
    if len(left) == 0:
        return _Nearest(values, reached, screws, off, other)
    unknown, size = np.isinf(far), np.repeat([robot.length, 1.0], 3)
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (_TRIES, robot.n_dof)) * robot.hinges
    off[left], least = np.inf, np.full(len(poses), np.inf)
    for start in (None, *starts):
        rows = left
        if start is not None:  # of a whole pose that is reached there is nothing more to find
            again = unknown & np.isfinite(poses).all(axis=1)
            again &= (least > OFF_MANIFOLD) if given.all() else robot.turns
            rows = np.flatnonzero(again)
        if len(rows) == 0:
            break
        begin = np.where(unknown[rows, None], 0.0 if start is None else start, values[rows])
        found = _by_newton(robot, poses[rows], begin, given)
        there, joints = pose_of_values(robot, found)
        miss = _missed(poses[rows], there, given)
        away = np.linalg.norm(miss / size, axis=1)
        apart = np.linalg.norm(pose_difference(there, reached[rows]) / size, axis=1) > _APART
        nearer = away < least[rows] - _AS_NEAR
        if start is None:
            nearer[:] = True
        other[rows] &= ~nearer
        other[rows] |= ~nearer & apart & (np.abs(away - least[rows]) <= _AS_NEAR)
        at = rows[nearer]
        values[at], reached[at], screws[at] = found[nearer], there[nearer], joints[nearer]
        off[at], least[at] = miss[nearer], np.where(np.isnan(away[nearer]), np.inf, away[nearer])
    return _Nearest(values, reached, screws, off, other)


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


def _missed(poses: Array, reached: Array, given: NDArray[np.bool_]) -> Array:
    """Parts (n, 6) [m, rad] by which poses (n, 7) are off others; 0 where they are not given."""
    off = pose_difference(poses, reached)
    if not given[3:].all():  # single angles are those of R = Rx Ry Rz
        turn = rxyz_from_quat(poses[:, 3:]) - rxyz_from_quat(reached[:, 3:])
        off[:, 3:] = (turn + np.pi) % (2.0 * np.pi) - np.pi
    return np.where(given, off, 0.0)


def _rates(robot: Robot, poses: Array, screws: Array, given: NDArray[np.bool_]) -> Array:
    """Derivatives (n, 6, d) [robot's length, rad] of the given parts of poses by joint values."""
    rates = motion_columns(screws, poses[:, :3])
    if not given[3:].all():  # the platform turns by these axes times the rates of its angles
        angles = rxyz_from_quat(poses[:, 3:])
        about = np.zeros((len(poses), 3, 3))
        for k in range(3):
            before = np.where(np.arange(3) < k, angles, 0.0)
            about[:, :, k] = quat_rotate(
                quat_from_rxyz(before), np.tile(np.eye(3)[k], (len(poses), 1))
            )
        rates[:, 3:] = np.linalg.pinv(about) @ rates[:, 3:]
    rates[:, :3] /= robot.length
    return np.where(given[:, None], rates, 0.0)


def _by_newton(robot: Robot, poses: Array, values: Array, given: NDArray[np.bool_]) -> Array:
    """Joint values (n, d) after Newton's steps towards poses (n, 7), as long as these help."""
    before, size = np.inf, np.repeat([robot.length, 1.0], 3)
    exact = _EXACT * np.repeat([max(robot.length, 1.0), 1.0], 3)
    for _ in range(50):
        reached, screws = pose_of_values(robot, values)
        miss = _missed(poses, reached, given)
        if np.all(np.abs(miss) <= exact):
            break
        rates = _rates(robot, reached, screws, given)
        # some may be so far away that rounding is longer than the robot: they stay there
        lost = ~(np.isfinite(rates).all(axis=(1, 2)) & np.isfinite(miss).all(axis=1))
        rates[lost], miss[lost] = 0.0, 0.0
        step = np.einsum("nkd,nd->nk", np.linalg.pinv(rates), miss / size)
        turn = np.max(np.abs(step), axis=1, where=robot.hinges, initial=0.0)
        step /= np.maximum(turn / _LONGEST_TURN, 1.0)[:, None]
        values = values + step
        change = float(np.max(np.abs(step) / (1.0 + np.abs(values)), initial=0.0))
        # this close to convergence, steps that do not shrink are rounding
        if change < 1e-14 or 0.5 * before <= change < 1e-12:
            break
        before = change
    return values


def motion_columns(screws: Array, position: Array) -> Array:
    """Derivatives (n, 6, d) of poses at positions (n, 3) by joint values; screws are (n, d, 7)."""
    axis, point, hinge = screws[..., 1:4], screws[..., 4:7], screws[..., :1]
    linear = np.where(hinge == 1.0, cross(axis, position[:, None] - point), axis)
    return np.swapaxes(np.concatenate([linear, axis * hinge], axis=-1), 1, 2)


# Motions that no cable resists, by geometry alone.

# Part of the largest singular value below which a pull adds no direction to the others.
_NONE = 1e-9


def unresisted(robot: Robot, pose: Array, cables: NDArray[np.bool_]) -> Array:
    """Motions (k, 6) [m, rad] at a pose (7,) that change the length of none of the cables (m,).

    Rotations are about the platform's origin, base frame. Motions are orthogonal, with rotations
    over the robot's length.
    """
    ends = transform_points(pose, robot.anchor_points)[cables]
    along = ends - robot.exit_points[cables]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    scale = np.repeat([1.0, robot.length], 3)
    rows = np.concatenate([along, cross(ends - pose[:3], along)], axis=1) / scale
    free = np.eye(6)
    if robot.joints:
        free = scale[:, None] * motion_columns(values_of_pose(robot, pose)[1], pose[None, :3])[0]
    _left, sizes, right = np.linalg.svd(rows @ free)
    rank = int(np.sum(sizes > _NONE * max(float(sizes.max(initial=0.0)), _NONE)))
    return np.asarray(right[rank:] @ free.T / scale)
