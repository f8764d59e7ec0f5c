"""Rows whose readings are far off those of all other rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State

# A single row is an outlier if it is so many robust standard deviations above the median; if more
# than this part of the rows are, none counts as one, unless more are asked for.
_OUTLIER = 6.0
_MOST_OUTLIERS = 0.05


def outlying_rows(
    problem: Problem, state: State, most: float = _MOST_OUTLIERS, together: int = 1
) -> NDArray[np.bool_]:
    """(n,) isolated outliers: rows whose whitened residuals far exceed all others.

    Args:
        most: if more than this part of the rows are outliers, none counts as one.
        together: if more neighbours than this stick out, they are structure and no outliers.
    """
    power = np.zeros(problem.data.n_rows)
    count = np.zeros(problem.data.n_rows)
    np.add.at(power, problem.row_of, state.white**2)
    np.add.at(count, problem.row_of, 1.0)
    size = np.sqrt(power / np.maximum(count, 1.0))
    used = problem.use & (count > 0)
    middle = float(np.median(size[used]))
    spread = 1.4826 * float(np.median(np.abs(size[used] - middle)))
    limit = middle + _OUTLIER * max(spread, 0.2 * middle, 1e-12)
    rows = used & (size > max(limit, 4.0))
    if rows.sum() > max(most * used.sum(), 1):
        return np.zeros_like(rows)
    for k in np.flatnonzero(rows):
        sticks_out = used & (size > middle + 0.5 * (size[k] - middle))
        rows[k] = _stretch(sticks_out, int(k)) <= together
    return np.asarray(rows)


def _stretch(some: np.ndarray, row: int) -> int:
    """How many neighbours in a row, with this one, are among some rows (n,)."""
    others = np.flatnonzero(~some)
    before = others[others < row].max(initial=-1)
    return int(others[others > row].min(initial=len(some)) - before - 1)
