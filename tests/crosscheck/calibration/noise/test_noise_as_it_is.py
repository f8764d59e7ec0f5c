"""Noise that goes together along a run, rows far off, and what the joint fit says of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, measured
from scipy import stats

from crosscheck.calibration.noise.colour import WHITE, Chain, Colour, chain_of, log_det, whitened
from crosscheck.calibration.noise.restricted import estimate, log_evidence, with_slopes
from crosscheck.calibration.noise.robust import log_chance_of_outliers, outliers, row_weights
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot
from seecr.pose import Array


def chain(rows: int, channels: int = 3, runs: int = 2) -> Chain:
    """Readings of one kind in order of rows, cut into runs."""
    row = np.repeat(np.arange(rows), channels)
    before = np.arange(rows * channels) - channels
    fresh = row % (rows // runs) == 0
    return Chain(np.zeros(len(row), int), row, np.where(fresh, -1, before), np.ones(len(row)))


def covariance(c: Chain, colour: Colour, weight: np.ndarray) -> np.ndarray:
    """Of the noise, reading by reading: what whitening is the inverse root of."""
    n = len(c.row)
    root = np.zeros((n, n))
    for k in range(n):
        root[k, k] = 1.0
        if c.before[k] >= 0:
            phi = colour.rho[0] ** c.gap[k]
            root[k] = phi * root[c.before[k]]
            root[k, k] = np.sqrt(1 - phi**2)
    root = root * (colour.scale[0] / np.sqrt(weight))[:, None]
    return root @ root.T


COLOUR = Colour(np.array([1.7, 1.0, 1.0]), np.array([0.8, 0.0, 0.0]))


def test_whitening_is_an_inverse_root_of_the_noise() -> None:
    c = chain(8)
    weight = np.random.default_rng(0).uniform(0.1, 1.0, len(c.row))
    sigma = covariance(c, COLOUR, weight)
    root = whitened(c, COLOUR, weight, np.eye(len(c.row)))
    assert root @ sigma @ root.T == pytest.approx(np.eye(len(c.row)), abs=1e-12)
    assert log_det(c, COLOUR, weight) == pytest.approx(np.linalg.slogdet(sigma)[1])


def test_marginal_evidence_is_that_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(1)
    c = chain(6)
    n = len(c.row)
    x, y, width = rng.normal(size=(n, 4)), rng.normal(size=n), np.array([1.0, 2.0, 0.3, 1.0])
    whole = (x * width**2) @ x.T + covariance(c, COLOUR, np.ones(n))
    direct = -0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1])
    assert log_evidence(c, COLOUR, np.ones(n), x, y, width) == pytest.approx(direct)


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.95])
def test_its_slopes_are_those_of_finite_differences(rho: float) -> None:
    """Two kinds, gaps below and above one step, weights, columns of very different sizes."""
    rng, one = np.random.default_rng(5), chain(30)
    n = len(one.row)
    kind = np.where(np.arange(n) % 3 == 2, 2, 0)
    c = replace(one, kind=kind, gap=np.ones(n) if rho == 0.0 else rng.uniform(0.5, 3.0, n))
    x, width = rng.normal(size=(n, 7)) * 10.0 ** np.arange(-2, 5), np.geomspace(0.1, 5.0, 7)
    y, weight = rng.normal(size=n).cumsum(), rng.uniform(0.1, 1.0, n)
    scale, alike = np.array([1.7, 1.0, 0.6]), np.array([rho, 0.0, 0.5])

    def at(more: Array, rise: Array) -> float:
        colour = Colour(scale * np.exp(more), alike + rise)
        return log_evidence(c, colour, weight, x, y, width)

    value, by_scale, by_rho = with_slopes(c, Colour(scale, alike), weight, x, y, width)
    assert value == pytest.approx(at(np.zeros(3), np.zeros(3)), rel=1e-10)
    assert by_scale[1] == by_rho[1] == 0.0, "nothing of that kind was read"
    for k in (0, 2):
        step, none = 1e-5 * np.eye(3)[k], np.zeros(3)
        each = (at(step, none) - at(-step, none)) / 2e-5
        assert by_scale[k] == pytest.approx(each, rel=1e-5, abs=1e-5)
        back = none if alike[k] == 0.0 else -step
        each = (at(none, step) - at(none, back)) / (1e-5 if alike[k] == 0.0 else 2e-5)
        assert by_rho[k] == pytest.approx(each, rel=1e-3 if alike[k] == 0.0 else 1e-5)


def test_evidence_of_huge_columns_is_that_of_their_directions() -> None:
    """Each direction costs ln of its size; rounding must not eat the prior of the others."""
    rng, c = np.random.default_rng(5), chain(6)
    n = len(c.row)
    x, y = rng.normal(size=(n, 4)), np.zeros(n)

    def evidence(size: float) -> float:
        return log_evidence(c, COLOUR, np.ones(n), x, y, np.full(4, size))

    assert evidence(1e9) - evidence(1e12) == pytest.approx(4.0 * np.log(1e3), rel=1e-6)
    x[:, 3] = x[:, 0]
    assert evidence(1e5) - evidence(1e9) == pytest.approx(3.0 * np.log(1e4), rel=1e-6)


def test_size_and_correlation_are_found_though_half_the_readings_are_fitted_away() -> None:
    rng = np.random.default_rng(2)
    c = chain(144, runs=6)
    n = len(c.row)
    noise = np.linalg.cholesky(covariance(c, COLOUR, np.ones(n))) @ rng.normal(size=n)
    x, width = 30 * rng.normal(size=(n, 60)), np.ones(60)
    found = estimate(c, WHITE, np.ones(n), x, x @ rng.normal(size=60) + noise, width)
    assert found.scale[0] == pytest.approx(1.7, rel=0.15)
    assert found.rho[0] == pytest.approx(0.8, abs=0.08)


def test_white_noise_is_called_white() -> None:
    rng = np.random.default_rng(3)
    c = chain(144, runs=6)
    x = rng.normal(size=(len(c.row), 20))
    found = estimate(c, WHITE, np.ones(len(c.row)), x, rng.normal(size=len(c.row)), np.ones(20))
    assert found.rho[0] < 0.15
    assert found.scale[0] == pytest.approx(1.0, abs=0.1)


def test_rows_far_off_hardly_count_and_others_do() -> None:
    rng = np.random.default_rng(4)
    c = chain(144)
    residual = rng.normal(size=len(c.row))
    off = rng.choice(144, 14, replace=False)
    residual[np.isin(c.row, off)] += 30.0
    weight = row_weights(c, WHITE, residual)
    assert set(np.flatnonzero(outliers(c, weight, 144))) == set(off)
    assert np.median(weight) > 0.95
    assert np.all(weight[np.isin(c.row, off)] * residual[np.isin(c.row, off)] ** 2 < 10.0)


def test_where_all_rows_are_off_none_is_an_outlier() -> None:
    c = chain(144)
    residual = 50.0 * np.random.default_rng(5).normal(size=len(c.row))
    assert not outliers(c, row_weights(c, WHITE, residual), 144).any()


def test_chains_follow_runs_and_time() -> None:
    robot = load_robot(COGIRO)
    data = measured(robot, points=4)
    problem = Problem(robot, data, Sigma(1e-3, 1e-3), np.ones(data.n_rows, dtype=bool))
    c = chain_of(problem)
    run = data.run_index[problem.row_of]
    linked = c.before >= 0
    assert linked.sum() == len(run) - 6 * len(data.runs)
    assert np.all(run[linked] == run[c.before[linked]])
    assert np.all(problem.column_of[linked] == problem.column_of[c.before[linked]])
    assert np.all(c.row[linked] == c.row[c.before[linked]] + 1)
    assert np.median(c.gap[linked]) == 1.0


def test_each_outlier_has_prior_odds_of_one_to_nineteen() -> None:
    """Of one kind in one row, however many of its readings are off."""
    c = chain(8)
    weight = np.ones(len(c.row))
    assert log_chance_of_outliers(c, weight) == 0.0
    weight[np.isin(c.row, [2, 5])] = 0.01
    assert log_chance_of_outliers(c, weight) == pytest.approx(-2.0 * np.log(19.0))


@pytest.mark.parametrize("channels", [1, 3])
def test_the_size_of_the_bulk_is_that_of_its_median(channels: int) -> None:
    """In units of it, a row is as likely an outlier as 10 and 1 times the noise explain it."""
    c = chain(400, channels)
    rows = np.unique(c.row)
    residual = 7.0 * np.random.default_rng(5).standard_normal(len(c.row))
    weight = row_weights(c, WHITE, residual)
    power = np.array([np.sum(residual[c.row == row] ** 2) for row in rows])
    power = power / np.median(power) * stats.chi2.median(channels)
    odds = 0.05 / 0.95 * 10.0**-channels * np.exp(0.5 * 0.99 * power)
    off = odds / (1.0 + odds)
    expected = 1.0 - off + off * np.minimum(0.01, channels / power)
    first = [weight[np.flatnonzero(c.row == row)[0]] for row in rows]
    assert first == pytest.approx(expected, rel=1e-9)
