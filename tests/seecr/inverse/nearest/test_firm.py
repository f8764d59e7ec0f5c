"""Nearest poses that are stable, where balance alone would lead nearer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from slab import slab

from seecr.inverse.nearest.firm import at_random, firm_ends, nearest_of, part_of
from seecr.inverse.nearest.search import nearest
from seecr.inverse.nearest.seeds import Candidates

# The platform stays only to the right of this [m].
BORDER = 0.1


def test_the_nearest_of_each_row_that_has_any() -> None:
    some = Candidates(np.array([[3.0, 0], [0, 1.0], [0.5, 0], [2.0, 0]]), np.array([2, 0, 2, 0]))
    away, rows = nearest_of(slab([0.0, 0.0, 0.0]), some)
    assert rows.tolist() == [0, 2] and away.tolist() == [[0, 1.0], [0.5, 0]]


def test_a_part_of_a_problem_has_the_loads_of_its_own_rows() -> None:
    problem = slab([1.0, -2.0, 0.0])
    part = part_of(problem, np.array([2, 0]))
    away, both = np.zeros((2, 2)), np.arange(2)
    assert np.array_equal(part.wanted, problem.wanted[[2, 0]])
    for mine, whole in zip(part.at(away, both), problem.at(away, np.array([2, 0])), strict=True):
        assert np.array_equal(mine, whole)
    weighed = replace(problem, balance=lambda poses, rows, about=None: (rows, rows))
    second = np.array([1])
    assert part_of(weighed, np.array([2, 0])).at(away[:1], second)[0].tolist() == [0]


def test_random_tries_go_to_the_border_and_never_beyond() -> None:
    problem = slab([-0.3], stays_from=BORDER)
    start = np.array([[0.5, 0.1]])
    found = at_random(problem, start, np.zeros(1, dtype=int))
    assert problem.firm(found, np.zeros(1, dtype=int)).all()
    assert np.linalg.norm(found) == pytest.approx(0.3 + BORDER, abs=0.02)


def test_all_ends_are_firm() -> None:
    problem = slab([-0.3], stays_from=BORDER)
    poses = np.tile(problem.robot.reference_pose, (12, 1))
    poses[:, 0] += np.linspace(0.0, 0.24, 12)
    found = firm_ends(problem, problem.coordinates(poses), np.zeros((1, 2)))
    assert len(found.rows) and problem.firm(found.away, found.rows).all()


def test_a_wanted_pose_that_does_not_stay_gets_the_nearest_that_does() -> None:
    found = nearest(slab([-0.3], stays_from=BORDER))
    assert found.firm.all()
    x = found.poses[0, 0] - slab([0.0]).robot.reference_pose[0]
    assert BORDER <= x < BORDER + 0.02
