"""The edge of a workspace, along straight lines that lead out of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.description.mjcf import GivenRobot, robot_of
from seecr.errors import InputError
from seecr.pose import Array
from seecr.prediction.model import GivenEffects
from seecr.statics.starts import commanded_poses
from seecr.workspace.chances import asked_chance
from seecr.workspace.margins import is_held, margins_at, read_once

__all__ = ["boundary"]


def boundary(
    robot: GivenRobot,
    inside: ArrayLike,
    outside: ArrayLike,
    *,
    tolerance: float = 1e-4,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
    effects: GivenEffects = (),
    at_least: float | None = None,
) -> Array:
    """Points on the workspace's edge, between poses that can be held and poses that cannot.

    They are found by bisection along the straight line between the two positions.

    Args:
        robot: as described, or its MJCF.
        inside, outside: (n, 7) poses, with the same orientation in each row.
        tolerance: [m] within which the edge is found.
        lowest, highest, wrenches: as in :func:`seecr.tension_margin`.
        effects: effects of the robot: a model, its file, or effects with values.
        at_least: count poses as held if their probability is at least this, given the uncertainty
            of a model with a covariance; by default, those that the model's own values hold.

    Returns:
        (n, 7) the last poses found that can be held.

    Raises:
        InputError: a pose is on the wrong side, the tolerance is not positive, or a probability is
            asked for without a covariance.
    """
    robot = robot_of(robot)
    if not 0.0 < tolerance < np.inf:
        raise InputError(f"an edge's tolerance [m] must be above 0 and finite, got {tolerance:g}")
    effects = read_once(effects, robot)
    near, far = commanded_poses(inside, "inside"), commanded_poses(outside, "outside")

    def held(poses: Array) -> NDArray[np.bool_]:
        if at_least is not None:
            chance = asked_chance(robot, poses, effects, lowest, highest, wrenches)
            return np.asarray(chance >= at_least)
        return is_held(robot, margins_at(robot, poses, lowest, highest, wrenches, effects))

    if not held(near).all() or held(far).any():
        raise InputError("boundary needs poses inside that can be held, and outside that cannot")
    for _ in range(200):
        if np.all(np.linalg.norm(far[:, :3] - near[:, :3], axis=1) <= tolerance):
            break
        middle = near.copy()
        middle[:, :3] = 0.5 * (near[:, :3] + far[:, :3])
        there = held(middle)[:, None]
        near, far = np.where(there, middle, near), np.where(there, far, middle)
    return near
