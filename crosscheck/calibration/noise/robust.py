"""Weights of rows, which make a joint fit robust against outliers.

The residuals of one kind in one row are taken to be noise of the usual size or, with a prior
probability of one in twenty, ten times that (a reflection of the laser, a load cell that was
knocked). The weight of a row mixes those of both cases by their posterior probabilities. If the
median residual exceeds the noise, the median sets the usual size, so that most rows are never
outliers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.calibration.noise.colour import Chain, Colour
from crosscheck.fit.least_squares.problem import KINDS
from seecr.pose import Array

_CHANCE = 0.05
LARGER = 10.0
"""Size of outliers relative to the noise."""
# A row with less weight than this is called an outlier.
OUTLIER = 0.05


def row_weights(chain: Chain, colour: Colour, residual: Array) -> Array:
    """(N,) weight of each reading.

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
    # the fit may not have converged yet: take the size of the bulk if it is larger than the noise
    bulk = np.sqrt(np.median(power / (2.0 * special.gammaincinv(0.5 * count, 0.5))))
    power = power / max(scale, float(bulk)) ** 2
    odds = np.log(_CHANCE / (1.0 - _CHANCE)) - count * np.log(LARGER)
    odds = odds + 0.5 * power * (1.0 - LARGER**-2)
    off = 1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))
    least = np.minimum(LARGER**-2, count / np.maximum(power, 1e-300))
    return np.asarray((1.0 - off + off * least)[group])


def log_chance_of_outliers(chain: Chain, weight: Array) -> float:
    """ln prior odds of these outliers, and no others, over none."""
    count = outliers_by_kind(chain, weight, int(chain.row.max(initial=-1)) + 1).sum()
    return float(count * np.log(_CHANCE / (1.0 - _CHANCE)))


def outliers(chain: Chain, weight: Array, n_rows: int) -> NDArray[np.bool_]:
    """(n,) bool rows in which some kind of reading hardly counts."""
    return np.asarray(outliers_by_kind(chain, weight, n_rows).any(axis=1))


def outliers_by_kind(chain: Chain, weight: Array, n_rows: int) -> NDArray[np.bool_]:
    """(n, 3) bool rows in which readings of each kind hardly count."""
    least = np.ones((n_rows, len(KINDS)))
    np.minimum.at(least, (chain.row, chain.kind), weight)
    return np.asarray(least < OUTLIER)
