"""A smooth field over the workspace, which stands for effects that are not in the catalogue.

Each channel of readings gets its own cubic in the position, with one prior width for all
coefficients. The field is never part of a fit, because it would explain what effects explain.
"""

from __future__ import annotations

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.noise.smooth import field_columns
from seecr.pose import Array

FIELD_WIDTHS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
# From these ln odds on, something unknown is taken to be there.
UNKNOWN = 5.0


def field_of(problem: Problem, place: Array, smooth: float = 1.0) -> Array:
    """(N, k) columns of the field in units of the noise: a cubic for each channel.

    Args:
        smooth: each degree is so many times as large as the one before.
    """
    return field_columns(problem, place, problem.measured.shape[1], smooth)
