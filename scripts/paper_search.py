"""The paper's search as it is printed (section III-B), and how often it evaluates its equations.

SciPy's ``fsolve`` and ``least_squares`` with their default tolerances, on newtons and
newton-metres as they are, from the paper's first guess. :func:`seecr.solve` has the same searches
on scaled equations and with tight tolerances.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from seecr.description.robot import Robot
from seecr.pose import Array, quat_from_rotvec, quat_to_matrix

METHODS = ("fsolve", "least_squares")


@dataclass(frozen=True, eq=False)
class Search:
    """One method at n poses.

    Attributes:
        calls: (n,) evaluations of the equations, those that difference the Jacobian among them.
        claims: (n,) bool, SciPy says that it has found a solution.
        left: (n,) unbalanced force over the weight, a torque over the robot's length.
    """

    calls: Array
    claims: NDArray[np.bool_]
    left: Array


def equations(robot: Robot, pose: Array) -> Callable[[Array], Array]:
    """Unbalanced force [N] and torque [N m] (6,) by the deviation (6,) [m, rad] from a pose."""
    lengths = robot.nominal_lengths(pose[None])[0]
    turned = quat_to_matrix(pose[3:])
    weight = robot.mass * robot.gravity

    def unbalanced(deviation: Array) -> Array:
        turn = quat_to_matrix(quat_from_rotvec(deviation[3:])) @ turned
        levers = robot.anchor_points @ turn.T
        ways = robot.exit_points - pose[:3] - deviation[:3] - levers
        now = np.linalg.norm(ways, axis=1)
        pull = np.maximum(robot.ea * (now - lengths) / lengths, 0.0)[:, None] * ways / now[:, None]
        force = pull.sum(axis=0) + weight
        centre = turn @ robot.centre_of_mass
        torque = np.cross(levers, pull).sum(axis=0) + np.cross(centre, weight)
        return np.concatenate([force, torque])

    return unbalanced


def search(robot: Robot, poses: Array, method: str) -> Search:
    """The paper's search at poses (n, 7) of a free robot whose winches pay out straight lengths."""
    results = [_one(robot, pose, method) for pose in poses]
    return Search(*(np.array(column) for column in zip(*results, strict=True)))


def _one(robot: Robot, pose: Array, method: str) -> tuple[int, bool, float]:
    calls = [0]
    unbalanced = equations(robot, pose)

    def counted(deviation: Array) -> Array:
        calls[0] += 1
        return unbalanced(deviation)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        if method == "fsolve":
            found, _info, flag, _text = optimize.fsolve(
                counted, _guess(robot, pose), full_output=True
            )
            claims = flag == 1
        else:
            result = optimize.least_squares(counted, _guess(robot, pose))
            found, claims = result.x, bool(result.success)
    left = unbalanced(found) / np.repeat([1.0, robot.length], 3)
    return calls[0], claims, float(np.linalg.norm(left)) / robot.weight


def _guess(robot: Robot, pose: Array) -> Array:
    """Step 4: fallen by m g l_vmean / k_c."""
    levers = robot.anchor_points @ quat_to_matrix(pose[3:]).T
    vertical = (robot.exit_points - pose[:3] - levers) @ robot.up
    fall = robot.weight * vertical.mean() / robot.ea.mean()
    return np.concatenate([-fall * robot.up, np.zeros(3)])
