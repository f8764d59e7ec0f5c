"""The evidence that the choice of an effect's shape costs: a period, a time constant.

A fit takes the shape that explains most, of noise too, and the more shapes there are the better it
does. So the evidence of a set is not that at its best shapes. By Laplace's method it is smaller by
the fraction of the shapes' prior that explains the data about as well. All shapes that a search
starts from are equally probable a priori, and so is what lies between them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.linearised import Linear, linearised
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.fit.least_squares.definite import inverse_of
from seecr.effects import Term
from seecr.effects.setup import Setup
from seecr.pose import Array


def log_shares(joint: JointFit, linear: Linear) -> dict[str, float]:
    """ln of the fraction of its prior to which each effect's shape is determined, at most 0.

    Args:
        joint: a fit.
        linear: the model linearised about it.
    """
    free = np.flatnonzero(linear.width > 0.0)
    shaped = [term for term in joint.terms if term.layout.shape.any()]
    if not shaped:
        return {}
    x = linear.x[:, free]
    covariance = inverse_of(x.T @ x + np.diag(linear.width[free] ** -2.0))
    errors = np.zeros(len(linear.width))
    errors[free] = np.sqrt(np.diag(covariance)) * joint.terms.scale[free]
    setup = joint.state.prediction.setup
    return {t.name: _log_share(t, errors[joint.terms.own(t.name)], setup) for t in shaped}


def prices_about(setting: Setting, joint: JointFit, catalogue: Catalogue) -> dict[str, float]:
    """ln evidence that the best shapes of effects gain too much in a linear model about a fit."""
    shares = log_shares(joint, linearised(setting, joint))
    return {**catalogue.prices, **{name: -share for name, share in shares.items()}}


def _log_share(term: Term, errors: Array, setup: Setup) -> float:
    """The same for one effect whose values have standard errors (p,), 0 for those that stay."""
    layout, total = term.layout, 0.0
    starts = np.array([layout.start(s) for s in layout.effect.shapes(setup)])
    for k in np.flatnonzero(layout.shape & (errors > 0.0)):
        values = np.unique(starts[:, k]) if len(starts) else starts
        if len(values) > 1:
            part = np.sqrt(2.0 * np.pi) * errors[k] / (len(values) * _apart(values, term.vector[k]))
            total += float(np.log(min(part, 1.0)))
    return total


def _apart(values: Array, at: float) -> float:
    """Spacing of increasing values (n,) near one of them."""
    steps = np.diff(values)
    middles = [0.5 * (a + b) for a, b in pairwise(values)]
    return float(np.interp(at, middles, steps))
