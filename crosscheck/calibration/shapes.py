"""What it costs that nobody said which shape an effect has: a period, a time constant.

A fit picks the shape that explains most, also of noise, and the more shapes there are the better
it does. So a set's evidence is not that at its best shapes: by Laplace, it is less by the part of
the shapes' prior that explains the data about as well. Every shape that a search starts from is
alike likely, and what lies between two of them as likely as they are.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from crosscheck.calibration.catalogue import Catalogue
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.linearised import Linear, linearised
from crosscheck.fit.definite import inverse_of
from seecr.effects import Term
from seecr.effects.setup import Setup
from seecr.pose import Array


def log_shares(joint: JointFit, linear: Linear) -> dict[str, float]:
    """ln of the part of its prior that an effect's shape is known to, at most 0; of some effects.

    Args:
        joint: a fit.
        linear: the linear model about it.
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
    """What the best shapes of effects gain too much in a linear model about a fit of some."""
    shares = log_shares(joint, linearised(setting, joint))
    return {**catalogue.prices, **{name: -share for name, share in shares.items()}}


def _log_share(term: Term, errors: Array, setup: Setup) -> float:
    """Of one effect, whose values have standard errors (p,); 0 for those that stay."""
    layout, total = term.layout, 0.0
    starts = np.array([layout.start(s) for s in layout.effect.shapes(setup)])
    for k in np.flatnonzero(layout.shape & (errors > 0.0)):
        values = np.unique(starts[:, k]) if len(starts) else starts
        if len(values) > 1:
            part = np.sqrt(2.0 * np.pi) * errors[k] / (len(values) * _apart(values, term.vector[k]))
            total += float(np.log(min(part, 1.0)))
    return total


def _apart(values: Array, at: float) -> float:
    """How far apart values (n,) lie that rise, where one is."""
    steps = np.diff(values)
    middles = [0.5 * (a + b) for a, b in pairwise(values)]
    return float(np.interp(at, middles, steps))
