"""Whether a smooth field over the workspace could explain as much as an effect does.

An error that is not in the catalogue (the lens of a tracker, a curved reference) is often smooth
over the workspace, and much of it looks like a scale or a shift. If structure remains, an effect
therefore counts only for what such a field cannot imitate.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from crosscheck.fit.least_squares.imitation import basis, beside
from crosscheck.fit.least_squares.problem import TENSION, Problem
from crosscheck.fit.least_squares.state import State
from seecr.pose import Array

_DEGREE = 3
# If nothing else remains, an effect is named from a fall of chi2 of about 25 on. If structure
# remains, which no cubic follows exactly, it takes twice as many standard errors.
_OWED = 100.0


def monomials(place: Array, degree: int = _DEGREE, smooth: float = 1.0) -> Array:
    """(n, k) monomials up to some degree of places (n, d), each axis scaled to [-1, 1].

    Axes along which nothing moves are left out.

    Args:
        smooth: each degree is so many times as large as the one before.
    """
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    half = 0.5 * np.ptp(place, axis=0)
    moves = half > 1e-3 * max(float(half.max()), 1e-300)
    unit = ((place - middle) / np.where(moves, half, 1.0))[:, moves]
    columns = [np.ones(len(place))]
    for power in range(1, degree + 1):
        for axes in combinations_with_replacement(range(unit.shape[1]), power):
            columns.append(smooth**power * np.prod(unit[:, axes], axis=1))
    return np.stack(columns, axis=1)


def field_columns(
    problem: Problem, place: Array, last: int = TENSION.start, smooth: float = 1.0
) -> Array:
    """(N, k) a cubic in place (n, 3) for each channel below ``last`` that was read; of the pose."""
    shapes = monomials(place, smooth=smooth)[problem.row_of]
    channels = [c for c in np.unique(problem.column_of) if c < last]
    parts = [shapes * (problem.column_of == c)[:, None] for c in channels]
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(problem.row_of), 0))


def beyond_smooth(problem: Problem, before: State, after: State, share: float) -> bool:
    """Whether an effect explains what a smooth field of the predicted positions would not.

    Args:
        problem: the data.
        before, after: the model without the effect, and with it.
        share: the effect must explain at least this part of what the field leaves beyond noise.
    """
    span = basis(field_columns(problem, before.prediction.pose[:, :3]))
    left, explained = beside(before.white, span), beside(before.white - after.white, span)
    power = float(explained @ explained)
    if power == 0.0:
        return False
    fall = float(left @ explained) ** 2 / power
    unexplained = float(left @ left) - (len(left) - span.shape[1])
    return bool(fall > max(_OWED, share * unexplained))
