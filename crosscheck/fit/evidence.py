"""How well a model explains the data for what it costs: Laplace evidence with plausible sizes.

A group of 24 parameters always fits better than one of 1. The evidence charges each parameter
for how much of its plausible range the data rule out: at a model's own optimum, with whitened
derivatives X by plausible sizes z ~ N(0, lambda^2),

    ln Z(lambda) = -1/2 [|y|^2 - sum c_i^2 g_i] - 1/2 sum ln(1 + lambda^2 s_i^2),
    g_i = lambda^2 s_i^2/(1 + lambda^2 s_i^2),  X = U diag(s) V^T,  c = U^T y,  y = r + X z

averaged over lambda, so that a plausible size that is off by far does not decide. A parameter
the data do not see (s_i = 0) costs nothing and gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.known import known_readings

# Family-wise chance of a false alarm, over all candidates of a step.
FALSE_ALARM = 0.01

WIDTHS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Standard deviations that sizes may have, in plausible ones.

What a good tracker sees of some effects is a hundredth of what they may well be: a robot built that
well is charged for the range of its like, not for that of any robot.
"""


@dataclass(frozen=True)
class Evidence:
    """Evidence of a fitted model.

    Attributes:
        log: ln Z.
        chi2: sum of squared whitened residuals.
        parameters: how many directions the data see.
    """

    log: float
    chi2: float
    parameters: int


def evidence(fit: Fit, noise_scale: float = 1.0) -> Evidence:
    """Evidence of a fit; ``noise_scale`` is the factor of the stated noise."""
    white = fit.state.white / noise_scale
    p = fit.jacobian.shape[1]
    if p == 0:
        return Evidence(-0.5 * (float(white @ white) + fit.state.log_det), fit.chi2, 0)
    # a parameter stopped by its bound is not at the optimum the formula is about
    free = ~fit.at_bound
    columns, readings = known_readings(fit.terms)
    x = np.concatenate([fit.jacobian / noise_scale, columns])
    left = np.concatenate([white, readings - columns @ fit.terms.sizes])
    x = x[:, free]
    y = left + x @ fit.terms.sizes[free]
    power, v = np.linalg.eigh(x.T @ x)
    s = np.sqrt(np.maximum(power, 0.0))
    c2 = (v.T @ (x.T @ y)) ** 2 / np.maximum(power, 1e-300)
    total = float(y @ y)
    logs = []
    for lam in WIDTHS:
        gain = (lam * s) ** 2 / (1.0 + (lam * s) ** 2)
        logs.append(
            -0.5 * (total - float(c2 @ gain)) - 0.5 * float(np.sum(np.log1p((lam * s) ** 2)))
        )
    log = float(special.logsumexp(logs) - np.log(len(WIDTHS))) - 0.5 * fit.state.log_det
    return Evidence(log, fit.chi2, int(np.sum(s > 1e-2)))


def p_value(drop: float, parameters: int, one_sided: bool) -> float:
    """Chance of a fall of chi2 by ``drop`` where the effect is absent.

    A single parameter that cannot be negative halves it (Self & Liang 1987).
    """
    if drop <= 0.0:
        return 1.0
    p = float(stats.chi2.sf(drop, max(parameters, 1)))
    return 0.5 * p if one_sided and parameters == 1 else p
