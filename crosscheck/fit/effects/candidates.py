"""Tries each effect of the catalogue as a candidate for what the model misses.

Every candidate is fitted in full beside the model. A ranking by derivatives at the null values
would be confidently wrong where cables go slack, so derivatives only choose the starting points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.effects.evidence import Evidence, evidence, p_value
from crosscheck.fit.effects.gauss_newton import Fit, FitStatus, fit, not_fitted
from crosscheck.fit.effects.possible import can_be
from crosscheck.fit.effects.starts import Starts, starts_of
from crosscheck.fit.least_squares.imitation import beside
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, evaluate
from crosscheck.fit.noise.whiteness import Whiteness, whiteness
from crosscheck.fit.reasons import Reason, Why
from crosscheck.measurements.data import Measurements
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array

# Most Gauss-Newton steps of a trial; the candidate that is chosen is fitted to convergence later.
_TRIAL_ITERATIONS = 12
# A fit with chi2 below this many times the number of readings leaves hardly more than noise.
_WHITE = 1.3
# The data see a direction if a plausible size of it has a squared signal above this many noise
# variances.
_SEEN = 1e-2


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that might be missing, and the fit of the model with it.

    Attributes:
        layout: the effect's parameters for this robot.
        fit: the model with the effect added; None if it was not fitted.
        evidence: the evidence of that fit.
        drop: how far chi2 falls against the model without the effect; before the fit, how far it
            should fall by the derivatives.
        p: p-value of that drop; in the search by steps times the effective number of shapes, which
            may exceed 1.
        why_not: why the effect cannot be a candidate or was not chosen; None if it can be.
        starts: starting points of the fit.
        alone: the effect with the values that it would need by itself, if it was not fitted.
    """

    layout: Layout
    fit: Fit | None = None
    evidence: Evidence | None = None
    drop: float = 0.0
    p: float = 1.0
    why_not: Reason | None = None
    starts: Starts | None = None
    alone: Term | None = None

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.layout.name

    def refused(self, reason: Reason) -> Candidate:
        """The same candidate, with the reason why it is not chosen."""
        return replace(self, why_not=reason)


def candidates_for(problem: Problem) -> list[Candidate]:
    """All effects of the catalogue; ``why_not`` is set for those that these data cannot show."""
    layouts = [layout_of(effect, problem.robot) for effect in catalogue().values()]
    return [Candidate(layout, why_not=_lacking(problem, layout)) for layout in layouts]


def _lacking(problem: Problem, layout: Layout) -> Reason | None:
    """The first thing that the effect needs and the data lack; None if they lack nothing."""
    rows = int(problem.use.sum())
    if layout.name not in problem.considered:
        return Reason(Why.EXCLUDED)
    if len(layout) > min(problem.n_readings, rows) or rows < 2:
        return Reason(Why.TOO_MANY_PARAMETERS, parameters=len(layout), rows=rows)
    return input_lacking(problem.data, layout)


def input_lacking(data: Measurements, layout: Layout) -> Reason | None:
    """The first column that the effect depends on and the data do not have; None if it is there."""
    needs = layout.effect.needs
    still = data.temperature_C is not None and np.ptp(data.temperature_C) == 0
    timeless = data.t_s is None or np.ptp(data.t_s) == 0
    lacks = (
        ("poses", data.absolute, Why.NEEDS_POSES),
        ("time", timeless, Why.NEEDS_TIME),
        ("temperature", data.temperature_C is None, Why.NEEDS_TEMPERATURE),
        ("temperature", still, Why.CONSTANT_TEMPERATURE),
        ("tensions", not data.has_tension, Why.NEEDS_TENSIONS),
    )
    return next((Reason(why) for need, lacking, why in lacks if need in needs and lacking), None)


