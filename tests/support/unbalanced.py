"""What the best tensions leave of the load, pose by pose: another way to see what can be held."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.tensions.distribution import balanced, tension_limits
from seecr.workspace.margins import balance_equations


def unbalanced(
    robot: Robot,
    poses: ArrayLike,
    wrench: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
) -> Array:
    """Forces, and torques over the robot's length, relative to the load, (n,); 0 where held."""
    low, high = tension_limits(robot, lowest, highest)
    each = zip(*balance_equations(robot, np.atleast_2d(poses), wrench), strict=True)
    return np.array([balanced(matrix, load, low, high)[1] for matrix, load in each])
