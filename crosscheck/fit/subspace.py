"""Subspaces that columns of derivatives span."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seecr.pose import Array


def projected(columns: Array, base: Array) -> Array:
    """What is left of ``columns`` beside those of ``base``."""
    u = basis(base)
    return columns - u @ (u.T @ columns)


def basis(columns: Array) -> Array:
    """Orthonormal basis of what columns span.

    By pivoted QR of columns of unit length: a singular value decomposition takes half as long
    again, and this is done thousands of times.
    """
    norm = np.linalg.norm(columns, axis=0)
    some = columns[:, norm > 0.0] / norm[norm > 0.0]
    if some.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _order = linalg.qr(some, mode="economic", pivoting=True, check_finite=False)
    rank = int(np.sum(np.abs(np.diag(r)) > 1e-9))
    return np.asarray(q[:, :rank], float)
