"""Samples and turned poses that searches start from."""

from __future__ import annotations

import numpy as np
import pytest
from slab import REACH, slab

from seecr.description.joints import pose_of_values
from seecr.description.mjcf import load_robot
from seecr.inverse.nearest import seeds
from seecr.inverse.nearest.problem import Reaching
from seecr.pose import pose_difference

FREE = load_robot("demobot_cogiro")


def free(fix_position: bool = False) -> Reaching:
    """A free platform that anything holds, wanted once aside and once outside of its frame."""
    wanted = np.tile(FREE.reference_pose, (2, 1))
    wanted[:, :3] += [[0.05, 0.0, 0.0], [5.0, 0.0, 0.0]]
    matrix = np.concatenate([np.eye(6), -np.eye(6)[:, :2]], axis=1)

    def balance(poses, rows, about=None):  # type: ignore[no-untyped-def]
        return np.tile(matrix, (len(poses), 1, 1)), np.full((len(poses), 6), 0.5)

    def stays(poses, rows):  # type: ignore[no-untyped-def]
        return np.ones(len(poses), dtype=bool)

    limits = np.zeros(8), np.full(8, 2.0)
    return Reaching.within(
        FREE, wanted, balance, stays, limits, np.ones(2), fix_position=fix_position
    )


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seeds, "_SAMPLE", 400)
    monkeypatch.setattr(seeds, "_IN_PLACE", 200)


def test_the_sample_is_held_within_the_frame_and_begins_at_the_reference_pose() -> None:
    problem = slab([1.0])
    poses = pose_of_values(problem.robot, seeds.sample(problem))[0]
    home = problem.robot.reference_pose
    assert np.array_equal(poses[0], home) and 20 < len(poses) < 400
    assert np.abs(poses[:, 0] - home[0]).max() <= REACH
    box = np.concatenate([problem.robot.exit_points, home[None, :3]])
    assert np.all(poses[:, :3] >= box.min(axis=0) - 1e-9)
    assert np.all(poses[:, :3] <= box.max(axis=0) + 1e-9)


def test_half_of_a_free_platforms_sample_is_turned_by_a_radian_at_most() -> None:
    poses = seeds.sample(free())
    turns = np.linalg.norm(
        pose_difference(poses, np.tile(FREE.reference_pose, (len(poses), 1)))[:, 3:], axis=1
    )
    assert 0.5 <= np.mean(turns <= 1.0) < 0.6 and turns.max() > 2.0


def test_each_row_gets_the_reference_pose_and_its_nearest() -> None:
    problem = free()
    poses = seeds.sample(problem)
    found = seeds.from_sample(problem, poses)
    for row in range(2):
        mine, every = found.away[found.rows == row], problem.to(poses, np.full(len(poses), row))
        assert mine[0] == pytest.approx(every[0])
        assert np.linalg.norm(mine, axis=1).min() == pytest.approx(
            np.linalg.norm(every, axis=1).min()
        )


def test_turned_poses_begin_at_the_nearest_point_of_the_frame() -> None:
    problem = free()
    found = seeds.about_wanted(problem)
    last = found.away[found.rows == 1][-1]  # moved to the frame, not turned
    x = problem.placed(last[None], np.array([1]))[0, 0]
    assert x == pytest.approx(FREE.exit_points[:, 0].max()) and np.all(last[3:] == 0.0)


def test_positions_that_are_kept_stay_in_all_candidates() -> None:
    problem = free(fix_position=True)
    found = seeds.from_sample(problem, seeds.sample(problem)).and_more(seeds.about_wanted(problem))
    assert problem.is_in_place and np.all(found.away[:, :3] == 0.0)
    assert np.abs(found.away[:, 3:]).max() > 0.1
