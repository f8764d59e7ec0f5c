"""Linear algebra for normal matrices that rounding has made indefinite.

Some effects move the readings by millions of their noise. X^T X + W^-2 is positive definite, but if
such columns are nearly parallel, rounding errors exceed its smallest eigenvalues. The matrix is
scaled to a unit diagonal, and the smallest ridge that makes it positive definite is added.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seecr.pose import Array

# Ridges to try, one after the other, on a diagonal of ones.
_RIDGES = (0.0, 1e-14, 1e-11, 1e-8)
# Rounding does no harm while squares stay below this size, beside prior precisions of about one.
_USUAL = 1e9
# Relative rounding error of a sum of squares, with a margin.
_ROUNDING = 1e-13


def root_of(matrix: Array) -> Array:
    """Lower Cholesky factor of a matrix (k, k) that is positive definite but for rounding.

    Raises:
        LinAlgError: the matrix is not positive definite with any ridge, or is not finite.
    """
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
