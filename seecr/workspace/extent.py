"""How far a grid extends: over the exit points, as far below home as above, within the joints."""

from __future__ import annotations

from itertools import product

import numpy as np

from seecr.description.joints import locked, off_joints
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array

__all__ = ["grid_ends", "refuse_oblique", "refuse_unreached"]


def grid_ends(robot: Robot, turned: Array) -> tuple[Array, Array]:
    """Lowest and highest x, y, z (3,) [m] of a grid over the exit points.

    It has room for exit points mirrored in the level plane through the reference position, that is,
    against gravity. It ends on the robot's floor, and does not leave the plane or line in which
    joints keep the platform, if that is along axes.

    Args:
        robot: as described.
        turned: (4,) quaternion of the grid's poses.
    """
    home = robot.reference_pose[:3]
    above = robot.exit_points[(robot.exit_points - home) @ robot.up > 0.0]
    # no rounding where gravity is along an axis
    twice = 2.0 * np.outer(robot.up, robot.up)
    mirrored = above @ (np.eye(3) - twice) + twice @ home
    points = np.concatenate([robot.exit_points, home[None], mirrored])
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = np.clip(robot.standing_height(turned), low[2], home[2])
    kept = locked(robot)[:3]
    return np.where(kept, home, low), np.where(kept, home, high)


def refuse_oblique(robot: Robot, axes: tuple[Array, ...]) -> None:
    """Refuse a default grid that joints cannot reach.

    Raises:
        InputError: the joints keep the platform in a plane that is not along two axes.
    """
    off = off_joints(robot, _corners(axes, robot.reference_pose[3:]))
    if off is not None:
        raise InputError(
            f"robot {robot.name}: its joints do not reach a grid along x, y and z, it is off by "
            f"{off[1]}; expected joints that keep the platform in a plane of two of these axes "
            "(turn the robot in its MJCF), or poses of your own in place of a map (a sweep)"
        )


def refuse_unreached(robot: Robot, axes: tuple[Array, ...], turned: Array) -> None:
    """Refuse a grid with a corner that joints cannot reach.

    Raises:
        InputError: says which corner, and how far off it is.
    """
    poses = _corners(axes, turned)
    off = off_joints(robot, poses)
    if off is not None:
        place = " ".join(f"{value + 0.0:.6g}" for value in poses[off[0], :3])
        kept = [k for k in range(3) if locked(robot)[k]]
        only = ", ".join(f"{'xyz'[k]} {robot.reference_pose[k]:.6g} m" for k in kept)
        raise InputError(
            f"robot {robot.name}: its joints cannot reach x y z {place} m of the grid, it is off "
            f"by {off[1]}; expected a grid and an orientation that they can reach"
            + (f", here with {only}" if only else "")
        )


def _corners(axes: tuple[Array, ...], turned: Array) -> Array:
    """(8, 7) the poses at the corners of a grid."""
    places = np.array(list(product(*((axis[0], axis[-1]) for axis in axes))))
    return np.column_stack([places, np.tile(turned, (len(places), 1))])
