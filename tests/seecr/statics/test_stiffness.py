"""Stiffness under a moment, beside differences of forces that plain NumPy finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot

import seecr
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.pose import Array, pose_add, pose_difference, quat_rotate

STEP = 1e-5


def wrench_at(robot: seecr.Robot, rest: Array, outer: Array, pose: Array) -> Array:
    """Force and moment (6,) about the platform's origin: straight cables, weight and load."""
    arms, centre = (
        quat_rotate(pose[3:], one) for one in (robot.anchor_points, robot.centre_of_mass)
    )
    way = robot.exit_points - (pose[:3] + arms)
    length = np.linalg.norm(way, axis=1)
    pulls = (robot.ea * np.maximum(length / rest - 1.0, 0.0) / length)[:, None] * way
    weight = robot.mass * robot.gravity
    torque = np.cross(arms, pulls).sum(axis=0) + np.cross(centre, weight)
    return outer + np.concatenate([pulls.sum(axis=0) + weight, torque])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_minus_the_derivative_of_forces_also_under_a_moment(kind: str, seed: int) -> None:
    """A moment that does not turn with the platform leaves it without symmetry."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, kind, cables=8)
    robot = replace(robot, ea=np.full(8, 100.0 * robot.weight))
    outer = robot.weight * rng.uniform(-0.1, 0.1, 6) * np.repeat([1.0, 0.5 * robot.length], 3)
    found = seecr.solve(robot, random_poses(rng, robot, 3), wrench=outer)
    assert found.converged.any()
    for k in np.flatnonzero(found.converged):
        home = found.pose[k]
        values = values_of_pose(robot, home[None])[0][0] if robot.joints else np.zeros(6)

        def pose_at(q: Array, home: Array = home) -> Array:
            return pose_of_values(robot, q[None])[0][0] if robot.joints else pose_add(home, q)

        def forces(q: Array, rest: Array = found.rest_lengths[k]) -> Array:
            wrench = wrench_at(robot, rest, outer, pose_at(q))
            if not robot.joints:
                return wrench
            steps = STEP * np.eye(len(q))
            moved = [pose_difference(pose_at(q + s), pose_at(q - s)) / (2.0 * STEP) for s in steps]
            return np.array(moved) @ wrench

        steps = STEP * np.eye(len(values))
        slope = [(forces(values + s) - forces(values - s)) / (2.0 * STEP) for s in steps]
        near = 1e-6 * np.abs(found.stiffness[k]).max()
        np.testing.assert_allclose(found.stiffness[k], -np.array(slope).T, rtol=1e-5, atol=near)
