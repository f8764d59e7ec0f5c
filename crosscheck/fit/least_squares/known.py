"""Values that were measured independently or are fixed, in the form that fits take them.

A value z = (value - null)/scale that was measured with the standard error s counts as one more
reading: y = z_measured/s, with the derivative 1/s and unit noise. It adds ((z_measured - z)/s)^2 to
the objective. A fixed value has zero derivatives.

The noise of the data is taken as stated. If a fit leaves more than that, the readings of the data
count for less than stated and those values for as much as before: see :func:`firmer`.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, derivatives
from seecr.effects import Terms
from seecr.pose import Array


def known_readings(terms: Terms) -> tuple[Array, Array]:
    """Independently measured values as readings with unit noise.

    Returns:
        Their derivatives by z (k, p), and the readings (k,).
    """
    known = terms.knowledge
    own = np.flatnonzero(known.measured)
    columns = np.zeros((len(own), len(terms)))
    columns[np.arange(len(own)), own] = (terms.scale / known.stderr)[own]
    return columns, ((known.value - terms.null) / known.stderr)[own]


def known_left(terms: Terms) -> Array:
    """(k,) measured minus current values of those measured independently, in standard errors."""
    columns, readings = known_readings(terms)
    return np.asarray(readings - columns @ terms.sizes)


def free_derivatives(problem: Problem, state: State, frozen: bool = False) -> Array:
    """(N, p) whitened derivatives of the prediction by z; 0 for fixed values."""
    terms = state.terms
    if not len(terms):
        return np.zeros((len(state.white), 0))
    rates = derivatives(problem, state, frozen=frozen)
    return np.asarray(rates * np.where(terms.knowledge.fixed, 0.0, terms.scale))
