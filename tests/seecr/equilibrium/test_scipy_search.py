"""The paper's own search on SciPy: its first guess, and where it gives up."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import robot_of

from seecr.commands import Commands
from seecr.effects.setup import plain_setup
from seecr.equilibrium.search import GAVE_UP, first_guess, solve_with_scipy
from seecr.equilibrium.solving import solve
from seecr.statics.solution import Status
from seecr.statics.tables import assemble


def test_the_first_guess_falls_by_the_weight_on_the_mean_vertical_extent() -> None:
    """Step 4: m g l_vmean / k_c, written out for one pose."""
    robot = robot_of("demobot_cogiro")
    pose = np.array([[0.3, 0.2, 0.1, 1.0, 0, 0, 0]])
    below = robot.exit_points[:, 2] - (pose[0, 2] + robot.anchor_points[:, 2])
    fall = robot.mass * 9.81 * below.mean() / robot.ea.mean()
    found = first_guess(plain_setup(robot, Commands(pose)))
    assert found == pytest.approx([fall], rel=1e-3)


@pytest.mark.parametrize("method", ["fsolve", "least_squares"])
@pytest.mark.parametrize("kind", ["demobot_parallel", "planar_vertical"])
def test_it_finds_what_the_descent_finds(kind: str, method: str) -> None:
    robot = robot_of(kind)
    pose = robot.reference_pose[None]
    ours, theirs = solve(robot, pose), solve(robot, pose, method=method)
    assert theirs.status[0] is Status.CONVERGED
    assert theirs.pose == pytest.approx(ours.pose, abs=1e-9)


def test_a_search_that_is_cut_off_says_so() -> None:
    robot = robot_of("demobot_cogiro")
    setup = plain_setup(robot, Commands(np.array([[0.3, 0.2, 0.1, 1.0, 0, 0, 0]])))
    found = solve_with_scipy(setup, assemble(setup), "least_squares", None, 1)
    assert found.outcome.tolist() == [GAVE_UP]


def test_what_balances_is_an_answer_though_scipy_gives_up() -> None:
    """fsolve says here that it makes no progress, at forces that balance to rounding."""
    robot = robot_of("demobot_parallel")
    pose = robot.reference_pose.copy()
    pose[[0, 2]] = 0.49, 0.1
    found = solve(robot, pose, method="fsolve")
    assert found.status[0] is Status.CONVERGED and found.residual[0] < 1e-12
    np.testing.assert_allclose(found.pose, solve(robot, pose).pose, atol=1e-9)
