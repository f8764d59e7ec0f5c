"""Searches for the nearest pose and where they start, on a slab whose nearest point is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from slab import REACH, slab

from seecr.description.joints import pose_of_values
from seecr.description.mjcf import load_robot
from seecr.inverse import nearest_starts
from seecr.inverse.nearest import at_random, nearest, stable_ends
from seecr.inverse.nearest_problem import NearestProblem, Spots
from seecr.inverse.nearest_sqp import restored, solve_sqp, tightened
from seecr.inverse.nearest_starts import Candidates, prune_starts, toward
from seecr.pose import pose_difference

FREE = load_robot("demobot_cogiro")
# A platform stays only to the right of this [m].
BORDER = 0.1


def begun(problem, x):  # type: ignore[no-untyped-def]
    """Searches from poses so far beside the wanted ones, half a metre too high."""
    return problem.start(
        np.stack([np.array(x, float), np.full(len(x), 0.5)], axis=1), np.arange(len(x))
    )


def test_a_search_ends_where_the_slab_ends_and_at_the_wanted_height() -> None:
    problem = slab([1.0, -3.0])
    found = solve_sqp(problem, begun(problem, [-0.9, 3.2]))
    assert found.left.max() < 1e-9
    assert found.away == pytest.approx(np.array([[-1.0 + REACH, 0], [3.0 - REACH, 0]]), abs=3e-6)


def test_a_wanted_pose_that_can_be_held_is_found_itself() -> None:
    problem = slab([0.2])
    assert problem.size(solve_sqp(problem, begun(problem, [-0.5])))[0] < 1e-6


def test_points_off_balance_are_brought_back_and_those_beyond_help_are_left_out() -> None:
    problem = slab([1.0, 1.0])
    start = Spots(
        np.array([[0.2, 0.0], [-1.0, 0.3]]), np.arange(2), np.ones((2, 3)), np.full(2, 9.0)
    )
    back = restored(problem, start)
    assert back.left.max() < 1e-8 and problem.held(back.away, back.rows).all()
    assert back.away[0] == pytest.approx([-1.0 + REACH, 0.0], abs=3e-6)
    assert len(tightened(problem, start).rows) == 2


def test_the_nearest_of_all_is_stable_and_settled() -> None:
    problem = slab([1.0, 0.2])
    found = nearest(problem)
    assert found.found.all() and found.stable.all() and found.settled.all()
    x = found.poses[:, 0] - problem.robot.reference_pose[0]
    assert x == pytest.approx([REACH, 0.2], abs=1e-5)


def test_a_wanted_pose_that_does_not_stay_gets_the_nearest_that_does() -> None:
    found = nearest(slab([-0.3], stays_from=BORDER))
    assert found.stable.all()
    x = found.poses[0, 0] - slab([0.0]).robot.reference_pose[0]
    assert BORDER <= x < BORDER + 0.02


def test_random_tries_go_to_the_border_and_never_beyond() -> None:
    problem = slab([-0.3], stays_from=BORDER)
    start = np.array([[0.5, 0.1]])
    found = at_random(problem, start, np.zeros(1, dtype=int))
    assert problem.stable(found, np.zeros(1, dtype=int)).all()
    assert np.linalg.norm(found) == pytest.approx(0.3 + BORDER, abs=0.02)


def test_all_ends_are_stable() -> None:
    problem = slab([-0.3], stays_from=BORDER)
    poses = np.tile(problem.robot.reference_pose, (12, 1))
    poses[:, 0] += np.linspace(0.0, 0.24, 12)
    found = stable_ends(problem, problem.coordinates(poses), np.zeros((1, 2)))
    assert len(found.rows) and problem.stable(found.away, found.rows).all()


def test_a_part_of_a_problem_has_the_loads_of_its_own_rows() -> None:
    problem = slab([1.0, -2.0, 0.0])
    own = replace(
        problem, balance=lambda poses, rows, about=None: (rows, rows),
        stays=lambda poses, rows: rows, holds=lambda poses, rows: rows,
    )  # fmt: skip
    part, away, second = own.part(np.array([2, 0])), np.zeros((1, 2)), np.array([1])
    assert np.array_equal(part.wanted, problem.wanted[[2, 0]])
    assert part.at(away, second)[0].tolist() == part.rests(away, second).tolist() == [0]
    assert part.holds is not None and part.holds(away, second).tolist() == [0]


def test_a_straight_line_ends_within_its_last_halving_of_the_edge() -> None:
    problem = slab([1.0])
    away, rows = toward(problem, np.array([[-1.2, 0.0]]), np.zeros(1, dtype=int), problem.held)
    beyond = away[0, 0] - (-1.0 + REACH)
    assert -1.2 / 2**7 - 1e-12 <= beyond <= 0.0 and away[0, 1] == 0.0 and rows.tolist() == [0]


def test_candidates_that_are_not_held_are_brought_to_where_they_are() -> None:
    problem = slab([1.0])
    found = prune_starts(problem, Candidates(np.array([[0.3, 0.1]]), np.zeros(1, dtype=int)), 4)
    assert len(found.rows) == 1 and problem.held(found.away, found.rows).all()
    assert found.away[0, 0] == pytest.approx(-1.0 + REACH, abs=1e-4)


def free(fix_position: bool = False) -> NearestProblem:
    """A free platform that anything holds, wanted once aside and once outside of its frame."""
    wanted = np.tile(FREE.reference_pose, (2, 1))
    wanted[:, :3] += [[0.05, 0.0, 0.0], [5.0, 0.0, 0.0]]
    matrix = np.concatenate([np.eye(6), -np.eye(6)[:, :2]], axis=1)

    def balance(poses, rows, about=None):  # type: ignore[no-untyped-def]
        return np.tile(matrix, (len(poses), 1, 1)), np.full((len(poses), 6), 0.5)

    def stays(poses, rows):  # type: ignore[no-untyped-def]
        return np.ones(len(poses), dtype=bool)

    limits = np.zeros(8), np.full(8, 2.0)
    return NearestProblem.within(
        FREE, wanted, balance, stays, limits, np.ones(2), fix_position=fix_position
    )


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearest_starts, "_SAMPLE", 400)
    monkeypatch.setattr(nearest_starts, "_IN_PLACE", 200)


@pytest.mark.usefixtures("few")
def test_the_sample_is_held_within_the_frame_and_begins_at_the_reference_pose() -> None:
    problem = slab([1.0])
    poses = pose_of_values(problem.robot, nearest_starts.sample(problem))[0]
    home = problem.robot.reference_pose
    assert np.array_equal(poses[0], home) and 20 < len(poses) < 400
    assert np.abs(poses[:, 0] - home[0]).max() <= REACH
    box = np.concatenate([problem.robot.exit_points, home[None, :3]])
    assert np.all(poses[:, :3] >= box.min(axis=0) - 1e-9)
    assert np.all(poses[:, :3] <= box.max(axis=0) + 1e-9)


@pytest.mark.usefixtures("few")
def test_half_of_a_free_platforms_sample_is_turned_by_a_radian_at_most() -> None:
    poses = nearest_starts.sample(free())
    turns = np.linalg.norm(
        pose_difference(poses, np.tile(FREE.reference_pose, (len(poses), 1)))[:, 3:], axis=1
    )
    assert 0.5 <= np.mean(turns <= 1.0) < 0.6 and turns.max() > 2.0


@pytest.mark.usefixtures("few")
def test_turned_poses_begin_at_the_nearest_point_of_the_frame() -> None:
    problem = free()
    found = nearest_starts.about_wanted(problem)
    last = found.away[found.rows == 1][-1]  # moved to the frame, not turned
    x = problem.placed(last[None], np.array([1]))[0, 0]
    assert x == pytest.approx(FREE.exit_points[:, 0].max()) and np.all(last[3:] == 0.0)


@pytest.mark.usefixtures("few")
def test_positions_that_are_kept_stay_in_all_candidates() -> None:
    problem = free(fix_position=True)
    sampled = nearest_starts.from_sample(problem, nearest_starts.sample(problem))
    found = sampled.and_more(nearest_starts.about_wanted(problem))
    assert problem.motion.is_in_place and np.all(found.away[:, :3] == 0.0)
    assert np.abs(found.away[:, 3:]).max() > 0.1
