"""Axes in which the last one is against gravity, whichever way that is in the base frame."""

from __future__ import annotations

import numpy as np

from seecr.description.robot import Robot
from seecr.pose import Array

# About x, by half a turn.
_OVER = np.diag([1.0, -1.0, -1.0])


def upright(robot: Robot) -> Array:
    """(3, 3) axes as columns, base frame: right-handed, the last one against gravity.

    They are the axes of the base frame if gravity is along -z, or if there is none. Where it is
    along another of these they are without rounding, so that poses on a box's edge stay there.
    """
    return _turned(robot.up) if robot.up[2] >= 0.0 else _turned(-robot.up) @ _OVER


def _turned(up: Array) -> Array:
    """The rotation of z onto a direction not below the horizon (Rodrigues' formula)."""
    x, y = up[:2]
    about = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + about + about @ about / (1.0 + up[2]))


def box_around(low: Array, high: Array, axes: Array) -> tuple[Array, Array]:
    """The box along other axes (3, 3), as columns, around one along x, y, z: lowest and highest."""
    ends = low[:, None] * axes, high[:, None] * axes
    return np.minimum(*ends).sum(axis=0), np.maximum(*ends).sum(axis=0)
