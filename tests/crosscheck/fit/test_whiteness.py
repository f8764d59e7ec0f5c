"""Is what is left noise? Under true noise the tests' chances are what they say."""

from __future__ import annotations

import numpy as np
import pytest
from box_of_poses import box_of_poses
from scipy import stats

from crosscheck.fit.problem import Problem
from crosscheck.fit.residual_noise import STRUCTURED, agreement, best_of, whiteness
from seecr.pose import Array

pytestmark = pytest.mark.slow

SEEDS = 600


@pytest.fixture(scope="module")
def problem() -> Problem:
    return box_of_poses()


def noise(problem: Problem, seed: int) -> Array:
    return np.random.default_rng(seed).standard_normal(problem.n_readings)


def test_the_chance_of_its_size_is_uniform_under_noise(problem: Problem) -> None:
    found = [whiteness(problem, noise(problem, k), 0) for k in range(SEEDS)]
    assert stats.kstest([w.p for w in found], "uniform").pvalue > 0.01
    assert np.mean([w.scale for w in found]) == pytest.approx(1.0, abs=0.01)


def test_fitted_directions_are_taken_off(problem: Problem) -> None:
    rng = np.random.default_rng(0)
    span = np.linalg.qr(rng.standard_normal((problem.n_readings, 40)))[0]
    chances = []
    for k in range(SEEDS):
        white = noise(problem, k)
        chances.append(whiteness(problem, white - span @ (span.T @ white), 40).p)
    assert stats.kstest(chances, "uniform").pvalue > 0.01


@pytest.mark.parametrize("pairs", ["next", "far"])
def test_agreement_of_one_channel_is_that_of_noise(pairs: str) -> None:
    """Standard errors whose chances are uniform, where rows do not know each other."""
    rng = np.random.default_rng(2)
    index = np.arange(399)
    chosen = np.stack([index, index + 1 if pairs == "next" else 399 - index], axis=1)
    chosen = chosen[chosen[:, 0] < chosen[:, 1]]
    chances = []
    for _ in range(SEEDS):
        errors = agreement(rng.standard_normal((400, 1)), chosen)[1]
        chances.append(float(stats.norm.sf(errors)))
    # where rows agree less than by chance it says none: half of all
    low = np.array([p for p in chances if p < 0.5])
    assert len(low) / SEEDS == pytest.approx(0.5, abs=0.07)
    assert stats.kstest(2.0 * low, "uniform").pvalue > 0.01


@pytest.mark.parametrize("channels", [1, 6, 14])
def test_many_channels_give_no_more_false_alarms_than_one(channels: int) -> None:
    """The best of many is large by chance: that is taken off."""
    rng = np.random.default_rng(3)
    pairs = np.stack([np.arange(199), np.arange(1, 200)], axis=1)
    errors = [agreement(rng.standard_normal((200, channels)), pairs)[1] for _ in range(2000)]
    limit = float(stats.norm.isf(0.02))
    assert np.mean(np.array(errors) > limit) < 0.03


def test_the_best_of_many_is_as_likely_as_one_of_its_errors() -> None:
    assert best_of(3.0, 1) == pytest.approx(3.0)
    rng = np.random.default_rng(4)
    best = rng.standard_normal((4000, 7)).max(axis=1)
    single = [stats.norm.sf(best_of(float(errors), 7)) for errors in best]
    assert stats.kstest(single, "uniform").pvalue > 0.01
    for errors, tests in ((4.0, 15), (6.0, 7), (60.0, 9)):
        chance = stats.norm.logsf(best_of(errors, tests))
        assert chance == pytest.approx(stats.norm.logsf(errors) + np.log(tests), rel=1e-4)
    assert best_of(5.0 - 1e-12, 9) == pytest.approx(best_of(5.0, 9), abs=1e-6)


def test_structure_in_one_channel_does_not_drown_in_the_others(problem: Problem) -> None:
    table = noise(problem, 1).reshape(problem.data.n_rows, 6)
    wave = np.sin(np.arange(len(table)) / 4.0)
    table[:, 2] += 2.0 * wave
    found = whiteness(problem, table.ravel(), 0)
    assert found.structured and found.lag_errors > STRUCTURED
    table[:, 2] = noise(problem, 2)[: len(table)]
    assert not whiteness(problem, table.ravel(), 0).structured


def test_too_few_pairs_say_nothing() -> None:
    table = np.ones((6, 2))
    assert agreement(table, np.zeros((0, 2), dtype=int)) == (0.0, 0.0)
    assert agreement(table[:, :1], np.array([[0, 1], [2, 3]])) == (0.0, 0.0)
