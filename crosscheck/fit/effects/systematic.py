"""How far fitted values would move if another effect were in the model (omitted-variable bias).

If a fit leaves structure, something else acts, and the fitted values have absorbed what it has in
common with them. The catalogue shows how much that may be: each effect is added to the model
linearised about the fit, and those that explain most of the remainder tell how far the values move.
"""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from crosscheck.fit.effects.candidates import candidates_for
from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.effects.starts import amplitude_columns
from crosscheck.fit.least_squares.known import known_readings
from crosscheck.fit.least_squares.problem import Problem
from seecr.pose import Array

# An effect counts if it explains more than this part of what the best one explains.
_PART_OF_BEST = 0.5


def moved_by_others(problem: Problem, found: Fit) -> Array:
    """How far each value moves (p,) when an effect is added that explains much of the remainder.

    It is the largest move among such effects, in the values' units; 0 for values that are fixed or
    on a bound. Arguments as in :func:`moved_together`.
    """
    return np.sqrt(np.diag(moved_together(problem, found)))


def moved_together(problem: Problem, found: Fit) -> Array:
    """The covariance (p, p) of such moves: what moves values alike leaves their difference known.

    A heavier platform seems to lower the tracker on both of two days by as much, and says nothing
    of how far it was moved in between. Effects with several shapes are only tried at the first one.

    Args:
        problem: the data.
        found: a fit that leaves more than noise.
    """
    every = moves_by_effect(problem, found).values()
    most = max((fall for fall, _move in every), default=0.0)
    some = [move for fall, move in every if fall > _PART_OF_BEST * most > 0.0]
    if not some:
        return np.zeros((len(found.terms), len(found.terms)))
    moves = np.array(some)
    largest, power = np.abs(moves).max(axis=0), np.sqrt((moves**2).sum(axis=0))
    alike = moves * np.divide(largest, power, out=np.zeros_like(power), where=power > 0.0)
    return np.asarray(alike.T @ alike)


def moves_by_effect(
    problem: Problem, found: Fit, names: Container[str] | None = None
) -> dict[str, tuple[float, Array]]:
    """Fall of chi2, and moves (p,) of the values in their units, as each effect is added.

    Args:
        problem: the data. found: a fit.
        names: of the effects that are asked; by default all that the model does not have.
    """
    out = {}
    for candidate in candidates_for(problem):
        layout = candidate.layout
        asked = names is None or layout.name in names
        if not asked or candidate.why_not is not None or layout.name in found.terms:
            continue
        for shape in layout.effect.shapes(found.state.prediction.setup)[:1]:
            columns = amplitude_columns(problem, found, layout, layout.start(shape)) * layout.scale
            fall, move = _with_columns(found, columns)
            out[layout.name] = fall, move * found.terms.scale
    return out


def _with_columns(found: Fit, columns: Array) -> tuple[float, Array]:
    """Fall of the linear model's chi2 with more columns (N, k), and the moves (p,) of z."""
    known, p = known_readings(found.terms)[0], len(found.terms)
    stays = found.at_bound | found.terms.knowledge.fixed
    x = np.concatenate([found.jacobian * ~stays, columns], axis=1)
    normal = x.T @ x + np.eye(x.shape[1]) / PRIOR_SIZES**2
    normal[:p, :p] += known.T @ known
    white = found.state.white
    step = np.linalg.solve(normal, x.T @ white)
    left = white - x @ step
    # values that stay have no columns, so their step is zero
    return float(white @ white - left @ left), step[:p]
