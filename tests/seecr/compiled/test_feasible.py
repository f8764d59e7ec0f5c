"""Whether tensions balance, and by how much they must exceed limits: against linear programs."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.compiled.tensions import feasible_of, innermost_of
from seecr.tensions.infeasible import _by_program, _least_beyond

LIMITS = [(0.0, np.inf), (0.2, np.inf), (0.2, 1.5)]


def some(freedoms: int, spare: int, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(10 * freedoms + spare)
    return rng.normal(size=(n, freedoms, freedoms + spare)), rng.normal(size=(n, freedoms))


def found(matrices: np.ndarray, loads: np.ndarray, low: float, high: float) -> np.ndarray:
    n, _d, m = matrices.shape
    ends, ones, out = (np.full((n, m), low), np.full((n, m), high)), np.ones(n), np.empty(n)
    feasible_of(matrices, loads, *ends, 1e-9 * ones, 1e-11 * ones, out)
    return out


@pytest.mark.parametrize("spare", [0, 1, 2])
@pytest.mark.parametrize(("low", "high"), LIMITS)
def test_tensions_are_found_where_their_margin_is_positive(
    spare: int, low: float, high: float
) -> None:
    matrices, loads = some(2, spare)
    n, _d, m = matrices.shape
    margins, tensions = np.empty(n), np.empty((n, m))
    ends = np.full((n, m), low), np.full((n, m), high)
    innermost_of(matrices, loads, *ends, np.ones(n), margins, tensions)
    held = found(matrices, loads, low, high) == 1.0
    np.testing.assert_array_equal(held, margins >= 0.0)
    assert 0 < held.sum() < n


def test_of_a_singular_matrix_nothing_is_said() -> None:
    matrices, loads = some(2, 2, 3)
    matrices[1, 1] = 2.0 * matrices[1, 0]
    assert np.isnan(found(matrices, loads, 0.0, np.inf)).tolist() == [False, True, False]


def test_limits_that_contradict_each_other_hold_nothing() -> None:
    matrices, loads = some(2, 2, 20)
    assert np.all(found(matrices, loads, 1.0, 0.5) == 0.0)


@pytest.mark.parametrize("spare", [0, 1, 2])
@pytest.mark.parametrize(("low", "high"), LIMITS)
def test_limits_are_exceeded_by_no_more_than_a_linear_program_says(
    spare: int, low: float, high: float
) -> None:
    matrices, loads = some(3, spare, 20)
    ends, sums = (np.full(3 + spare, low), np.full(3 + spare, high)), []
    for matrix, load in zip(matrices, loads, strict=True):
        ours, theirs = (way(matrix, load, *ends, 1.0)[1] for way in (_least_beyond, _by_program))
        sums.append((np.abs(ours).sum(), np.abs(theirs).sum()))
    mine, programs = np.array(sums).T
    assert mine == pytest.approx(programs, rel=1e-7, abs=1e-9)
    assert programs.max() > 0.1
