"""Where a robot can hold its platform, and where its cables go slack.

The static-feasible workspace (SFW) are the poses at which tensions that only pull balance the
load (paper, eq 3, Figs 10 and 11). Elastic cables do not change it: it asks what tensions could
do at a pose, not whether the platform comes to rest there when the winches are told to.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.distribution import balanced, tension_limits
from seecr.errors import InputError
from seecr.joints import motion_columns, values_of_pose
from seecr.pose import Array, quat_rotate, transform_points
from seecr.robot import Robot
from seecr.solution import Solution

# Part of the load that may stay unbalanced: rounding of the tensions found.
_BALANCED = 1e-9


@dataclass(frozen=True)
class Zone:
    """Consecutive poses of a trajectory with the same number of slack cables.

    Attributes:
        first: index of its first pose.
        last: index of its last pose.
        slack: number of slack cables; None where there is no answer to count in.
    """

    first: int
    last: int
    slack: int | None


def feasible(
    robot: Robot,
    poses: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
) -> NDArray[np.bool_]:
    """Whether tensions within bounds can balance the load: W tau + w_e = 0 (paper, eq 3).

    Args:
        robot: whose mass, centre of mass and gravity are the load.
        poses: (n, 7) or (7,), where the platform really is.
        wrench: (6,) or (n, 6) external force [N] at the platform origin and moment [N m].
        lowest: (m,) or one [N], not negative.
        highest: (m,) or one [N]; infinite for none.

    Returns:
        (n,) bool.
    """
    return unbalanced(robot, poses, wrench=wrench, lowest=lowest, highest=highest) < _BALANCED


def unbalanced(
    robot: Robot,
    poses: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
) -> Array:
    """What the best tensions leave unbalanced, relative to the load, (n,); 0 when feasible.

    Forces, and torques over the robot's length, weigh alike. Arguments as in :func:`feasible`.
    """
    places = _poses(poses)
    low, high = tension_limits(robot, lowest, highest)
    matrices, loads = balance_equations(robot, places, wrench)
    return np.array(
        [balanced(w, load, low, high)[1] for w, load in zip(matrices, loads, strict=True)]
    )


def slack_zones(solution: Solution) -> list[Zone]:
    """The zones of a trajectory by number of slack cables, in order (paper, Figs 7 and 11)."""
    counts = [
        int(row.sum()) if ok else None
        for row, ok in zip(solution.slack, solution.converged, strict=True)
    ]
    edges = [0, *(i for i in range(1, len(counts)) if counts[i] != counts[i - 1]), len(counts)]
    return [
        Zone(first, after - 1, counts[first]) for first, after in pairwise(edges) if after > first
    ]


def wrench_matrix(robot: Robot, poses: ArrayLike) -> Array:
    """W of eq 4 at poses (n, 7): unit vectors over moments at the platform origin, (n, 6, m)."""
    places = _poses(poses)
    anchors = transform_points(places, robot.anchor_points)
    cables = robot.exit_points - anchors
    unit = cables / np.linalg.norm(cables, axis=-1, keepdims=True)
    moment = np.cross(anchors - places[:, None, :3], unit)
    return np.swapaxes(np.concatenate([unit, moment], axis=-1), 1, 2)


def balance_equations(
    robot: Robot, poses: Array, wrench: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Equations of balance W tau = load, (n, d, m) and (n, d), torques over the length."""
    n = len(poses)
    outer = np.zeros(6) if wrench is None else np.asarray(wrench, float)
    if outer.shape not in ((6,), (n, 6)) or not np.all(np.isfinite(outer)):
        raise InputError(f"wrench must be (6,) or ({n}, 6) finite numbers, got {outer.shape}")
    weight = robot.mass * robot.gravity
    arm = quat_rotate(poses[:, 3:], robot.centre_of_mass)
    load = outer + np.concatenate([np.tile(weight, (n, 1)), np.cross(arm, weight)], axis=1)
    matrix = wrench_matrix(robot, poses)
    if not robot.joints:
        unit = np.where(robot.hinges, 1.0 / robot.length, 1.0)
        return matrix * unit[:, None], -load * unit
    # the joints take up what they do not move along: only work on their motions must vanish
    columns = motion_columns(values_of_pose(robot, poses)[1], poses[:, :3])
    columns = columns * np.where(robot.hinges, 1.0 / robot.length, 1.0)
    along = np.swapaxes(columns, 1, 2)
    return along @ matrix, -np.einsum("ndk,nk->nd", along, load)


def _poses(values: ArrayLike) -> Array:
    poses = np.atleast_2d(np.asarray(values, float))
    if poses.ndim != 2 or poses.shape[1] != 7 or not np.all(np.isfinite(poses)):
        raise InputError(f"poses must be (n, 7) finite numbers, got {np.shape(values)}")
    return poses
