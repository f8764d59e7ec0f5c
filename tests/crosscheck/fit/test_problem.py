"""Residuals in units of their noise, and the most likely errors of noisy lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term
from scipy import stats

from crosscheck.fit import length_errors
from crosscheck.fit.length_errors import Rows, with_length_errors
from crosscheck.fit.problem import Problem, angle_rates, noise_factors, rms_by_kind
from crosscheck.fit.residual_noise import whiteness
from crosscheck.fit.state import evaluate
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.noise import Noise
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.pose import Array, quat_from_rotvec, quat_from_rxyz, quat_multiply, rxyz_from_quat


def test_angles_turn_as_differences_say() -> None:
    rng = np.random.default_rng(0)
    quat = quat_from_rxyz(rng.uniform(-1.3, 1.3, (40, 3)))
    found, step = angle_rates(quat), 1e-6
    for k in range(3):
        turn = np.zeros(3)
        turn[k] = step
        ahead, behind = (
            rxyz_from_quat(quat_multiply(quat_from_rotvec(s * turn), quat)) for s in (1, -1)
        )
        assert found[..., k] == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)


def test_where_angles_turn_without_end_the_rates_stay_finite() -> None:
    assert np.all(np.isfinite(angle_rates(quat_from_rxyz(np.array([[0.3, np.pi / 2, 0.1]])))))


def test_noise_of_lengths_reaches_the_readings_and_their_likeliest_errors_are_found() -> None:
    robot = load_robot(COGIRO)
    spread = 2e-4
    data = measured(robot, points=4, sigma=SIGMA)
    noisy = Sigma(SIGMA.position_m, SIGMA.orientation_rad, None, spread)
    problem = Problem(robot, data, noisy, np.ones(data.n_rows, dtype=bool))
    # one row whose lengths were 0.5 mm off, read exactly where it then rests
    errors = np.zeros((data.n_rows, robot.n_cables))
    errors[3] = 5e-4 * np.array([1, -1, 0, 0, 1, 0, -1, 0])
    there = problem.experiment.with_length_errors(errors).predict()
    data.position[:] = there.readings.position
    data.quat_wxyz[:] = there.readings.quat_wxyz
    state = evaluate(problem, Terms(), problem.noise(problem.experiment.predict()))
    found = state.experiment.length_errors
    assert found is not None
    # only what moves the platform is seen: the prediction there says whether it was found
    again = problem.experiment.with_length_errors(found).predict()
    off = np.linalg.norm(again.readings.position[3] - there.readings.position[3])
    plain = problem.experiment.predict()
    before = np.linalg.norm(plain.readings.position[3] - there.readings.position[3])
    assert off < 0.05 * before
    assert np.abs(np.delete(found, 3, axis=0)).max() < 1e-3 * spread


@pytest.mark.parametrize("off", [0.0, 3e-3])
def test_what_is_left_is_what_the_likeliest_errors_of_lengths_leave(off: float) -> None:
    """Where cables go slack straight lines promised less than any errors give; fits went there."""
    robot = load_robot(model_path("demobot_parallel"))
    data = measured(robot, points=6, sigma=SIGMA)
    data.position[:] += off
    noisy = Sigma(SIGMA.position_m, SIGMA.orientation_rad, None, 5e-4)
    problem = Problem(robot, data, noisy, np.ones(data.n_rows, dtype=bool))
    plain = problem.experiment.predict()
    state = evaluate(problem, Terms(), problem.noise(plain))
    errors = state.experiment.length_errors
    assert errors is not None
    there = problem.experiment.with_length_errors(errors).predict((), plain)
    left = np.where(problem.measured, problem.residuals(there.readings), 0.0)
    cost = ((left / problem.reading_sigma) ** 2).sum(axis=1)
    cost = cost + ((errors / problem.length_sigma) ** 2).sum(axis=1)
    own = np.nansum(state.table**2, axis=1)
    assert np.all(own > cost * (1 - 1e-6) - 1e-6)
    assert state.chi2 == pytest.approx(own.sum()) == pytest.approx(float(state.white @ state.white))


def test_noise_has_factors_where_a_platform_is_all_but_free_to_move() -> None:
    """Squares of large rates lose the noise of the readings: an error in the middle of a search."""
    rng = np.random.default_rng(2)
    own, rate = np.full((3, 6), 1e-3), 1e-3 * rng.normal(size=(3, 6, 4))
    rate[1] *= 1e11
    factors = noise_factors(own, rate)
    assert np.all(np.triu(factors, 1) == 0.0)
    assert np.all(np.diagonal(factors, axis1=1, axis2=2) > 0.0)
    np.testing.assert_allclose(
        factors[[0, 2]] @ np.swapaxes(factors[[0, 2]], 1, 2),
        rate[[0, 2]] @ np.swapaxes(rate[[0, 2]], 1, 2) + 1e-6 * np.eye(6), rtol=1e-9,
    )  # fmt: skip
    # four lengths move four directions of six: the others keep the noise of the readings
    still = np.linalg.qr(rate[1], mode="complete")[0][:, 4:]
    near = np.linalg.solve(factors[1], still)
    assert np.linalg.norm(near, axis=0) == pytest.approx(1e3, rel=1e-3)


def test_exact_lengths_leave_the_noise_as_stated() -> None:
    robot = load_robot(COGIRO)
    data = measured(robot, [term(robot, "platform_mass", added_kg=0.2)], points=2)
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    state = evaluate(problem, Terms(), problem.noise(problem.experiment.predict()))
    assert state.table[:, :3] == pytest.approx(state.raw[:, :3] / SIGMA.position_m)
    assert state.log_det == 0.0


@pytest.mark.slow
def test_errors_of_values_grow_where_residuals_go_together() -> None:
    """A tracker whose noise wanders: what is fitted is less sure than its scatter says."""
    robot = load_robot(COGIRO)
    rng = np.random.default_rng(5)
    plain, grown = [], []
    for seed in range(12):
        data = measured(robot, points=12, seed=seed)
        wander = np.zeros((data.n_rows, 3))
        for k in range(1, data.n_rows):
            wander[k] = 0.85 * wander[k - 1] + 1e-4 * rng.standard_normal(3)
        data.position[:] += wander
        problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
        every = Data.of(problem, Terms())
        found = fit(every, every.state(Terms([term(robot, "tracker_frame")])))
        assert whiteness(problem, found.state.white, 6).structured
        white = replace(found, noise=Noise(found.noise.scale, np.zeros(3)))
        plain.append(found.terms.vector[:3] / white.stderr[:3])
        grown.append(found.terms.vector[:3] / found.stderr[:3])
    # in standard errors these should scatter by one
    assert np.sqrt(np.mean(np.square(plain))) > 2.0
    assert 0.5 < np.sqrt(np.mean(np.square(grown))) < 1.6


def test_rows_that_are_far_off_are_no_part_of_the_errors():
    data = measured(load_robot(COGIRO), points=4)
    far = np.arange(data.n_rows) == 3
    off = replace(data, position=data.position + far[:, None])
    problem = Problem(load_robot(COGIRO), off, off.sigma, np.ones(data.n_rows, dtype=bool))
    raw = problem.residuals(problem.experiment.predict(()).readings)
    assert rms_by_kind(problem, raw)["position_rms_m"] > 0.1
    without = rms_by_kind(problem.with_far_off(far), raw)
    assert without == rms_by_kind(problem.only(~far), raw)
    assert problem.with_far_off(far).n_readings == problem.n_readings


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
