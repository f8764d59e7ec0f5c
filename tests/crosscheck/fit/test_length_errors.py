"""Most likely errors of noisy lengths: found where cables go slack as well as elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured
from scipy import stats

from crosscheck.fit import length_errors
from crosscheck.fit.length_errors import Rows, with_length_errors
from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot, model_path
from seecr.pose import Array

SOFT = [("demobot_parallel", 5e-4), ("demobot_cogiro", 2e-3)]


def made(model: str, spread: float) -> tuple[Problem, Array]:
    """Rows read without noise where errors of the lengths take the robot, and these errors."""
    robot = load_robot(model_path(model))
    data = measured(robot, points=6)
    noisy = Sigma(SIGMA.position_m, SIGMA.orientation_rad, None, spread)
    problem = Problem(robot, data, noisy, np.ones(data.n_rows, dtype=bool))
    errors = np.random.default_rng(1).normal(0.0, spread, (data.n_rows, robot.n_cables))
    there = problem.experiment.with_length_errors(errors).predict()
    assert there.solved.all()
    assert 0.1 < there.slack.mean() < 0.5
    read = replace(data, position=there.readings.position, quat_wxyz=there.readings.quat_wxyz)
    return replace(problem, data=read), errors


@pytest.mark.parametrize(("model", "spread"), SOFT)
def test_errors_are_found_that_are_as_likely_as_the_true_ones(model: str, spread: float) -> None:
    """Straight lines from where a cable is taut, or slack, left hundreds of times as much."""
    problem, errors = made(model, spread)
    found = with_length_errors(problem, (), None, None).cost(problem)
    true = ((errors / spread) ** 2).sum(axis=1)
    few = stats.chi2.ppf(1.0 - 1e-3, errors.shape[1])
    assert np.sum(found > np.maximum(true, few)) <= 2


def test_a_search_from_nearby_has_converged_after_its_few_rounds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, spread = SOFT[0]
    problem, _errors = made(model, spread)
    there = with_length_errors(problem, (), None, None)
    by = np.random.default_rng(2).normal(0.0, 0.1 * spread, there.lines.errors.shape)
    start = Rows.predicted(problem, (), there.lines.errors + by, there.prediction)

    def searched() -> Array:
        some = with_length_errors(problem, (), start.lines.errors, start.prediction)
        return some.cost(problem)

    few = searched()
    monkeypatch.setattr(length_errors, "_ROUNDS_NEAR", 40)
    most = searched()
    assert np.all(few <= 1.01 * most + 0.01)
    assert np.sum(start.cost(problem) > 1.01 * most + 0.01) > 40


def test_a_row_that_is_on_a_kink_stays_there() -> None:
    """The best errors with the cable taut would slacken it, and the other way round."""
    problem, _errors = made(*SOFT[0])
    found = with_length_errors(problem, (), None, None)
    least = np.where(found.lines.pull > 0.0, found.lines.pull, np.inf).min(axis=1)
    on_kink = least < 1e-2 * found.lines.pull.max()
    assert on_kink.sum() >= 3
    again = found.lines.likeliest(problem)
    step = np.abs(again - found.lines.errors).max(axis=1) / SOFT[0][1]
    assert np.median(step[on_kink]) < 1e-2
