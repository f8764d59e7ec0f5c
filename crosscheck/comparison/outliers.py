"""Rows that are far off whatever effects would explain: outliers of a model that lacks some.

What a model lacks moves readings by many times the noise, and farther where the platform is soft,
so that a row far off zero need not be an outlier, and two outliers may hide the rest. All effects
are therefore fitted together with weights against outliers, as a diagnosis does; the fit serves for
nothing else. Weights of a fit that leaves more than noise follow what it misses, so a row also has
to be far off all others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.noise.outliers import outlying_rows
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.fit import Data
from crosscheck.inference.noise import outliers
from crosscheck.inference.search import Search
from seecr.effects import Terms

# A fit of more rows takes too long for a comparison; fewer readings do not carry one.
_MOST_ROWS, _LEAST_READINGS = 400, 60


def rows_far_off(problem: Problem, terms: Terms) -> NDArray[np.bool_]:
    """(n,) outliers; none if too many are: they are structure then.

    Of more than 400 rows, and of too few readings, those that are far off the others as they are.

    Args:
        problem: the data with their noise. terms: the model as it stands.
    """
    every = problem.data.n_rows
    none = np.zeros(every, dtype=bool)
    if not problem.n_readings:
        return none
    data = Data.of(problem, terms)
    state = data.state(terms)
    if not state.valid or not outlying_rows(problem, state, 1.0, every).any():
        return none
    if every > _MOST_ROWS or problem.n_readings < _LEAST_READINGS:
        return outlying_rows(problem, state)
    whole = Search(data, Catalogue.of(data, terms)).everything.fit
    far = outlying_rows(problem, whole.state, 1.0, every) & outliers(
        data.chain, whole.weight, every
    )
    return outlying_rows(problem, whole.state) if side_by_side(problem, far) else far


def side_by_side(problem: Problem, far: NDArray[np.bool_]) -> bool:
    """Whether rows that are far off follow one another more often than not: they are structure."""
    run = problem.data.run_index
    beside = far[1:] & far[:-1] & (run[1:] == run[:-1])
    return bool(2 * beside.sum() > far.sum() > 1)
