"""Digits of the balance that is told hold, also where doubles resolve less than the solver found.

Forces are computed again from the robot's own numbers in extended precision, with 11 bits more.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from seecr import Robot, Solution, load_robot, solve

LONG = np.longdouble


def rotation(quat: np.ndarray) -> np.ndarray:
    w, x, y, z = quat.astype(LONG)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=LONG)
    return np.eye(3, dtype=LONG) + 2 * (w * cross + cross @ cross) / (w * w + x * x + y * y + z * z)


def unbalanced(robot: Robot, found: Solution, k: int) -> float:
    """Force, or torque over the robot's length, at the pose of row k, relative to the weight."""
    exits, anchors = robot.exit_points.astype(LONG), robot.anchor_points.astype(LONG)

    def ways(pose: np.ndarray) -> np.ndarray:
        return exits - pose[:3].astype(LONG) - anchors @ rotation(pose[3:]).T

    def lengths(pose: np.ndarray) -> np.ndarray:
        return np.sqrt((ways(pose) ** 2).sum(axis=1))

    wound = lengths(found.command[k]) - lengths(robot.reference_pose)
    rest = robot.rest_lengths.astype(LONG) + wound
    length, turn = lengths(found.pose[k]), rotation(found.pose[k, 3:])
    pull = robot.ea * np.maximum(length - rest, 0) / rest
    forces = (pull / length)[:, None] * ways(found.pose[k])
    weight = LONG(robot.mass) * robot.gravity.astype(LONG)
    torque = np.cross(anchors @ turn.T, forces).sum(axis=0)
    torque += np.cross(turn @ robot.centre_of_mass.astype(LONG), weight)
    sizes = [np.sqrt((one**2).sum()) for one in (forces.sum(axis=0) + weight, torque)]
    return float(max(sizes[0], sizes[1] / LONG(robot.length)) / np.sqrt((weight**2).sum()))


@pytest.mark.skipif(np.finfo(LONG).eps > 1e-18, reason="no extended precision on this machine")
@pytest.mark.parametrize("name", ["demobot_parallel", "cogiro_large", "ipanema"])
@pytest.mark.parametrize("ea", [1e5, 1e7])
def test_the_balance_that_is_told_is_true(name: str, ea: float) -> None:
    robot = load_robot(name)
    robot = replace(robot, ea=np.full(robot.n_cables, ea))
    poses = np.tile(robot.reference_pose, (12, 1))
    poses[:, :3] += np.random.default_rng(0).uniform(-0.05, 0.05, (12, 3))
    found = solve(robot, poses)
    true = np.array([unbalanced(robot, found, k) for k in range(len(found))])
    rows = found.converged
    assert rows.sum() > 5
    assert np.all(true[rows] < found.balance[rows])
    # and it is no excuse: at most a few dozen times what is there
    assert found.balance[rows].max() < 50.0 * true[rows].max()
    told = re.search(r"forces balance to (\S+) of the load", str(found))
    assert told is not None and float(told[1]) == pytest.approx(found.balance[rows].max(), rel=0.5)


@pytest.mark.skipif(np.finfo(LONG).eps > 1e-18, reason="no extended precision on this machine")
def test_the_residual_alone_would_not_be_true() -> None:
    """1e-15 was printed of a robot of E S = 1e7 N whose forces balance to 1e-9."""
    robot = load_robot("demobot_parallel")
    robot = replace(robot, ea=np.full(robot.n_cables, 1e7))
    found = solve(robot, robot.reference_pose + np.array([0.01, 0.02, 0.01, 0, 0, 0, 0]))
    assert unbalanced(robot, found, 0) > 100.0 * found.residual[0]
