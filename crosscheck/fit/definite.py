"""Normal matrices of effects that move the readings by millions of their noise: still definite.

X^T X + W^-2 is positive definite, but where columns are large and alike rounding makes it anything.
Brought to a unit diagonal, it is made definite by the least ridge that does.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seecr.pose import Array

# Tried one after the other on the diagonal, which is one.
_RIDGES = (0.0, 1e-14, 1e-11, 1e-8)
# Up to squares of this size, beside prior precisions about one, rounding does no harm.
_USUAL = 1e9
# What rounding leaves of a sum of squares, and some.
_ROUNDING = 1e-13


def root_of(matrix: Array) -> Array:
    """Lower triangular L with L L^T = matrix, positive definite (k, k) but for rounding.

    Raises:
        LinAlgError: it is not, or has numbers that are none.
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
    """Lower triangular L (p, p) with L L^T = 1 + X^T X, of columns X (N, p): exact to rounding."""
    normal, one = columns.T @ columns, np.eye(columns.shape[1])
    if np.max(np.diag(normal), initial=0.0) * _ROUNDING < 1.0:
        return np.asarray(linalg.cholesky(normal + one, lower=True, check_finite=False))
    # rounding of the squares would swallow the one
    (upper,) = linalg.qr(np.concatenate([columns, one]), mode="r", check_finite=False)
    return np.asarray(upper[: len(one)].T)


def inverse_of(matrix: Array) -> Array:
    """The inverse of such a matrix (k, k), itself definite: no variance is negative."""
    if np.max(np.diag(matrix), initial=0.0) < _USUAL:
        return np.asarray(np.linalg.inv(matrix), float)
    half = linalg.solve_triangular(
        root_of(matrix), np.eye(len(matrix)), lower=True, check_finite=False
    )
    return np.asarray(half.T @ half)


def roots_of(matrices: Array) -> Array:
    """The roots of many such matrices (n, k, k)."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), float)
    except np.linalg.LinAlgError:
        return np.stack([root_of(one) for one in matrices])


def solved(matrix: Array, right: Array) -> Array:
    """The solution (k,) of such a matrix with a right side (k,)."""
    if np.max(np.diag(matrix), initial=0.0) < _USUAL:
        return np.asarray(np.linalg.solve(matrix, right), float)
    root = root_of(matrix)
    half = linalg.solve_triangular(root, right, lower=True, check_finite=False)
    return np.asarray(linalg.solve_triangular(root, half, lower=True, trans=1, check_finite=False))
