"""Which motions of the platform no cable resists, by its geometry alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import motion_columns, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array, cross, transform_points

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
