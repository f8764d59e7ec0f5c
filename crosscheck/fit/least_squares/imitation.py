"""What one effect can imitate of another, by the subspaces that their derivatives span.

With whitened derivatives G (N, p) of an effect and H of others, the squared signal of G that H
cannot imitate is |G - H H^+ G|^2, in units of the noise. About fifteen tell two effects apart.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seecr.pose import Array

# A column of unit length adds no direction if no more than this is left beside earlier columns.
_NO_DIRECTION = 1e-9


def basis(columns: Array) -> Array:
    """Orthonormal basis (N, k) of the span of columns (N, p).

    This uses a pivoted QR factorisation of columns of unit length, because it is done thousands of
    times and a singular value decomposition takes half as long again.
    """
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