@dataclass(frozen=True, eq=False)
class Trials:
    """The data, and the functions by which effects are tried on them.

    Attributes:
        problem: the data. factor: noise factors, see :meth:`Problem.noise`.
        fit, starts, candidates: by default :func:`crosscheck.fit.effects.gauss_newton.fit`,
            :func:`crosscheck.fit.effects.starts.starts_of` and :func:`candidates_for`. The search
            reaches the robot only through these, so that other functions can take their place.
    """

    problem: Problem
    factor: Array
    fit: Callable[..., Fit] = fit
    starts: Callable[..., Starts] = starts_of
    candidates: Callable[[Problem], list[Candidate]] = candidates_for

    def refit(self, terms: Terms, near: State | None, **options: Any) -> Fit:
        """Fit terms, starting from their values; ``near`` is a solved state close to them."""
        return self.fit(self.problem, terms, self.factor, near, **options)

    def evidence(self, found: Fit) -> Evidence:
        """Evidence of a fit."""
        return evidence(found, self.problem.data.free)

    def whiteness(self, found: Fit, parameters: int) -> Whiteness:
        """Test the residuals of a fit with this many parameters for being white noise."""
        return whiteness(self.problem, found.state.white, parameters)


def try_candidate(trials: Trials, base: Fit, layout: Layout, hopeless: float = np.inf) -> Candidate:
    """Fit the base model with one effect added, from its most promising starting points."""
    out = screen(trials, base, layout)
    return out if out.why_not is not None else fit_candidate(trials, base, out, hopeless)


def screen(trials: Trials, base: Fit, layout: Layout) -> Candidate:
    """The fall of chi2 that the derivatives of an effect promise beside the base model.

    Nothing is fitted.
    """
    starts = trials.starts(trials.problem, base, layout, trials.factor)
    out = Candidate(layout, starts=starts)
    if not starts.seen:
        return out.refused(Reason(Why.UNSEEN))
    drop = starts.gain
    chance = p_value(drop, starts.directions, False) * starts.shapes
    return replace(out, drop=drop, p=min(1.0, chance))


def fit_candidate(
    trials: Trials, base: Fit, screened: Candidate, hopeless: float = np.inf
) -> Candidate:
    """Fit the base model with a screened effect added.

    Args:
        trials: the problem and its noise.
        base: the model without the effect.
        screened: the result of :func:`screen`.
        hopeless: a trial that is above this chi2 after a few steps is given up.
    """
    layout, starts = screened.layout, screened.starts
    assert starts is not None
    best, impossible = None, False
    for vector in starts:
        try:
            found = trials.refit(
                base.terms.with_term(Term(layout, vector)), base.state,
                iterations=_TRIAL_ITERATIONS, hopeless=hopeless, quick=True,
            )  # fmt: skip
        except (InputError, np.linalg.LinAlgError):
            continue
        if found.valid and not can_be(trials.problem.robot, found.terms, base.terms):
            impossible = True
        elif found.valid and (best is None or found.chi2 < best.chi2):
            best = found
            hopeless = min(hopeless, 2.0 * best.chi2)
            if best.chi2 < _WHITE * len(best.state.white):
                break  # it leaves only noise: no other start can do better
    if best is None:
        why = Why.IMPOSSIBLE if impossible else Why.UNSOLVED
        return Candidate(layout, starts=starts, why_not=Reason(why))
    return judged(trials, best, base, screened)


def judged(trials: Trials, found: Fit, base: Fit, screened: Candidate) -> Candidate:
    """A candidate with its fit: the fall of chi2 against the base model, its p-value, evidence."""
    layout, starts = screened.layout, screened.starts
    assert starts is not None
    one_sided = bool(np.isfinite(layout.lower[0])) and layout.lower[0] == layout.null[0]
    drop = base.chi2 - found.chi2
    own = found.terms.own(layout.name)
    p = p_value(drop, seen_directions(found, own), one_sided) * starts.shapes
    return Candidate(layout, found, trials.evidence(found), drop, p, starts=starts)


def seen_directions(found: Fit, own: NDArray[np.bool_]) -> int:
    """How many directions of some parameters (p,) the data see beside the other parameters."""
    columns = beside(found.jacobian[:, own], found.spanned(~own))
    return max(1, int(np.sum(np.linalg.eigvalsh(columns.T @ columns) > _SEEN)))


def null_fit(problem: Problem, terms: Terms, factor: Array, refit: bool) -> Fit:
    """The model as it stands, in the form of a fit: refitted, or at its stated values."""
    if refit and terms:
        return fit(problem, terms, factor)
    state = evaluate(problem, terms, factor)
    status = FitStatus.SOLVED if state.valid else FitStatus.UNSOLVED_AT_VALUES
    return not_fitted(state, status, 0.0)
