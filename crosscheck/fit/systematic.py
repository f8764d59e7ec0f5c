"""How far fitted values would move if another effect were missing: the error of what is left out.

Where a fit leaves structure, something else acts, and what it has in common with the fitted
effects is in their values already. How much that may be is told by the effects of the catalogue:
each is added to the linear model about the fit, and those that explain most of what is left say
how far the values move with them.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.candidates import candidates_for
from crosscheck.fit.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.known import known_readings
from crosscheck.fit.problem import Problem
from crosscheck.fit.starts import amplitude_columns
from seecr.pose import Array

# Effects count that explain at least this part of what the best of them explains.
_AS_MUCH = 0.5


def moved_by_others(problem: Problem, found: Fit) -> Array:
    """How far each value would move with another effect that explains much of what is left.

    Args:
        problem: the data.
        found: a fit that leaves more than noise.

    Returns:
        (p,) the largest move among such effects, in the values' units; 0 for fixed values and
        those on a bound.
    """
    falls, moves = [], []
    for candidate in candidates_for(problem):
        layout = candidate.layout
        if candidate.why_not is not None or layout.name in found.terms:
            continue
        for shape in layout.effect.shapes(found.state.prediction.setup)[:1]:
            columns = amplitude_columns(problem, found, layout, layout.start(shape)) * layout.scale
            fall, move = _with_columns(found, columns)
            falls.append(fall)
            moves.append(move)
    most = max(falls, default=0.0)
    some = [m for f, m in zip(falls, moves, strict=True) if f > _AS_MUCH * most > 0.0]
    largest = np.max(np.abs(some), axis=0) if some else np.zeros(len(found.terms))
    return np.asarray(largest * found.terms.scale)


def _with_columns(found: Fit, columns: Array) -> tuple[float, Array]:
    """Fall of chi2 with more columns (N, k) in the linear model, and the moves (p,) of z."""
    known, p = known_readings(found.terms)[0], len(found.terms)
    stays = found.at_bound | found.terms.knowledge.fixed
    x = np.concatenate([found.jacobian * ~stays, columns], axis=1)
    normal = x.T @ x + np.eye(x.shape[1]) / PRIOR_SIZES**2
    normal[:p, :p] += known.T @ known
    white = found.state.white
    step = np.linalg.solve(normal, x.T @ white)
    left = white - x @ step
    return float(white @ white - left @ left), np.where(stays, 0.0, step[:p])
