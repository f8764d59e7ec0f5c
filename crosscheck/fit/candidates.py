"""Which effects could be missing, and how each fits beside a model.

Ranking candidates by their derivative at null is confidently wrong where cables go slack, so
every candidate is fitted for itself; the derivative only chooses its starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.evidence import Evidence, evidence, p_value
from crosscheck.fit.gauss_newton import Fit, FitStatus, fit
from crosscheck.fit.imitation import beside
from crosscheck.fit.noise import Whiteness, whiteness
from crosscheck.fit.possible import can_be
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Reason, Why
from crosscheck.fit.starts import Starts, starts_of
from crosscheck.fit.state import State, evaluate
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array

# Most Gauss-Newton steps of a trial; what is chosen is fitted to the end.
_TRIAL_ITERATIONS = 12
# A chi2 of this many readings is noise, or nearly.
_WHITE = 1.3
# A direction that the data see: squared signal of a plausible size, in units of the noise.
_SEEN = 1e-2


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that might be missing, and how the model with it fits.

    Attributes:
        layout: the effect for this robot.
        fit: of the model with it added; None where it was not fitted.
        evidence: of that fit.
        drop: of chi2 against the model without it.
        p: chance of that drop where the effect is absent.
        why_not: the reason why it is no candidate or was not chosen; None where it may be.
        starts: where to start fitting it.
        alone: the effect with the values it would need by itself, where it was not fitted.
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
        """The same with the reason why it is not chosen."""
        return replace(self, why_not=reason)


def candidates_for(problem: Problem) -> list[Candidate]:
    """All effects of the catalogue; those these data cannot show have a ``why_not``."""
    layouts = [layout_of(effect, problem.robot) for effect in catalogue().values()]
    return [Candidate(layout, why_not=_lacking(problem, layout)) for layout in layouts]


def _lacking(problem: Problem, layout: Layout) -> Reason | None:
    """What the data lack that the effect needs."""
    data, needs = problem.data, layout.effect.needs
    rows = int(problem.use.sum())
    if layout.name not in problem.considered:
        return Reason(Why.EXCLUDED)
    if len(layout) > min(problem.n_readings, rows) or rows < 2:
        return Reason(Why.TOO_MANY_PARAMETERS, parameters=len(layout), rows=rows)
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
    """How effects are tried on a problem.

    Attributes:
        problem: the data. factor: noise factors, :meth:`Problem.noise`.
        fit, starts, candidates: the functions :func:`crosscheck.fit.gauss_newton.fit`,
            :func:`crosscheck.fit.starts.starts_of` and :func:`candidates_for`, or others of
            their kind: the search takes no other way to the robot.
    """

    problem: Problem
    factor: Array
    fit: Callable[..., Fit] = fit
    starts: Callable[..., Starts] = starts_of
    candidates: Callable[[Problem], list[Candidate]] = candidates_for

    def refit(self, terms: Terms, near: State | None, **options: Any) -> Fit:
        """Fit terms from their values, from a state near them."""
        return self.fit(self.problem, terms, self.factor, near, **options)

    def evidence(self, found: Fit) -> Evidence:
        """Of a fit."""
        return evidence(found)

    def whiteness(self, found: Fit, parameters: int) -> Whiteness:
        """Test of what a fit of so many directions leaves."""
        return whiteness(self.problem, found.state.white, parameters)


def try_candidate(trials: Trials, base: Fit, layout: Layout, hopeless: float = np.inf) -> Candidate:
    """Fit the base model with one effect added, from its most promising starts."""
    out = screen(trials, base, layout)
    return out if out.why_not is not None else fit_candidate(trials, base, out, hopeless)


def screen(trials: Trials, base: Fit, layout: Layout) -> Candidate:
    """What the effect's derivative promises beside the base model; nothing is fitted."""
    starts = trials.starts(trials.problem, base, layout, trials.factor)
    out = Candidate(layout, starts=starts)
    if not starts.seen:
        return out.refused(Reason(Why.UNSEEN))
    drop = starts.gain
    return replace(out, drop=drop, p=p_value(drop, starts.directions, False) * starts.shapes)


def fit_candidate(
    trials: Trials, base: Fit, screened: Candidate, hopeless: float = np.inf
) -> Candidate:
    """Fit the base model with a screened effect added.

    Args:
        trials: the problem and its noise.
        base: the model without the effect.
        screened: from :func:`screen`.
        hopeless: chi2 above which a trial is given up after a few steps.
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
                break  # it leaves noise: no other start does better
    if best is None:
        why = Why.IMPOSSIBLE if impossible else Why.UNSOLVED
        return Candidate(layout, starts=starts, why_not=Reason(why))
    return judged(trials, best, base, screened)


def judged(trials: Trials, found: Fit, base: Fit, screened: Candidate) -> Candidate:
    """A candidate with its fit: how much better than without it, and by what chance."""
    layout, starts = screened.layout, screened.starts
    assert starts is not None
    one_sided = bool(np.isfinite(layout.lower[0])) and layout.lower[0] == layout.null[0]
    drop = base.chi2 - found.chi2
    own = found.terms.own(layout.name)
    p = p_value(drop, seen_directions(found, own), one_sided) * starts.shapes
    return Candidate(layout, found, trials.evidence(found), drop, p, starts=starts)


def seen_directions(found: Fit, own: NDArray[np.bool_]) -> int:
    """How many directions of some parameters (p,) the data see beside the others."""
    columns = beside(found.jacobian[:, own], found.spanned(~own))
    return max(1, int(np.sum(np.linalg.eigvalsh(columns.T @ columns) > _SEEN)))


def null_fit(problem: Problem, terms: Terms, factor: Array, refit: bool) -> Fit:
    """The model as it stands, as a fit: refitted, or at its stated values."""
    if refit and terms:
        return fit(problem, terms, factor)
    state = evaluate(problem, terms, factor)
    p = len(terms)
    status = FitStatus.SOLVED if state.valid else FitStatus.UNSOLVED_AT_VALUES
    return Fit(
        state,
        lambda: np.zeros((len(state.white), p)),
        lambda _nothing: np.zeros((p, p)),
        np.zeros(p, dtype=bool),
        status,
        0,
    )
