"""A platform on two slides that is held where |x - x0| is at most a reach: answers by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.description.mjcf import load_robot
from seecr.description.robot import Joint, Robot
from seecr.inverse.nearest_problem import NearestProblem, Rows
from seecr.pose import Array

REACH = 0.25
"""Largest distance [m] from the reference pose, along x, at which tensions of up to 4 N hold."""

# Two cables pull along x, one each way, and one carries the weight of 1 N along z.
_MATRIX = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
_STIFF = 10.0


def slides() -> Robot:
    """A platform that slides along x and z."""
    robot = load_robot("planar_vertical")
    home = robot.reference_pose[:3]
    joints = tuple(Joint("slide", name, np.eye(3)[k], home) for name, k in (("x", 0), ("z", 2)))
    return replace(robot, joints=joints)


def slab(wanted_x: list[float], stays_from: float = -np.inf) -> NearestProblem:
    """Wanted poses so far [m] beside the reference pose; stable only from some x on."""
    robot = slides()
    wanted = np.tile(robot.reference_pose, (len(wanted_x), 1))
    wanted[:, 0] += wanted_x

    def balance(poses: Array, rows: Rows, about: Array | None = None) -> tuple[Array, Array]:
        load = np.ones((len(poses), 2))
        load[:, 0] = _STIFF * (poses[:, 0] - robot.reference_pose[0])
        return np.tile(_MATRIX, (len(poses), 1, 1)), load

    def stays(poses: Array, rows: Rows) -> np.ndarray:
        return np.asarray(poses[:, 0] - robot.reference_pose[0] >= stays_from)

    limits = np.zeros(3), np.array([_STIFF * REACH, _STIFF * REACH, 2.0])
    return NearestProblem.within(robot, wanted, balance, stays, limits, np.ones(len(wanted)))
