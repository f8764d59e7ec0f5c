"""Local searches for the nearest pose, on a slab whose nearest point is known."""

from __future__ import annotations

import numpy as np
import pytest
from slab import REACH, slab

from seecr.inverse.nearest.inward import inward, restored, tightened
from seecr.inverse.nearest.newton import goal
from seecr.inverse.nearest.problem import Curved, Spots
from seecr.inverse.nearest.search import nearest

# Margin that is kept inside the limits [m].
_INSIDE = 1e-6


def begun(problem, x):  # type: ignore[no-untyped-def]
    """Searches from poses so far beside the wanted ones, half a metre too high."""
    return problem.start(
        np.stack([np.array(x, float), np.full(len(x), 0.5)], axis=1), np.arange(len(x))
    )


def test_a_search_ends_where_the_slab_ends_and_at_the_wanted_height() -> None:
    problem = slab([1.0, -3.0])
    found = inward(problem, begun(problem, [-0.9, 3.2]))
    assert found.left.max() < 1e-9
    assert found.away == pytest.approx(np.array([[-1.0 + REACH, 0], [3.0 - REACH, 0]]), abs=3e-6)


def test_a_wanted_pose_that_can_be_held_is_found_itself() -> None:
    problem = slab([0.2])
    assert problem.size(inward(problem, begun(problem, [-0.5])))[0] < 1e-6


def test_one_step_without_damping_solves_a_linear_balance() -> None:
    problem = slab([1.0])
    here = begun(problem, [-0.8])
    at = Curved.about(problem, here.away, here.tensions, here.rows)
    to, price, possible = goal(problem, at, here, np.zeros(1))
    assert possible[0]
    assert to.away == pytest.approx(np.array([[-1.0 + REACH, 0.0]]), abs=3e-6)
    # the price of the balance is what holds the step back: turn^T price = -away
    assert at.turn[0].T @ price[0] == pytest.approx(-to.away[0], abs=1e-3)


def test_points_off_balance_are_brought_back_and_those_beyond_help_are_left_out() -> None:
    problem = slab([1.0, 1.0])
    start = Spots(
        np.array([[0.2, 0.0], [-1.0, 0.3]]), np.arange(2), np.ones((2, 3)), np.full(2, 9.0)
    )
    back = restored(problem, start)
    assert back.left.max() < 1e-8 and problem.held(back.away, back.rows).all()
    assert back.away[0] == pytest.approx([-1.0 + REACH, 0.0], abs=3e-6)
    assert len(tightened(problem, start).rows) == 2


def test_the_nearest_of_all_is_firm_and_settled() -> None:
    problem = slab([1.0, 0.2])
    found = nearest(problem)
    assert found.found.all() and found.firm.all() and found.settled.all()
    x = found.poses[:, 0] - problem.robot.reference_pose[0]
    assert x == pytest.approx([REACH, 0.2], abs=1e-5)
