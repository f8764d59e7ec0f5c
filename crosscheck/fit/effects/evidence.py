"""Laplace approximation of the evidence, the marginal likelihood of a fitted model.

A group of 24 parameters always fits better than a single one. The evidence charges each parameter
for the part of its prior range that the data rule out. The model is linearised about its optimum,
with whitened derivatives X by the plausible sizes z, residuals r there, and the prior
z ~ N(0, lambda^2):

    ln Z(lambda) = -1/2 |y|^2 + 1/2 b^T A^-1 b - 1/2 ln det A,  y = r + X z,
    A = 1 + L X^T X L,  b = L X^T y,  L = diag(lambda)

less half the log determinant of the noise. Z is averaged over the prior widths lambda, separately
for each effect, so that a badly wrong plausible size does not decide. A parameter that moves no
reading has no influence. A parameter that cannot be negative and is stopped at zero is charged for
what it might have been, by the integral over half a Gaussian: if these data would show friction and
do not, then friction is less probable than none.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.least_squares.definite import roots_of
from crosscheck.fit.least_squares.known import known_readings
from seecr.effects import Terms
from seecr.pose import Array

# Family-wise false-alarm rate, over all candidates of a step.
FALSE_ALARM = 0.01

WIDTHS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Prior standard deviations of the parameters, in plausible sizes.

A good tracker resolves some effects to a hundredth of their plausible size. An effect of a robot
that was built that well is charged for a prior range of that width, not for that of any robot.
"""
# Rounds in which the best width of each effect is searched, given those of the others.
_ROUNDS = 2


@dataclass(frozen=True)
class Evidence:
    """Evidence of a fitted model.

    Attributes:
        log: ln Z.
        chi2: sum of squared whitened residuals.
        parameters: how many directions of the parameters the data see.
    """

    log: float
    chi2: float
    parameters: int


def evidence(fit: Fit, flat: Collection[str] = ()) -> Evidence:
    """Evidence of a fit; the prior of effects that are ``flat`` has the largest width alone.

    No size is expected of values that belong to the data. A narrower prior would only be a reward
    for models in which another effect does what theirs did.
    """
    white = fit.state.white
    p = fit.jacobian.shape[1]
    if p == 0:
        return Evidence(-0.5 * (float(white @ white) + fit.state.log_det), fit.chi2, 0)
    # a parameter stopped by its bound is not at the optimum that the approximation assumes
    free, absent = ~fit.at_bound, held_at_nothing(fit.terms)
    columns, readings = known_readings(fit.terms)
    x = np.concatenate([fit.jacobian, columns])
    left = np.concatenate([white, readings - columns @ fit.terms.sizes])
    y = left + x[:, free] @ fit.terms.sizes[free]
    kept = free | absent
    x, absent = x[:, kept], absent[kept]
    normal, gradient = x.T @ x, x.T @ y
    power = np.linalg.eigvalsh(normal[np.ix_(~absent, ~absent)])
    widest = [fit.terms.own(n)[kept] for n in fit.terms.names if n in flat]
    own = (fit.terms.own(n)[kept] for n in fit.terms.names if n not in flat)
    held = np.any([np.zeros(kept.sum(), dtype=bool), *widest], axis=0)
    gain = _averaged(normal, gradient, [one for one in own if one.any()], absent, held)
    log = gain - 0.5 * (float(y @ y) + fit.state.log_det)
    return Evidence(log, fit.chi2, int(np.sum(power > 1e-4)))


def held_at_nothing(terms: Terms) -> NDArray[np.bool_]:
    """(p,) amplitudes that cannot be negative and are stopped at zero by that bound."""
    there = (terms.vector <= terms.lower) & (terms.lower == terms.null)
    shapes = np.concatenate([np.zeros(0, dtype=bool), *(t.layout.shape for t in terms)])
    return np.asarray(there & ~shapes & ~terms.knowledge.fixed)


def half_gaussian(power: Array, along: Array, width: Array) -> Array:
    """ln evidence gained by a parameter that cannot be negative, with half a Gaussian as prior.

    Args:
        power: its diagonal element of the normal matrix, after the other parameters are eliminated.
        along: the same of the gradient X^T y.
        width: prior standard deviations in plausible sizes.
    """
    square = width**2
    grown = 1.0 + square * power
    gain = 0.5 * (square * along**2 / grown - np.log(grown))
    return np.asarray(gain + np.log(2.0) + special.log_ndtr(along * np.sqrt(square / grown)))


def _averaged(
    normal: Array, gradient: Array, groups: Sequence[NDArray[np.bool_]], absent: NDArray[np.bool_],
    widest: NDArray[np.bool_],
) -> float:  # fmt: skip
    """ln of the evidence over that of no effects, averaged over the prior width of each effect.

    With several effects, one is averaged at a time while the others keep their best widths. These
    are searched one effect at a time, from the best width that all share. Parameters that are
    ``widest`` (p,) have the largest width.
    """

    def gains(widths: Array) -> Array:
        return _gains(normal, gradient, widths, absent)

    def gains_with(own: NDArray[np.bool_]) -> Array:
        """(k,) ln evidence with one effect at each of its widths, the others at their best."""
        return gains(np.where(own, np.array(WIDTHS)[:, None], best))

    shared = np.where(widest, WIDTHS[-1], np.array(WIDTHS)[:, None])
    logs = gains(shared)
    if len(groups) == 1:
        return float(np.logaddexp.reduce(logs) - np.log(len(WIDTHS)))
    best = shared[int(np.argmax(logs))]
    for _ in range(_ROUNDS):
        for own in groups:
            best = np.where(own, WIDTHS[int(np.argmax(gains_with(own)))], best)
    top = float(gains(best[None])[0])
    means = [np.logaddexp.reduce(gains_with(own)) for own in groups]
    return top + float(np.sum(np.array(means) - np.log(len(WIDTHS)) - top))


def _gains(normal: Array, gradient: Array, widths: Array, absent: NDArray[np.bool_]) -> Array:
    """(k,) ln of the evidence over that of no effects, for prior standard deviations (k, p).

    Parameters that are ``absent`` (p,) are stopped at zero; each is charged beside the others by
    itself, see :func:`half_gaussian`.
    """
    free = np.flatnonzero(~absent)
    wide = widths[:, free]
    inside = np.eye(len(free)) + wide[:, :, None] * normal[np.ix_(free, free)] * wide[:, None, :]
    root = roots_of(inside)
    half = np.linalg.solve(root, (wide * gradient[free])[..., None])[..., 0]
    diagonal = np.diagonal(root, axis1=1, axis2=2)
    out = 0.5 * np.sum(half**2, axis=1) - np.sum(np.log(diagonal), axis=1)
    for k in np.flatnonzero(absent):
        shared = np.linalg.solve(root, (wide * normal[free, k])[..., None])[..., 0]
        power = np.maximum(normal[k, k] - np.sum(shared**2, axis=1), 0.0)
        along = gradient[k] - np.sum(shared * half, axis=1)
        out = out + half_gaussian(power, along, widths[:, k])
    return np.asarray(out)


def p_value(drop: float, parameters: int, one_sided: bool) -> float:
    """p-value of a fall of chi2 by ``drop``: its probability if the effect is absent.

    It is half as large for a single parameter that cannot be negative (Self & Liang 1987).
    """
    if drop <= 0.0:
        return 1.0
    p = float(special.chdtrc(max(parameters, 1), drop))
    return 0.5 * p if one_sided and parameters == 1 else p
