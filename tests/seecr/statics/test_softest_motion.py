"""The softest motion is the platform's, whatever joints it is on."""

from __future__ import annotations

import numpy as np
import pytest
from rejointed import WAYS, rejointed

from seecr import solve, workspace_map
from seecr.description.mjcf import load_robot
from seecr.pose import quat_from_rotvec
from seecr.show.pose_words import stiffness_lines

POSES = np.array([[0.05, 0.02, 0.3], [-0.1, 0.0, -0.5], [0.0, 0.08, 0.0]])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["planar_vertical", "planar_two_cable"])
def test_the_softest_motion_does_not_depend_on_the_joints(name: str, way: str) -> None:
    """With the hinge first it had a third to a thirtieth of the stiffness."""
    robot = load_robot(name)
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, [0, 2]] += POSES[:, :2]
    poses[:, 3:] = quat_from_rotvec(POSES[:, 2:] * [0.0, 1.0, 0.0])
    here, there = solve(robot, poses), solve(rejointed(robot, way), poses)
    assert here.converged.all() and there.softest_direction.shape == (3, 6)
    np.testing.assert_allclose(there.smallest_eigenvalue, here.smallest_eigenvalue, rtol=1e-9)
    np.testing.assert_allclose(there.softest_direction, here.softest_direction, atol=1e-6)
    metre = np.repeat([1.0, robot.length], 3)
    assert np.linalg.norm(there.softest_direction * metre, axis=1) == pytest.approx(1.0)
    # it is the motion of the joints whose stiffness that is
    for one in (here, there):
        value, vectors = np.linalg.eigh(one.stiffness[0])
        moved = one.motion(0, vectors[:, 0]) * metre
        assert value[0] >= one.smallest_eigenvalue[0] * (moved @ moved) * (1.0 - 1e-9)
    assert list(stiffness_lines(here.rows([0]))) == list(stiffness_lines(there.rows([0])))


def test_maps_have_the_platforms_motion() -> None:
    robot = load_robot("planar_vertical")
    at = [np.linspace(k - 0.05, k + 0.05, 3) for k in robot.reference_pose[[0, 2]]]
    grid = (at[0], robot.reference_pose[1], at[1])
    here, there = (workspace_map(one, *grid) for one in (robot, rejointed(robot, "both")))
    assert there.softest.shape == (3, 1, 3, 6)
    np.testing.assert_allclose(there.stiffness, here.stiffness, rtol=1e-5)
    np.testing.assert_allclose(there.softest, here.softest, atol=1e-4)
    assert there.records()[0]["softest_ry_rad"] == there.softest[0, 0, 0, 4]
