"""Rows far off the others: how much each counts in a fit.

The residuals of one kind in one row are noise of the usual size, or, with a chance of one in
twenty, of ten times that (a reflection of the laser, a cell that was knocked). A row counts by
the chance that it is of the usual kind; what is far off counts as if it were noise of that size.
Where more than one row in ten sticks out, the bulk is the measure: most rows are never outliers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crosscheck.calibration.colour import Chain, Colour
from crosscheck.fit.problem import KINDS
from seecr.pose import Array

_CHANCE = 0.05
LARGER = 10.0
"""How many times as large as the noise outliers are."""
# A row of which less than this counts is called an outlier.
OUTLIER = 0.05


def row_weights(chain: Chain, colour: Colour, residual: Array) -> Array:
    """(N,) how much each reading counts.

    Args:
        chain: which readings belong to one row and kind.
        colour: size of the noise.
        residual: (N,) in units of the stated noise.
    """
    weight = np.ones(len(residual))
    for k in range(len(KINDS)):
        mine = np.flatnonzero(chain.kind == k)
        if len(mine):
            weight[mine] = _weights(chain.row[mine], residual[mine], float(colour.scale[k]))
    return weight


def _weights(row: NDArray[np.int64], residual: Array, scale: float) -> Array:
    rows, group, count = np.unique(row, return_inverse=True, return_counts=True)
    power: Array = np.bincount(group, residual**2, minlength=len(rows)).astype(float)
    # a fit may not be done yet: the size of the bulk, where that is larger than the noise
    bulk = np.sqrt(np.median(power / stats.chi2.median(count)))
    power = power / max(scale, float(bulk)) ** 2
    odds = np.log(_CHANCE / (1.0 - _CHANCE)) - count * np.log(LARGER)
    odds = odds + 0.5 * power * (1.0 - LARGER**-2)
    off = 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))
    least = np.minimum(LARGER**-2, count / np.maximum(power, 1e-300))
    return np.asarray((1.0 - off + off * least)[group])


def outliers(chain: Chain, weight: Array, n_rows: int) -> NDArray[np.bool_]:
    """(n,) bool rows of which some kind of reading hardly counts."""
    least = np.ones(n_rows)
    np.minimum.at(least, chain.row, weight)
    return np.asarray(least < OUTLIER)
