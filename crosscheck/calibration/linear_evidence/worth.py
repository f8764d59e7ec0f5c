"""What a group of parameters is worth beside others, in a linear model with Gaussian priors.

At an optimum the prediction is y = r + X z with z ~ N(0, lambda^2). With C and b the group's normal
matrix and gradient after the others are eliminated, the evidence gains over that without the group

    ln gain = 1/2 sum lambda^2 b_i^2/(1 + lambda^2 e_i) - 1/2 sum ln(1 + lambda^2 e_i)

in the axes of C = U diag(e) U^T. It is averaged over the width lambda of the group, so that a badly
wrong plausible size does not decide. A parameter that cannot be negative has half a Gaussian as its
prior, which multiplies the evidence by twice the probability that it is positive, given the data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class ByWidth:
    """A group of parameters beside others, for each of k prior widths.

    Attributes:
        power: (p,) eigenvalues of its normal matrix. axes: (p, p) their axes.
        along: (p,) gradient along the axes.
        widths: (k,) prior standard deviations of z.
    """

    power: Array
    axes: Array
    along: Array
    widths: Array

    @classmethod
    def of(cls, normal: Array, gradient: Array, widths: ArrayLike) -> ByWidth:
        """From normal matrix (p, p) and gradient (p,) after the others are eliminated."""
        power, axes = np.linalg.eigh(normal)
        return cls(np.maximum(power, 0.0), axes, axes.T @ gradient, np.asarray(widths, float))

    @property
    def gains(self) -> Array:
        """(k,) ln evidence gained, with Gaussian priors."""
        return gains_along(self.power, self.along, self.widths)

    def gains_if(self, one_sided: ArrayLike) -> Array:
        """(k,) the same, if some of the parameters (p,) cannot be negative."""
        bounded = np.broadcast_to(one_sided, len(self.power))
        if not bounded.any():
            return self.gains
        return np.asarray(self.gains + log_positive(*self.seen(np.eye(len(self.power))[bounded])))

    def seen(self, rate: Array) -> tuple[Array, Array]:
        """Most probable values and variances (k, q) of rate @ z, for rate (q, p)."""
        square, rate = self.widths[:, None] ** 2, rate @ self.axes
        share = square / (1.0 + square * self.power)
        return (share * self.along) @ rate.T, share @ (rate**2).T


def log_gains(
    normal: Array, gradient: Array, widths: ArrayLike, one_sided: ArrayLike = False
) -> Array:
    """(k,) ln evidence that a group gains, for each width.

    Args:
        normal: (p, p) its normal matrix after the others are eliminated.
        gradient: (p,) the same of X^T y.
        widths: (k,) prior standard deviations of z.
        one_sided: (p,) parameters that cannot be negative; each is treated by itself.
    """
    return ByWidth.of(normal, gradient, widths).gains_if(one_sided)


def log_positive(values: Array, variance: Array) -> Array:
    """(...) ln of what half a Gaussian as prior changes, for parameters (..., q).

    Args:
        values: their most probable values without the bound. variance: of these.
    """
    chance = special.log_ndtr(values / np.sqrt(variance))
    return np.asarray(np.sum(np.log(2.0) + chance, axis=-1))


def gains_along(power: Array, along: Array, widths: ArrayLike) -> Array:
    """(k, ...) ln evidence gained, for each width, in the axes of the normal matrix.

    Args:
        power: (p,) eigenvalues of the normal matrix.
        along: (p, ...) gradients along its axes, one or many.
        widths: (k,) prior standard deviations of z.
    """
    shape = (len(power), *(1 for _ in along.shape[1:]))
    square = (np.asarray(widths, float) ** 2).reshape(-1, *(1 for _ in shape))
    grown = 1.0 + square * power.reshape(shape)
    return np.asarray(0.5 * np.sum(square * along**2 / grown - np.log(grown), axis=1))


def log_gain(
    normal: Array, gradient: Array, widths: ArrayLike, one_sided: ArrayLike = False
) -> float:
    """ln evidence that a group gains, averaged over its width."""
    gains = log_gains(normal, gradient, widths, one_sided)
    return float(np.logaddexp.reduce(gains) - np.log(len(gains)))
