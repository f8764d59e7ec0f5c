"""The noise: whitening, the estimate of its size and correlation, rows far off, its prior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, measured
from noise_covariance import covariance
from scipy import integrate

from crosscheck.fit.problem import Problem
from crosscheck.inference.noise import (
    STATED_NOISE,
    Chain,
    Noise,
    NoisePrior,
    chain_of,
    estimate,
    log_det,
    mixture,
    outliers,
    whitened,
)
from crosscheck.inference.priors import FAR, OUTLIERS
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot

ROBOT = load_robot(COGIRO)
NOISE = Noise(np.array([1.7, 1.0, 1.0]), np.array([0.8, 0.0, 0.0]))


def chain(rows: int, channels: int = 3, runs: int = 2) -> Chain:
    """Readings of one kind in order of rows, cut into runs."""
    row = np.repeat(np.arange(rows), channels)
    before = np.arange(rows * channels) - channels
    fresh = row % (rows // runs) == 0
    return Chain(np.zeros(len(row), int), row, np.where(fresh, -1, before), np.ones(len(row)))


def test_whitening_is_an_inverse_root_of_the_noise() -> None:
    """Also where rows are missing: the gaps then differ."""
    random, c = np.random.default_rng(0), chain(8)
    c = replace(c, gap=random.integers(1, 4, len(c.row)).astype(float))
    weight = random.uniform(0.1, 1.0, len(c.row))
    root = whitened(c, NOISE, weight, np.eye(len(c.row)))
    assert root @ covariance(c, NOISE, weight) @ root.T == pytest.approx(np.eye(24), abs=1e-12)
    whole = covariance(c, NOISE, np.ones(24))
    assert log_det(c, NOISE) == pytest.approx(np.linalg.slogdet(whole)[1])


@pytest.mark.parametrize("rho", [0.1, 0.5, 0.9])
def test_the_estimate_is_where_the_marginal_likelihood_is_largest(rho: float) -> None:
    """Of y ~ N(0, X W^2 X^T + Sigma), computed from the whole covariance."""
    random, one = np.random.default_rng(5), chain(60)
    n = len(one.row)
    c = replace(one, kind=np.where(np.arange(n) % 3 == 2, 2, 0), gap=random.uniform(0.5, 3.0, n))
    true = Noise(np.array([1.7, 1.0, 0.6]), np.array([rho, 0.0, 0.5]))
    x, width = random.normal(size=(n, 7)) * 10.0 ** np.arange(-2, 5), np.geomspace(0.1, 5.0, 7)
    weight = random.uniform(0.1, 1.0, n)
    y = np.linalg.cholesky(covariance(c, true, weight)) @ random.standard_normal(n)
    y = y + x @ (width * random.standard_normal(7))
    found = estimate(c, STATED_NOISE, weight, x, y, width)

    def likelihood(noise: Noise) -> float:
        whole = (x * width**2) @ x.T + covariance(c, noise, weight)
        return float(-0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1]))

    best = likelihood(found)
    assert best > likelihood(true) - 1e-3
    for kind in (0, 2):
        for by in (-0.1, 0.1):
            scale, alike = found.scale.copy(), found.rho.copy()
            scale[kind] *= np.exp(by)
            alike[kind] = np.clip(alike[kind] + by, 0.0, 0.97)
            assert likelihood(Noise(scale, found.rho)) < best
            assert likelihood(Noise(found.scale, alike)) < best + 1e-3
    assert found.scale[1] == 1.0, "nothing of that kind was read"


def test_size_and_correlation_are_found_though_half_the_readings_are_fitted_away() -> None:
    random, c = np.random.default_rng(2), chain(144, runs=6)
    n = len(c.row)
    noise = np.linalg.cholesky(covariance(c, NOISE, np.ones(n))) @ random.normal(size=n)
    x = 30 * random.normal(size=(n, 60))
    y = x @ random.normal(size=60) + noise
    found = estimate(c, STATED_NOISE, np.ones(n), x, y, np.ones(60))
    assert found.scale[0] == pytest.approx(1.7, rel=0.15)
    assert found.rho[0] == pytest.approx(0.8, abs=0.08)


def test_rows_far_off_hardly_count_and_others_do() -> None:
    random, c = np.random.default_rng(4), chain(144)
    residual = random.normal(size=len(c.row))
    off = random.choice(144, 7, replace=False)
    residual[np.isin(c.row, off)] += 60.0
    weight, _added = mixture(c, STATED_NOISE, residual)
    assert set(np.flatnonzero(outliers(c, weight, 144))) == set(off)
    assert np.median(weight) > 0.95


def test_where_all_rows_are_off_none_is_an_outlier() -> None:
    c = chain(144)
    residual = 50.0 * np.random.default_rng(5).normal(size=len(c.row))
    assert not outliers(c, mixture(c, STATED_NOISE, residual)[0], 144).any()


@pytest.mark.parametrize("size", [0.5, 3.0, 40.0])
def test_weights_and_what_they_add_bound_the_mixture_likelihood(size: float) -> None:
    """sum_s p_s N(r; 0, s^2), of a row far off among quiet ones."""
    c = chain(41, 2, 1)
    residual = np.full(82, 0.7)
    residual[:2] = size
    weight, added = mixture(c, STATED_NOISE, residual)
    bound = added - 0.5 * float(np.sum(weight * residual**2))
    each = np.array([residual[2 * k] ** 2 + residual[2 * k + 1] ** 2 for k in range(41)])
    sizes = np.array(FAR)
    exact = np.log(np.exp(-0.5 * each[:, None] / sizes**2) / sizes**2 @ np.array(OUTLIERS))
    assert bound <= exact.sum() + 1e-9
    assert bound == pytest.approx(exact.sum(), abs=1e-6)


def test_chains_follow_runs_and_time() -> None:
    data = measured(ROBOT, points=4)
    problem = Problem(ROBOT, data, Sigma(1e-3, 1e-3), np.ones(data.n_rows, dtype=bool))
    c = chain_of(problem)
    run = data.run_index[problem.row_of]
    linked = c.before >= 0
    assert linked.sum() == len(run) - 6 * len(data.runs)
    assert np.all(run[linked] == run[c.before[linked]])
    assert np.all(problem.column_of[linked] == problem.column_of[c.before[linked]])
    assert np.median(c.gap[linked]) == 1.0


def prior_of(source: str, sigma: Sigma) -> NoisePrior:
    data = replace(measured(ROBOT, points=3), sigma=sigma, sigma_source=source)
    return NoisePrior.of(Problem(ROBOT, data, Sigma(1e-3, 1e-3), np.ones(data.n_rows, dtype=bool)))


@pytest.mark.parametrize("source", ["stated", "dwell_scatter", "revisited"])
def test_the_prior_of_the_size_is_a_density(source: str) -> None:
    prior = prior_of(source, Sigma(position_m=1e-3, orientation_rad=1e-3))

    def density(log_size: float) -> float:
        size = float(np.exp(log_size))
        # linear in the correlation, so that its value in the middle is its integral
        alike = np.array([0.5, 0.0, 0.0])
        return float(np.exp(prior.log(Noise(np.array([size, 1.0, 1.0]), alike))))

    total, _ = integrate.quad(density, -30.0, 30.0, limit=400, points=[0.0])
    # of two kinds, of which the other one has the stated size
    other = np.exp(0.5 * prior.log(STATED_NOISE))
    assert total == pytest.approx(np.sqrt(2.0 * np.pi) * other, rel=1e-6)


def test_scatter_within_dwells_is_a_lower_bound() -> None:
    """Noise three times as large is no surprise there, and half as large is as elsewhere."""

    def of(source: str, size: float) -> float:
        prior = prior_of(source, Sigma(position_m=1e-3, orientation_rad=1e-3))
        noise = Noise(np.array([size, 1.0, 1.0]), np.zeros(3))
        return prior.log(noise) - prior.log(STATED_NOISE)

    assert of("dwell_scatter", 3.0) > of("stated", 3.0) + 1.0
    assert of("revisited", 3.0) == of("stated", 3.0)
    assert of("stated", 1.4) > of("stated", 3.0) > of("stated", 8.0)


def test_only_a_statement_can_be_misjudged() -> None:
    noise = Noise(np.array([6.0, 1.0, 1.0]), np.zeros(3))
    assert prior_of("stated", Sigma(1e-3, 1e-3)).misjudged(noise)[0] > 0.9
    assert not prior_of("stated", Sigma()).misjudged(noise).any()
    assert not prior_of("dwell_scatter", Sigma(1e-3, 1e-3)).misjudged(noise).any()


@pytest.mark.parametrize(("size", "rho"), [(3.5, 0.0), (3.5, 0.85), (30.0, 0.0), (30.0, 0.2)])
def test_noise_of_several_times_its_stated_size_is_no_unknown_effect(
    size: float, rho: float
) -> None:
    prior = prior_of("stated", Sigma(1e-3, 1e-3))
    large = Noise(np.array([size, 1.0, 1.0]), np.array([rho, 0.0, 0.0]))
    assert prior.is_unknown(large) < 0.05


def test_what_is_beyond_any_noise_is_unknown() -> None:
    prior = prior_of("stated", Sigma(1e-3, 1e-3))
    beyond = Noise(np.array([30.0, 1.0, 1.0]), np.array([0.5, 0.0, 0.0]))
    slow = Noise(np.array([3.5, 1.0, 1.0]), np.array([0.96, 0.0, 0.0]))
    assert prior.is_unknown(beyond) > 0.95 and prior.is_unknown(slow) > 0.5
