"""SEECR against MuJoCo on robots that neither has seen: two physics, one description."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot, write_mjcf

from crosscheck.settle.settler import Settler
from seecr import load_robot, solve
from seecr.pose import pose_difference

SEEDS = range(5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", SEEDS)
def test_both_come_to_rest_at_the_same_place(kind: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(1000 + seed)
    path = write_mjcf(random_robot(rng, kind), tmp_path / "robot.xml")
    robot, settler = load_robot(path), Settler(path)
    poses = random_poses(rng, robot, 3)
    answer = solve(robot, poses)
    assert np.all(answer.converged)
    for i, pose in enumerate(poses):
        settled = settler.settle(pose, answer.rest_lengths[i])
        assert settled.settled, settled.status.value
        away = pose_difference(settled.pose, answer.pose[i])
        # what the unbalanced rest of either could move the softest direction by
        soft = answer.smallest_eigenvalue[i]
        slip = robot.weight * (settled.residual + answer.residual[i]) / soft
        assert np.linalg.norm(away[:3]) < 1e-8 * robot.length + 2 * slip
        assert np.linalg.norm(away[3:]) < 1e-7 + 2 * slip / robot.length
        pulls = settled.tensions - answer.tensions[i]
        assert np.abs(pulls).max() < 1e-6 * robot.weight
        barely = np.maximum(settled.tensions, answer.tensions[i]) < 1e-6 * robot.weight
        assert np.array_equal(settled.slack[~barely], answer.slack[i][~barely])


def test_a_cable_one_per_mille_stiffer_is_seen(tmp_path: Path) -> None:
    """The comparison above has teeth: so small a difference fails it."""
    rng = np.random.default_rng(1)
    robot = random_robot(rng)
    pose = random_poses(rng, robot, 1)
    answer = solve(robot, pose)
    taut = int(np.argmax(answer.tensions[0]))
    ea = robot.ea.copy()
    ea[taut] *= 1.001
    settler = Settler(write_mjcf(robot, tmp_path / "robot.xml"), ea=ea)
    settled = settler.settle(pose[0], answer.rest_lengths[0])
    away = pose_difference(settled.pose, answer.pose[0])
    assert np.linalg.norm(away[:3]) > 1e-6 * robot.length
