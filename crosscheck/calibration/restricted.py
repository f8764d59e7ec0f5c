"""Estimates size and autocorrelation of the noise by the marginal likelihood of the fit (REML).

At the optimum the prediction is linear, y = r + X z with z ~ N(0, width^2), so the readings are
distributed as y ~ N(0, X W X^T + Sigma(scale, rho)). This likelihood, in which everything that
effects can imitate is integrated out, is maximised over the noise (Patterson and Thompson,
Biometrika 58, 1971). The residuals of a fit alone would be too small and too little correlated.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, optimize

from crosscheck.calibration.colour import Chain, Colour, log_det, whitened
from crosscheck.fit.definite import root_beside_one
from crosscheck.fit.problem import KINDS
from seecr.pose import Array

_MOST_ALIKE = 0.97
_SMALLEST, _LARGEST = 1e-2, 1e3


def log_evidence(
    chain: Chain, colour: Colour, weight: Array, x: Array, y: Array, width: Array
) -> float:
    """ln N(y; 0, X W X^T + Sigma), up to a constant; x (N, p), y (N,) in units of stated noise."""
    columns = whitened(chain, colour, weight, x * width)
    left = whitened(chain, colour, weight, y)
    factor = root_beside_one(columns)
    part = linalg.solve_triangular(factor, columns.T @ left, lower=True, check_finite=False)
    power = float(left @ left) - float(part @ part)
    volume = 2.0 * float(np.sum(np.log(np.abs(np.diag(factor)))))
    return -0.5 * (power + volume + log_det(chain, colour, weight))


def estimate(
    chain: Chain, start: Colour, weight: Array, x: Array, y: Array, width: Array
) -> Colour:
    """The noise of maximum marginal likelihood.

    Args:
        chain: the order of the readings.
        start: where the search starts.
        weight: (N,) weight of each reading.
        x: (N, p) derivatives by z, y: (N,) r + X z, both in units of the stated noise.
        width: (p,) prior standard deviations of z.
    """
    kinds = np.unique(chain.kind)
    linked = np.array([bool(np.any(chain.before[chain.kind == k] >= 0)) for k in kinds])

    def colour_at(numbers: Array) -> Colour:
        scale, rho = np.ones(len(KINDS)), np.zeros(len(KINDS))
        scale[kinds] = np.exp(numbers[: len(kinds)])
        rho[kinds[linked]] = numbers[len(kinds) :]
        return Colour(scale, rho)

    limits = [(np.log(_SMALLEST), np.log(_LARGEST))] * len(kinds)
    limits += [(0.0, _MOST_ALIKE)] * int(linked.sum())
    first = np.concatenate([np.log(start.scale[kinds]), start.rho[kinds[linked]]])
    found = optimize.minimize(
        lambda numbers: -log_evidence(chain, colour_at(numbers), weight, x, y, width),
        np.clip(first, *np.array(limits).T), method="L-BFGS-B", bounds=limits,
        options={"maxiter": 30, "ftol": 1e-7}, 
    )  # fmt: skip
    return colour_at(np.asarray(found.x, float))
