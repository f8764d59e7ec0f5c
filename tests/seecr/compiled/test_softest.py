"""The compiled smallest eigenvalue and its direction against LAPACK's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.linalg import eigh

from seecr.compiled.algebra import softest_batch, softest_motions
from seecr.pose import Array

# Parts of the largest entry: a few roundings of six unknowns. LAPACK leaves a quarter of that.
_VALUE, _RESIDUAL = 1e-14, 4e-14


def softest(matrices: Array) -> tuple[Array, Array]:
    values, directions = np.empty(len(matrices)), np.empty(matrices.shape[:2])
    softest_batch(matrices, values, directions)
    return values, directions


def turned(spectrum: Array, n: int = 500) -> Array:
    """Symmetric matrices (n, d, d) of given eigenvalues in random frames."""
    random = np.random.default_rng(len(spectrum))
    frames = np.linalg.qr(random.normal(size=(n, len(spectrum), len(spectrum))))[0]
    out = frames * spectrum @ frames.swapaxes(1, 2)
    return 0.5 * (out + out.swapaxes(1, 2))


def families(d: int) -> Iterator[Array]:
    """Definite and not, badly scaled, of whole numbers, with zeros, repeated and of all sizes."""
    random = np.random.default_rng(d)
    half, scale = random.normal(size=(3000, d, d)), 10.0 ** random.uniform(-12.0, 12.0, (3000, d))
    for dense in (half @ half.swapaxes(1, 2), half + half.swapaxes(1, 2)):
        yield from (dense, dense * scale[:, :, None] * scale[:, None])
    whole = random.integers(-1, 2, (3000, d, d)).astype(float)
    for one in (whole, np.where(random.random((3000, d, d)) < 0.2, whole, 0.0)):
        yield one + one.swapaxes(1, 2)
    yield np.stack([np.eye(d), -np.eye(d), np.ones((d, d)), -np.ones((d, d)), np.zeros((d, d))])
    steps, sizes = np.arange(d, dtype=float), 10.0 ** -np.arange(0.0, 3.0 * d, 3.0)
    for near in (near * steps for near in (0.0, 1e-15, 1e-12, 1e-8, 1e-4)):
        yield from (turned(1.0 + near), turned(-1.0 + near))
        yield turned(np.where(steps < d // 2, near, 1.0))
        yield turned(np.where(steps < d // 2, 1.0 + near, -1.0))
    for spectrum in (sizes, -sizes, np.where(steps % 2, sizes, -sizes)):
        yield from (times * turned(spectrum) for times in (1.0, 1e150, 1e-150))


@pytest.mark.parametrize("d", [1, 2, 3, 6, 9])
def test_eigenvalues_are_lapacks_and_directions_have_them(d: int) -> None:
    """Of repeated eigenvalues any direction will do."""
    for matrices in families(d):
        matrices = np.array(matrices, order="C")
        values, directions = softest(matrices)
        top = np.abs(matrices).max(axis=(1, 2))
        expected = np.linalg.eigvalsh(matrices)[:, 0]
        assert np.all(np.abs(values - expected) <= _VALUE * top)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-14)
        left = np.einsum("nij,nj->ni", matrices, directions) - values[:, None] * directions
        assert np.all(np.abs(left).max(axis=1) <= _RESIDUAL * top)
        largest = np.abs(directions).max(axis=1)
        assert np.all(directions.max(axis=1) >= (1.0 - 2e-6) * largest)


def test_only_the_lower_triangle_is_read() -> None:
    matrix = turned(np.arange(6.0), 1)
    half = np.tril(matrix) + np.triu(np.full((6, 6), np.nan), 1)
    for found, expected in zip(softest(half), softest(matrix), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_what_is_no_number_has_no_direction() -> None:
    for bad in (np.nan, np.inf, -np.inf):
        matrices = np.tile(np.eye(3), (2, 1, 1))
        matrices[0, 2, 1] = bad
        values, directions = softest(matrices)
        assert np.isnan(values[0]) and np.isnan(directions[0]).all()
        assert values[1] == pytest.approx(1.0, abs=_VALUE)


def test_the_sign_is_that_of_the_largest_part() -> None:
    direction = np.array([0.1, -0.2, 0.3, -0.9, 0.1, 0.2])
    direction /= np.linalg.norm(direction)
    matrices = 2.0 * np.eye(6) - np.outer(direction, direction)
    found = softest(np.array([matrices]))[1][0]
    np.testing.assert_allclose(found, -direction, atol=1e-14)
    level = np.full((1, 2, 2), [[1.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(softest(level)[1][0], [np.sqrt(0.5), -np.sqrt(0.5)], atol=1e-15)


@pytest.mark.parametrize("d", [1, 2, 3, 5, 6])
def test_on_joints_it_is_the_generalised_problem_of_the_platforms_motions(d: int) -> None:
    random = np.random.default_rng(10 + d)
    half, mix = random.normal(size=(200, d, d)), np.eye(d) + 0.2 * random.normal(size=(200, d, d))
    columns = mix @ np.linalg.qr(random.normal(size=(200, 6, 6)))[0][:, :d]
    matrices = half + half.swapaxes(1, 2)
    values, motions = np.empty(200), np.empty((200, 6))
    softest_motions(matrices, columns, values, motions)
    for matrix, column, value, motion in zip(matrices, columns, values, motions, strict=True):
        expected, vectors = eigh(matrix, column @ column.T)
        assert value == pytest.approx(expected[0], rel=1e-8, abs=1e-10)
        np.testing.assert_allclose(np.abs(motion), np.abs(vectors[:, 0] @ column), atol=1e-6)
        assert np.linalg.norm(motion) == pytest.approx(1.0)
        assert motion.max() >= np.abs(motion).max() * (1.0 - 2e-6)


def test_on_joints_not_a_number_is_none() -> None:
    values, motions = np.empty(2), np.empty((2, 6))
    columns = np.tile(np.eye(6)[:3], (2, 1, 1))
    matrices = np.tile(np.eye(3), (2, 1, 1))
    columns[0, 0, 0] = matrices[1, 2, 2] = np.nan
    softest_motions(matrices, columns, values, motions)
    assert np.isnan(values).all() and np.isnan(motions).all()
