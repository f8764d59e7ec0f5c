"""What a group of parameters is worth beside others, in a linear model with Gaussian priors.

At an optimum the prediction is y = r + X z with z ~ N(0, lambda^2). Given the others, what is left
of a group's own normal matrix C and gradient b says what its evidence gains over its absence:

    ln gain = 1/2 sum lambda^2 b_i^2/(1 + lambda^2 e_i) - 1/2 sum ln(1 + lambda^2 e_i)

in the axes of C = U diag(e) U^T. One width for the group is averaged over, so that a plausible
size that is off by far does not decide. A single parameter that cannot be negative has half a
Gaussian as its prior.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from crosscheck.fit.evidence import WIDTHS, half_gaussian
from seecr.pose import Array


def log_gains(normal: Array, gradient: Array, widths: ArrayLike, one_sided: bool = False) -> Array:
    """(k,) ln gain of a group for each width.

    Args:
        normal: (p, p) what the others leave of its normal matrix.
        gradient: (p,) what they leave of X^T y.
        widths: (k,) prior standard deviations of z.
        one_sided: the group is one parameter that cannot be negative.
    """
    power, axes = np.linalg.eigh(normal)
    power = np.maximum(power, 0.0)
    if one_sided and len(gradient) == 1:
        return half_gaussian(power, gradient, np.asarray(widths, float))
    return gains_along(power, axes.T @ gradient, widths)


def gains_along(power: Array, along: Array, widths: ArrayLike) -> Array:
    """(k, ...) ln gain for each width, from the axes of the normal matrix.

    Args:
        power: (p,) its eigenvalues.
        along: (p, ...) gradients along its axes, one or many.
        widths: (k,) prior standard deviations of z.
    """
    shape = (len(power), *(1 for _ in along.shape[1:]))
    square = (np.asarray(widths, float) ** 2).reshape(-1, *(1 for _ in shape))
    grown = 1.0 + square * power.reshape(shape)
    return np.asarray(0.5 * np.sum(square * along**2 / grown - np.log(grown), axis=1))


def log_gain(
    normal: Array, gradient: Array, widths: Sequence[float] = WIDTHS, one_sided: bool = False
) -> float:
    """ln gain of a group, averaged over its width."""
    gains = log_gains(normal, gradient, widths, one_sided)
    return float(special.logsumexp(gains) - np.log(len(gains)))
