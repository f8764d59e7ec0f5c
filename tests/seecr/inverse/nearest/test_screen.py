"""Starting points: as near as a straight line leads, and apart from each other."""

from __future__ import annotations

import numpy as np
import pytest
from slab import REACH, slab

from seecr.inverse.nearest.screen import screened, spread, toward
from seecr.inverse.nearest.seeds import Candidates


def test_a_straight_line_ends_within_its_last_halving_of_the_edge() -> None:
    problem = slab([1.0])
    away, rows = toward(problem, np.array([[-1.2, 0.0]]), np.zeros(1, dtype=int), problem.held)
    beyond = away[0, 0] - (-1.0 + REACH)
    assert -1.2 / 2**7 - 1e-12 <= beyond <= 0.0 and away[0, 1] == 0.0 and rows.tolist() == [0]


def test_starts_are_the_nearest_that_are_apart() -> None:
    """A platform that cannot turn is compared by position, in distances of the nearest."""
    problem = slab([1.0, 1.0])
    away = np.array([[1.0, 0], [1.05, 0], [0, 1.5], [-2.0, 0], [9.0, 9.0], [0.5, 0]])
    rows = np.array([0, 0, 0, 0, 0, 1])
    assert spread(problem, away, rows, 3) == [0, 2, 3, 5]


def test_where_too_few_are_apart_closer_ones_will_do() -> None:
    problem = slab([1.0])
    away = np.array([[1.0, 0], [1.2, 0], [1.1, 0]])
    assert spread(problem, away, np.zeros(3, dtype=int), 2) == [0, 1]


def test_candidates_that_are_not_held_are_brought_to_where_they_are() -> None:
    problem = slab([1.0])
    found = screened(problem, Candidates(np.array([[0.3, 0.1]]), np.zeros(1, dtype=int)), 4)
    assert len(found.rows) == 1 and problem.held(found.away, found.rows).all()
    assert found.away[0, 0] == pytest.approx(-1.0 + REACH, abs=1e-4)
