"""Estimates size and autocorrelation of the noise by the marginal likelihood of the fit (REML).

At the optimum the prediction is linear, y = r + X z with z ~ N(0, width^2), so the readings are
distributed as y ~ N(0, X W X^T + Sigma(scale, rho)). This likelihood, in which everything that
effects can imitate is integrated out, is maximised over the noise (Patterson and Thompson,
Biometrika 58, 1971). The residuals of a fit alone would be too small and too little correlated.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, optimize

from crosscheck.calibration.noise.colour import (
    Chain,
    Colour,
    apart_from_before,
    foretold,
    log_det,
    scaled,
    whitened,
)
from crosscheck.fit.least_squares.definite import root_beside_one
from crosscheck.fit.least_squares.problem import KINDS
from seecr.pose import Array

_MOST_ALIKE = 0.97
_SMALLEST, _LARGEST = 1e-2, 1e3
# rho for derivatives at 0: of gaps below 1, rho^gap grows there without bound.
_LEAST_RHO = 1e-6


def log_evidence(
    chain: Chain, colour: Colour, weight: Array, x: Array, y: Array, width: Array
) -> float:
    """ln N(y; 0, X W X^T + Sigma), up to a constant; x (N, p), y (N,) in units of stated noise."""
    columns = whitened(chain, colour, weight, x * width)
    left = whitened(chain, colour, weight, y)
    factor = root_beside_one(columns)
    part = linalg.solve_triangular(factor, columns.T @ left, lower=True, check_finite=False)
    power = float(left @ left) - float(part @ part)
    return -0.5 * (power + _volume(factor) + log_det(chain, colour, weight))


def with_slopes(
    chain: Chain, colour: Colour, weight: Array, x: Array, y: Array, width: Array
) -> tuple[float, Array, Array]:
    """The same, and its derivatives by the logarithm of each kind's scale (3,) and by its rho (3,).

    Power and volume depend on the noise through the same quadratic form: with L L^T = 1 + X^T X of
    the whitened X, and what the best z leaves of y, they change as the squares of the whitened rows
    of (X L^-T, y - X z) do.
    """
    unit = scaled(chain, colour, weight, np.column_stack([x * width, y]))
    white = apart_from_before(chain, colour, unit)
    factor = root_beside_one(white[:, :-1])
    part = linalg.solve_triangular(
        factor, white[:, :-1].T @ white[:, -1], lower=True, check_finite=False
    )
    z = linalg.solve_triangular(factor, part, lower=True, trans=1, check_finite=False)
    ball = linalg.solve_triangular(factor, unit[:, :-1].T, lower=True, check_finite=False)
    rows = np.column_stack([ball.T, unit @ np.append(-z, 1.0)])
    left = apart_from_before(chain, colour, rows)
    power = float(left[:, -1] @ left[:, -1]) + float(z @ z)
    value = -0.5 * (power + _volume(factor) + log_det(chain, colour, weight))

    phi, rho = foretold(chain, colour), np.maximum(colour.rho[chain.kind], _LEAST_RHO)
    by_phi = np.where(chain.before < 0, 0.0, chain.gap * rho ** (chain.gap - 1.0))
    squares = np.einsum("ij,ij->i", left, left)
    with_before = np.einsum("ij,ij->i", left, rows[np.maximum(chain.before, 0)])
    other = 1.0 - phi**2
    slope = by_phi / other * (phi * (1.0 - squares) + np.sqrt(other) * with_before)

    def by_kind(each: Array) -> Array:
        return np.bincount(chain.kind, each, len(colour.scale)).astype(float)

    return value, by_kind(squares - 1.0), by_kind(slope)


def _volume(factor: Array) -> float:
    """ln determinant of L L^T."""
    return 2.0 * float(np.sum(np.log(np.abs(np.diag(factor)))))


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

    def cost(numbers: Array) -> tuple[float, Array]:
        value, by_scale, by_rho = with_slopes(chain, colour_at(numbers), weight, x, y, width)
        return -value, -np.concatenate([by_scale[kinds], by_rho[kinds[linked]]])

    found = optimize.minimize(
        cost, np.clip(first, *np.array(limits).T), jac=True, method="L-BFGS-B", bounds=limits,
        options={"maxiter": 30, "ftol": 1e-7}, 
    )  # fmt: skip
    return colour_at(np.asarray(found.x, float))
