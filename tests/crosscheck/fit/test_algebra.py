"""Matrices that rounding made indefinite: roots and inverses stay numbers."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.fit.algebra import (
    inverse_of,
    root_beside_one,
    root_of,
    solved,
    waves,
)


def columns(size: float, apart: float, count: int = 40) -> np.ndarray:
    """Four columns of a size, the last one the first but for a part of it."""
    x = np.random.default_rng(0).standard_normal((count, 4))
    x[:, 3] = x[:, 0] + apart * x[:, 3]
    return np.asarray(size * x)


def normal(x: np.ndarray) -> np.ndarray:
    return np.asarray(x.T @ x + np.eye(x.shape[1]))


def test_of_a_definite_matrix_they_are_the_usual_ones() -> None:
    matrix = normal(columns(30.0, 0.1))
    assert root_of(matrix) == pytest.approx(np.linalg.cholesky(matrix), rel=1e-12, abs=1e-12)
    assert inverse_of(matrix) @ matrix == pytest.approx(np.eye(4), abs=1e-9)


@pytest.mark.parametrize("size", [1e9, 1e12, 1e150])
def test_columns_alike_and_millions_of_their_noise_have_an_inverse(size: float) -> None:
    matrix = normal(columns(size, 1e-9))
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(matrix - 1e-15 * np.diag(np.diag(matrix)))
    variance = np.diag(inverse_of(matrix))
    assert np.all(variance > 0.0) and np.all(np.isfinite(variance))
    # what the other columns do not share is known as well as ever
    assert variance[1] == pytest.approx(1.0 / (size**2 * 40), rel=0.5)


def test_what_is_not_definite_at_all_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        root_of(np.array([[1.0, 2.0], [2.0, 1.0]]))
    with pytest.raises(np.linalg.LinAlgError):
        root_of(np.array([[1.0, np.nan], [np.nan, 1.0]]))


def test_solutions_are_numbers_too() -> None:
    good, bad = normal(columns(30.0, 0.1)), normal(columns(1e12, 1e-9))
    right = np.array([1.0, -2.0, 0.5, 3.0])
    for matrix in (good, normal(columns(1e7, 0.5))):
        assert matrix @ solved(matrix, right) == pytest.approx(right, rel=1e-6)
    assert np.all(np.isfinite(solved(bad, right)))


def test_the_root_beside_one_is_exact_where_rounding_would_swallow_the_one() -> None:
    x = columns(30.0, 0.1)
    assert root_beside_one(x) == pytest.approx(np.linalg.cholesky(normal(x)), rel=1e-12, abs=1e-12)
    # the same column twice: what is left of their difference is the one
    x = columns(1e9, 0.0)
    root = np.abs(np.diag(root_beside_one(x)))
    assert np.prod(root[[0, 3]]) ** 2 == pytest.approx(2.0 * float(x[:, 0] @ x[:, 0]), rel=1e-6)
    assert root[3] == pytest.approx(np.sqrt(2.0), rel=1e-3)


@pytest.mark.parametrize("count", [120, 700])
def test_waves_are_those_of_a_process_that_forgets_itself(count: int) -> None:
    """Of all places or of some as centres; an axis that never moves is left out."""
    place = np.random.default_rng(3).uniform(-1.0, 1.0, (count, 3)) * [2.0, 0.5, 0.0] + 7.0
    shapes = waves(place, 0.3)
    half = 0.5 * np.ptp(place[:, :2], axis=0)
    apart = (place[:, None, :2] - place[None, :, :2]) / half
    wanted = np.exp(-np.sum(apart**2, axis=-1) / (2.0 * 0.3**2))
    off = np.abs(shapes @ shapes.T - wanted)
    assert np.quantile(off, 0.9999) < 0.06 and np.sqrt(np.mean(off**2)) < 0.01
    assert np.mean(np.sum(shapes**2, axis=1)) == pytest.approx(1.0, abs=0.015)
