"""What one effect can imitate of another: subspaces that columns of derivatives span.

With whitened columns G of an effect (N, p) and H of others, the squared signal of G that H cannot
imitate is |G - H H^+ G|^2, in units of the noise; about fifteen tell two effects apart.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seecr.pose import Array

# A column this much shorter than its own length beside those before it adds no direction.
_NO_DIRECTION = 1e-9


def basis(columns: Array) -> Array:
    """Orthonormal basis (N, k) of what columns (N, p) span.

    By pivoted QR of columns of unit length: a singular value decomposition takes half as long
    again, and this is done thousands of times.
    """
    norm = np.linalg.norm(columns, axis=0)
    some = columns[:, norm > 0.0] / norm[norm > 0.0]
    if some.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _order = linalg.qr(some, mode="economic", pivoting=True, check_finite=False)
    rank = int(np.sum(np.abs(np.diag(r)) > _NO_DIRECTION))
    return np.asarray(q[:, :rank], float)


def beside(columns: Array, span: Array) -> Array:
    """What is left of a signal (N,) or columns (N, p) beside an orthonormal basis (N, k)."""
    return columns - span @ (span.T @ columns)


def left_over(signal: Array, span: Array) -> float:
    """Squared signal that what spans ``span`` cannot imitate, in units of the noise."""
    return float(np.sum(beside(signal, span) ** 2))


def imitated(signal: Array, span: Array) -> float:
    """Part of a signal's power that what spans ``span`` can imitate, 0 to 1."""
    power = float(np.sum(signal**2))
    return float(np.clip(1.0 - left_over(signal, span) / power, 0.0, 1.0)) if power > 0 else 0.0
