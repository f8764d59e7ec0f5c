"""What is known of a model's values beside the data, as fits in plausible sizes take it.

A value z = (value - null)/scale that was measured independently with the standard error s is one
more reading: y = z_measured/s with the column 1/s and noise of unit size. It adds
((z_measured - z)/s)^2 to what a fit makes small. A fixed value has no column at all.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.fit.state import State, derivatives
from seecr.effects import Terms
from seecr.pose import Array


def known_readings(terms: Terms) -> tuple[Array, Array]:
    """Values measured independently as readings of unit noise.

    Returns:
        columns (k, p) by z, and the readings (k,).
    """
    known = terms.knowledge
    own = np.flatnonzero(known.measured)
    columns = np.zeros((len(own), len(terms)))
    columns[np.arange(len(own)), own] = (terms.scale / known.stderr)[own]
    return columns, ((known.value - terms.null) / known.stderr)[own]


def known_left(terms: Terms) -> Array:
    """(k,) how far off the values are from those measured independently, in standard errors."""
    columns, readings = known_readings(terms)
    return np.asarray(readings - columns @ terms.sizes)


def free_derivatives(problem: Problem, state: State, frozen: bool = False) -> Array:
    """(N, p) whitened derivatives of the prediction by z; 0 for values that are fixed."""
    terms = state.terms
    if not len(terms):
        return np.zeros((len(state.white), 0))
    rates = derivatives(problem, state, frozen=frozen)
    return np.asarray(rates * np.where(terms.knowledge.fixed, 0.0, terms.scale))
