"""Pairs of effects that together explain what one listed effect explains.

The steps add one effect at a time and end where it leaves noise. But a force and a moment on the
platform are also what a heavier platform pulls whose centre of mass is elsewhere, or softer cables
on a frame that is not level: two effects with as few values, neither of which is found by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.sets.equals import BY_CHANCE
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.candidates import Trials
from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.effects.possible import can_be
from crosscheck.fit.effects.starts import UNSEEN, amplitude_columns
from crosscheck.fit.least_squares.definite import solved
from crosscheck.fit.least_squares.state import evaluate
from seecr.effects import Term, Terms
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array

# A pair explains as much if its chi2 is larger by no more than chance may bring.
_AS_MUCH = 2.0 * BY_CHANCE
# It is fitted if straight lines promise as much, or nearly all of what the listed effect explains:
# they are far off where a frame is out of level by degrees.
_NEARLY = 0.02
# On a robot that moves in a plane, no more than three of a pose's values are seen.
_POSE = 6
# Most pairs that are fitted in place of one effect.
_FITTED = 3
# Most steps of such a fit.
_STEPS = 20


@dataclass(frozen=True, eq=False)
class _Columns:
    """An effect that is not in the model, as straight lines about it.

    Attributes:
        layout: its parameters. null: (p,) values at which it does nothing.
        white: (N, k) change of the whitened readings by a plausible size of each that is seen.
        own: (k,) which parameters these are.
    """

    layout: Layout
    null: Array
    white: Array
    own: NDArray[np.intp]

    def at(self, z: Array) -> Term:
        """The effect with so many plausible sizes (k,) of these parameters."""
        vector = self.null.copy()
        vector[self.own] += z * self.layout.scale[self.own]
        return Term(self.layout, np.clip(vector, self.layout.lower, self.layout.upper))


def pairs_instead(found: Search) -> list[Terms]:
    """Models in which two effects explain as much as one that the steps added, refitted.

    Only effects with two values or more are asked, and pairs that need no more of them.
    """
    fit, trials = found.last.fit, found.trials
    some = {name: _seen(fit, name) for name in found.found}
    largest = max(some.values(), default=0)
    if largest < 2:
        return []
    others = list(_others(trials, fit, max(largest, _POSE)))
    return [pair for name, most in some.items() if most > 1
            for pair in _pairs(trials, fit, name, most, others)]  # fmt: skip


def _seen(fit: Fit, name: str) -> int:
    """How many values of an effect of the model move a reading."""
    own = np.flatnonzero(fit.terms.own(name))
    return int(np.sum(np.max(np.abs(fit.jacobian[:, own]), axis=0, initial=0.0) > UNSEEN))


def _others(trials: Trials, fit: Fit, most: int) -> Iterator[_Columns]:
    """The effects of up to so many values that the model does not have, at their first shapes."""
    for one in trials.candidates(trials.problem):
        layout = one.layout
        absent = one.why_not is None and layout.name not in fit.terms
        if not absent or np.sum(~layout.shape) > most:
            continue
        for shape in layout.effect.shapes(fit.state.prediction.setup)[:1]:
            null = layout.start(shape)
            white = amplitude_columns(trials.problem, fit, layout, null) * layout.scale
            own = np.flatnonzero(np.max(np.abs(white), axis=0, initial=0.0) > UNSEEN)
            if len(own):
                yield _Columns(layout, null, white[:, own], own)


def _pairs(
    trials: Trials, fit: Fit, name: str, most: int, others: list[_Columns]
) -> Iterator[Terms]:
    """The pairs that explain as much as an effect of the model, with ``most`` values or fewer."""
    rest = Terms(term for term in fit.terms if term.name != name)
    without = evaluate(trials.problem, rest, trials.factor, fit.state)
    if not without.valid:
        return
    least = fit.chi2 + max(_AS_MUCH, _NEARLY * (without.chi2 - fit.chi2))
    kept = fit.jacobian[:, ~fit.terms.own(name)]
    promised = []
    for one, other in combinations(others, 2):
        if len(one.own) + len(other.own) <= most:
            z, chi2 = _linear([kept, one.white, other.white], without.white)
            if chi2 < least:
                promised.append((chi2, one, other, z[kept.shape[1] :]))
    promised.sort(key=lambda row: row[0])
    for _chi2, one, other, z in promised[:_FITTED]:
        two = [one.at(z[: len(one.own)]), other.at(z[len(one.own) :])]
        pair = _fitted(trials, fit, Terms([*rest, *two]))
        if pair is not None:
            yield pair


def _linear(columns: list[Array], white: Array) -> tuple[Array, float]:
    """Values of columns that explain residuals (N,) most, with weak priors, and the chi2 left."""
    x = np.concatenate(columns, axis=1)
    z = solved(x.T @ x + np.eye(x.shape[1]) / PRIOR_SIZES**2, x.T @ white)
    left = white - x @ z
    return z, float(left @ left)


def _fitted(trials: Trials, fit: Fit, start: Terms) -> Terms | None:
    """A model fitted from a start, if it can be and explains as much as another fit."""
    try:
        # sets are compared later from where this ends: it need not be exact
        out = trials.refit(start, fit.state, iterations=_STEPS, quick=True)
    except (InputError, np.linalg.LinAlgError):  # a law of the user's own that refuses values
        return None
    good = out.valid and can_be(trials.problem.robot, out.terms, fit.terms)
    return out.terms if good and out.chi2 < fit.chi2 + _AS_MUCH else None
