"""How far a grid extends: over the exit points, as far below home as above, within the joints.

Its axes are x, y and z. Where joints keep the platform in a plane or on a line that is oblique to
these, they are directions of the platform's own, u, v and w, from the base frame's origin, too.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import locked, off_joints, shifts
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, cross

__all__ = [
    "directions_words",
    "grid_ends",
    "own_directions",
    "refuse_other_joints",
    "refuse_unreached",
]

# Components of a unit vector below this are rounding.
_ROUNDING = 1e-12


def own_directions(robot: Robot) -> Array | None:
    """(3, 3) unit vectors u, v and w in rows, along which an oblique robot's grid extends.

    In a plane u is level, w is the steepest direction and v is normal to both, as x, z and y are in
    the plane of x and z. A line is along w if it climbs, else along u. Signs are such that u goes
    along +x, w along +z, and u, v, w are right-handed. None where x, y and z serve.
    """
    along, up = shifts(robot), np.array([0.0, 0.0, 1.0])
    if len(along) in (0, 3) or int(locked(robot)[:3].sum()) >= 3 - len(along):
        return None
    if len(along) == 2:
        normal = cross(along[0], along[1])
        level = cross(normal, up)
        steep = cross(level, normal)
    elif abs(along[0, 2]) > _ROUNDING:
        level, steep = cross(along[0], up), along[0]
    else:
        level, steep = along[0], up
    if np.linalg.norm(level) <= _ROUNDING:
        return None
    u, w = _unit(level), _unit(steep)
    u, w = u if u[np.argmax(u != 0.0)] > 0.0 else -u, w if w[2] > 0.0 else -w
    return np.asarray(np.stack([u, cross(w, u), w]) + 0.0)


def _unit(vector: Array) -> Array:
    """The unit vector, without rounding where it is zero."""
    unit = vector / np.linalg.norm(vector)
    unit = np.where(np.abs(unit) < _ROUNDING, 0.0, unit)
    return np.asarray(unit / np.linalg.norm(unit))


def _kept(robot: Robot, directions: Array | None) -> NDArray[np.bool_]:
    """(3,) along which axes of the grid joints keep the platform in place."""
    if directions is None:
        return locked(robot)[:3]
    return np.asarray(np.abs(shifts(robot) @ directions.T).max(axis=0) <= _ROUNDING)


def _home(robot: Robot, directions: Array | None) -> Array:
    """The reference position along the axes of the grid, (3,) [m]."""
    if directions is None:
        return robot.reference_pose[:3]
    home = directions @ robot.reference_pose[:3]
    return np.where(np.abs(home) <= _ROUNDING * robot.reach, 0.0, home)


def grid_ends(robot: Robot, turned: Array) -> tuple[Array, Array]:
    """Lowest and highest x, y, z (3,) [m] of a grid over the exit points, or of its own u, v, w.

    It has room for exit points mirrored in the level plane through the reference position, that is,
    against gravity. It ends on the robot's floor, and does not leave the plane or line in which
    joints keep the platform.

    Args:
        robot: as described.
        turned: (4,) quaternion of the grid's poses.
    """
    home, directions = robot.reference_pose[:3], own_directions(robot)
    above = robot.exit_points[(robot.exit_points - home) @ robot.up > 0.0]
    # no rounding where gravity is along an axis
    twice = 2.0 * np.outer(robot.up, robot.up)
    mirrored = above @ (np.eye(3) - twice) + twice @ home
    points = np.concatenate([robot.exit_points, home[None], mirrored])
    floor = robot.standing_height(turned)
    if directions is not None:
        points, home = points @ directions.T, _home(robot, directions)
        # u is level, and v stays
        floor = (floor - home[1] * directions[1, 2]) / directions[2, 2]
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = np.clip(floor, low[2], home[2])
    kept = _kept(robot, directions)
    return np.where(kept, home, low), np.where(kept, home, high)


def refuse_other_joints(robot: Robot, axes: tuple[Array, ...]) -> None:
    """Refuse a default grid that joints cannot reach.

    Raises:
        InputError: the joints do not let the platform move without turning.
    """
    off = off_joints(robot, _corners(axes, robot.reference_pose[3:], own_directions(robot)))
    if off is not None:
        raise InputError(
            f"robot {robot.name}: its joints do not reach a grid of one orientation, it is off by "
            f"{off[1]}; expected joints that move the platform along a line, in a plane or in "
            "space without turning it, or poses of your own in place of a map (a sweep)"
        )


def refuse_unreached(
    robot: Robot, axes: tuple[Array, ...], turned: Array, directions: Array | None
) -> None:
    """Refuse a grid with a corner that joints cannot reach.

    Args:
        robot: as described.
        axes: of the grid [m]. turned: (4,) quaternion of its poses. directions: (3, 3) of its axes,
            see :func:`own_directions`.

    Raises:
        InputError: says which corner, and how far off it is.
    """
    poses = _corners(axes, turned, directions)
    off = off_joints(robot, poses)
    if off is not None:
        names, place = "xyz", poses[off[0], :3]
        if directions is not None:
            names, place = "uvw", directions @ place
        home, at = _home(robot, directions), " ".join(f"{value + 0.0:.6g}" for value in place)
        kept = np.flatnonzero(_kept(robot, directions))
        only = ", ".join(f"{names[k]} {home[k]:.6g} m" for k in kept)
        raise InputError(
            f"robot {robot.name}: its joints cannot reach {' '.join(names)} {at} m of the grid, "
            f"it is off by {off[1]}; expected a grid and an orientation that they can reach"
            + (f", here with {only}" if only else "")
            + ("" if directions is None else f" ({directions_words(directions)})")
        )


def directions_words(directions: Array) -> str:
    """Which way the axes of an oblique robot's grid go, in words."""
    each = (
        f"{name} along ({', '.join(f'{part + 0.0:.4g}' for part in row)})"
        for name, row in zip("uvw", directions, strict=True)
    )
    return f"{', '.join(each)} of x y z"


def _corners(axes: tuple[Array, ...], turned: Array, directions: Array | None) -> Array:
    """(8, 7) the poses at the corners of a grid."""
    places = np.array(list(product(*((axis[0], axis[-1]) for axis in axes))))
    places = places if directions is None else places @ directions
    return np.column_stack([places, np.tile(turned, (len(places), 1))])
