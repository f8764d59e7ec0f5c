"""What a smooth field over the workspace could explain just as well as an effect does.

An error that no catalogue holds (the lens of a tracker, a curved reference) is often smooth over
the workspace, and much of it looks like a scale or a shift. Where structure is left over, an
effect is told from such a field only by what the field cannot imitate.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from crosscheck.fit.imitation import basis
from crosscheck.fit.problem import TENSION, Problem
from crosscheck.fit.state import State
from seecr.pose import Array

_DEGREE = 3
# Where nothing else is left a name is owed from a fall of chi2 of about 25 beside others; where
# structure is left, which no cubic follows quite, from twice as many standard errors.
_OWED = 100.0


def monomials(place: Array, degree: int = _DEGREE) -> Array:
    """(n, k) monomials to some degree of places (n, d), each axis scaled to [-1, 1].

    Axes along which nothing moves are left out.
    """
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    half = 0.5 * np.ptp(place, axis=0)
    moves = half > 1e-3 * max(float(half.max()), 1e-300)
    unit = ((place - middle) / np.where(moves, half, 1.0))[:, moves]
    columns = [np.ones(len(place))]
    for power in range(1, degree + 1):
        for axes in combinations_with_replacement(range(unit.shape[1]), power):
            columns.append(np.prod(unit[:, axes], axis=1))
    return np.stack(columns, axis=1)


def field_columns(problem: Problem, place: Array, last: int = TENSION.start) -> Array:
    """(N, k) a cubic of places (n, 3) for each channel that was read before one; of the pose."""
    shapes = monomials(place)[problem.row_of]
    channels = [c for c in np.unique(problem.column_of) if c < last]
    parts = [shapes * (problem.column_of == c)[:, None] for c in channels]
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(problem.row_of), 0))


def beyond_smooth(problem: Problem, before: State, after: State, share: float) -> bool:
    """Whether an effect explains what a smooth field of the measured pose would not.

    Args:
        problem: the data.
        before, after: the model without the effect and with it.
        share: least part of what the field leaves unexplained that the effect must take away.
    """
    span = basis(field_columns(problem, before.prediction.pose[:, :3]))

    def beside(white: Array) -> Array:
        return white - span @ (span.T @ white)

    left, explained = beside(before.white), beside(before.white - after.white)
    power = float(explained @ explained)
    if power == 0.0:
        return False
    fall = float(left @ explained) ** 2 / power
    unexplained = float(left @ left) - (len(left) - span.shape[1])
    return bool(fall > max(_OWED, share * unexplained))
