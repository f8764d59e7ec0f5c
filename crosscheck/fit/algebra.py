"""Linear algebra of fits: smooth functions, what columns span, matrices that rounding damaged.

With whitened derivatives G (N, p) of an effect and H of others, the squared signal of G that H
cannot imitate is |G - H H^+ G|^2, in units of the noise. About fifteen tell two effects apart.

Some effects move the readings by millions of their noise. X^T X + W^-2 is positive definite, but if
such columns are nearly parallel, rounding errors exceed its smallest eigenvalues. The matrix is
scaled to a unit diagonal, and the smallest ridge that makes it positive definite is added.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from seecr.pose import Array

# Places from which a process at more places is interpolated.
_CENTRES = 300


def monomials(place: Array, degree: int = 3, smooth: float = 1.0) -> Array:
    """(n, k) monomials of places (n, d), each axis that moves scaled to [-1, 1].

    Each degree is ``smooth`` times as large as the one before.
    """
    unit = _unit(place)
    columns = [np.ones(len(place))]
    for power in range(1, degree + 1):
        for axes in combinations_with_replacement(range(unit.shape[1]), power):
            columns.append(smooth**power * np.prod(unit[:, axes], axis=1))
    return np.stack(columns, axis=1)


def waves(place: Array, length: float) -> Array:
    """(n, k) shapes of a function of places (n, d) that has forgotten itself after some distance.

    Their sum with coefficients c ~ N(0, 1) is a Gaussian process with the covariance
    exp(-d^2/(2 length^2)), but for a hundredth of its variance; half of each axis' range is 1
    (Rasmussen and Williams 2006, 4.1; Nystrom's method, 8.1, for many places).
    """
    unit = _unit(place)
    some = unit[np.unique(np.linspace(0, len(unit) - 1, min(len(unit), _CENTRES)).astype(int))]
    power, axes = np.linalg.eigh(_alike(some, some, length))
    power, axes = power[::-1], axes[:, ::-1]
    count = int(np.searchsorted(np.cumsum(power), 0.99 * power.sum())) + 1
    return np.asarray(_alike(unit, some, length) @ axes[:, :count] / np.sqrt(power[:count]))


def _alike(a: Array, b: Array, length: float) -> Array:
    square = np.sum((a[:, None] - b[None]) ** 2, axis=-1)
    return np.asarray(np.exp(-0.5 * square / length**2))


def _unit(place: Array) -> Array:
    """(n, d) places, each axis scaled to [-1, 1], without axes along which nothing moves."""
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    half = 0.5 * np.ptp(place, axis=0)
    moves: NDArray[np.bool_] = half > 1e-3 * max(float(half.max()), 1e-300)
    return np.asarray(((place - middle) / np.where(moves, half, 1.0))[:, moves])


# A column of unit length adds no direction if no more than this is left beside earlier columns.
_NO_DIRECTION = 1e-9


def basis(columns: Array) -> Array:
    """Orthonormal basis (N, k) of the span of columns (N, p), by QR, as it is done often."""
    norm = np.linalg.norm(columns, axis=0)
    some = columns[:, norm > 0.0] / norm[norm > 0.0]
    if some.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _order = linalg.qr(some, mode="economic", pivoting=True, check_finite=False)
    rank = int(np.sum(np.abs(np.diag(r)) > _NO_DIRECTION))
    return np.asarray(q[:, :rank], float)


def beside(columns: Array, span: Array) -> Array:
    """The part of a signal (N,) or columns (N, p) that is orthogonal to a basis (N, k)."""
    return columns - span @ (span.T @ columns)


def left_over(signal: Array, span: Array) -> float:
    """Squared signal that the basis ``span`` cannot imitate, in units of the noise."""
    return float(np.sum(beside(signal, span) ** 2))


def imitated(signal: Array, span: Array) -> float:
    """Fraction of a signal's power that the basis ``span`` can imitate, 0 to 1."""
    power = float(np.sum(signal**2))
    return float(np.clip(1.0 - left_over(signal, span) / power, 0.0, 1.0)) if power > 0 else 0.0


# Ridges to try, one after the other, on a diagonal of ones.
_RIDGES = (0.0, 1e-14, 1e-11, 1e-8)
# Rounding does no harm while squares stay below this size, beside prior precisions of about one.
_USUAL = 1e9
# Relative rounding error of a sum of squares, with a margin.
_ROUNDING = 1e-13


def root_of(matrix: Array) -> Array:
    """Lower Cholesky factor of a matrix (k, k) that is definite but for rounding."""
    if not np.all(np.isfinite(matrix)):
        raise np.linalg.LinAlgError("not a matrix of numbers")
    size = np.sqrt(np.diag(matrix))
    even, one = matrix / np.outer(size, size), np.eye(len(matrix))
    for ridge in _RIDGES[:-1]:
        try:
            return np.asarray(size[:, None] * np.linalg.cholesky(even + ridge * one))
        except np.linalg.LinAlgError:
            continue
    return np.asarray(size[:, None] * np.linalg.cholesky(even + _RIDGES[-1] * one))


def root_beside_one(columns: Array) -> Array:
    """Lower triangular L (p, p) with L L^T = 1 + X^T X, for columns X (N, p), exact to rounding."""
    normal, one = columns.T @ columns, np.eye(columns.shape[1])
    if np.max(np.diag(normal), initial=0.0) * _ROUNDING < 1.0:
        return np.asarray(linalg.cholesky(normal + one, lower=True, check_finite=False))
    # the rounding errors of the squares would exceed the one
    (upper,) = linalg.qr(np.concatenate([columns, one]), mode="r", check_finite=False)
    return np.asarray(upper[: len(one)].T)


def inverse_of(matrix: Array) -> Array:
    """The inverse of such a matrix (k, k); if its entries are large, by its Cholesky factor.

    The inverse is then definite itself, and no variance is negative.
    """
    if np.max(np.diag(matrix), initial=0.0) < _USUAL:
        return np.asarray(np.linalg.inv(matrix), float)
    half = linalg.solve_triangular(
        root_of(matrix), np.eye(len(matrix)), lower=True, check_finite=False
    )
    return np.asarray(half.T @ half)


def solved(matrix: Array, right: Array) -> Array:
    """The solution x (k,) of matrix x = right, for such a matrix (k, k)."""
    if np.max(np.diag(matrix), initial=0.0) < _USUAL:
        return np.asarray(np.linalg.solve(matrix, right), float)
    root = root_of(matrix)
    half = linalg.solve_triangular(root, right, lower=True, check_finite=False)
    return np.asarray(linalg.solve_triangular(root, half, lower=True, trans=1, check_finite=False))
