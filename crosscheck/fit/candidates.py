"""Which effects could be missing, where to start fitting each, and how it fits.

Ranking candidates by their derivative at null is confidently wrong where cables go slack, so
every candidate is fitted for itself; the derivative only chooses its starts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.fit.evidence import Evidence, evidence, p_value
from crosscheck.fit.gauss_newton import Fit, fit, projected
from crosscheck.fit.problem import Problem
from crosscheck.fit.starts import Starts, starts_of
from crosscheck.fit.state import evaluate
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array

# Most Gauss-Newton steps of a trial; what is chosen is fitted to the end.
_TRIAL_ITERATIONS = 12
# A chi2 of this many readings is noise, or nearly.
_WHITE = 1.3


@dataclass(eq=False)
class Candidate:
    """An effect that might be missing, and what came of adding it.

    Attributes:
        layout: the effect for this robot.
        fit: of the model with it added; None where it is no candidate.
        evidence: of that fit.
        drop: of chi2 against the model without it.
        p: chance of that drop where the effect is absent.
        why_not: a sentence where it is no candidate or was not chosen.
        starts: where to start fitting it.
    """

    layout: Layout
    fit: Fit | None = None
    evidence: Evidence | None = None
    drop: float = 0.0
    p: float = 1.0
    why_not: str = ""
    starts: Starts | None = None

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.layout.name


def layouts_for(problem: Problem) -> list[Candidate]:
    """All effects of the catalogue; those these data cannot show have a ``why_not``."""
    out = []
    for effect in catalogue().values():
        layout = layout_of(effect, problem.robot)
        out.append(Candidate(layout, why_not=_unfit(problem, layout)))
    return out


def _unfit(problem: Problem, layout: Layout) -> str:
    data, effect = problem.data, layout.effect
    rows = int(problem.use.sum())
    if len(layout) > problem.n_readings or len(layout) > 6 * rows or rows < 2:
        return f"no candidate: {len(layout)} parameters, but the data have {rows} rows"
    if rows < len(layout):
        return f"no candidate: {len(layout)} parameters, but the data have {rows} rows"
    if "poses" in effect.needs and data.command_pose is None:
        return "no candidate: needs commanded poses; these data command lengths"
    if "time" in effect.needs and (data.t_s is None or np.ptp(data.t_s) == 0):
        return "no candidate: needs the time of each row (t_s)"
    if "temperature" in effect.needs:
        if data.temperature_C is None:
            return "no candidate: needs temperature_C"
        if np.ptp(data.temperature_C) == 0:
            return "no candidate: the temperature never changed"
    if "tensions" in effect.needs and not data.has_tension:
        return "no candidate: needs measured tensions"
    return ""


def try_candidate(
    problem: Problem,
    base: Fit,
    layout: Layout,
    factor: Array,
    noise_scale: float = 1.0,
    hopeless: float = np.inf,
) -> Candidate:
    """Fit the base model with one effect added, from its most promising starts."""
    out = screen(problem, base, layout, factor, noise_scale)
    return out if out.why_not else fit_candidate(problem, base, out, factor, noise_scale, hopeless)


def screen(
    problem: Problem, base: Fit, layout: Layout, factor: Array, noise_scale: float = 1.0
) -> Candidate:
    """What the effect's derivative promises beside the base model; nothing is fitted."""
    out = Candidate(layout)
    out.starts = starts_of(problem, base, layout, factor)
    if not out.starts.seen:
        out.why_not = "these data do not show it: no reading moves by its plausible size"
        return out
    out.drop = out.starts.gain / noise_scale**2
    out.p = p_value(out.drop, out.starts.directions, False) * out.starts.shapes
    return out


def fit_candidate(
    problem: Problem,
    base: Fit,
    screened: Candidate,
    factor: Array,
    noise_scale: float = 1.0,
    hopeless: float = np.inf,
) -> Candidate:
    """Fit the base model with a screened effect added.

    Args:
        problem: the data.
        base: the model without the effect.
        screened: from :func:`screen`.
        factor: noise factors.
        noise_scale: noise in units of the stated one.
        hopeless: chi2 above which a trial is given up after a few steps.
    """
    layout, first = screened.layout, screened.starts
    assert first is not None
    out = Candidate(layout, starts=first)
    best: Fit | None = None
    for vector in first.vectors:
        if best is not None and best.chi2 < _WHITE * noise_scale**2 * len(best.state.white):
            break  # it leaves noise: no other start does better
        terms = base.terms.with_term(Term(layout, vector))
        try:
            found = fit(
                problem, terms, factor, base.state,
                iterations=_TRIAL_ITERATIONS, hopeless=hopeless, quick=True,
            )  # fmt: skip
        except (InputError, np.linalg.LinAlgError):
            continue
        if found.valid and (best is None or found.chi2 < best.chi2):
            best = found
            hopeless = min(hopeless, 2.0 * best.chi2)
    if best is None:
        out.why_not = "no fit: rows could not be solved with it"
        return out
    return judged(best, base, screened, noise_scale)


def judged(found: Fit, base: Fit, screened: Candidate, noise_scale: float) -> Candidate:
    """A candidate with its fit: how much better than without it, and by what chance."""
    layout, first = screened.layout, screened.starts
    assert first is not None
    columns = seen_directions(found, layout.name)
    one_sided = bool(np.isfinite(layout.lower[0])) and layout.lower[0] == layout.null[0]
    drop = (base.chi2 - found.chi2) / noise_scale**2
    p = p_value(drop, columns, one_sided) * first.shapes
    return Candidate(layout, found, evidence(found, noise_scale), drop, p, starts=first)


def seen_directions(found: Fit, name: str) -> int:
    """How many directions of an effect's parameters the data see beside the other terms."""
    own = found.terms.own(name)
    others = projected(found.jacobian[:, own], found.jacobian[:, ~own])
    power = np.linalg.eigvalsh(others.T @ others)
    return max(1, int(np.sum(power > 1e-2)))


def null_fit(problem: Problem, terms: Terms, factor: Array, refit: bool) -> Fit:
    """The model as it stands, as a fit: refitted, or at its stated values."""
    if refit and terms:
        return fit(problem, terms, factor)
    state = evaluate(problem, terms, factor)
    p = len(terms)
    jacobian = np.zeros((len(state.white), p))
    return Fit(state, jacobian, np.zeros((p, p)), np.zeros(p, dtype=bool), state.valid, "", 0)
