"""Fits effects to measurements, together with those that a model has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np

from crosscheck.add.result import Addition
from crosscheck.add.weigh import base_of, weigh, whiteness_of
from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.effects.candidates import Trials, candidates_for, try_candidate
from crosscheck.fit.effects.gauss_newton import Fit, fit
from crosscheck.fit.least_squares.known import firmer
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State
from crosscheck.fit.noise.outliers import outlying_rows
from crosscheck.fit.preparation.prepare import Progress, prepare
from crosscheck.fit.reasons import Why
from crosscheck.given import GivenModel, GivenRobot, basis_of, model_of, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from seecr.arguments import silent
from seecr.description.robot import Robot
from seecr.effects import ApartLayout, Own, Term, Terms, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array

# Steps of a fit, and how often it may be continued after that many.
_STEPS, _TIMES = 40, 2
# Most times that outliers are looked for. A tracker that throws one row in ten far off has more
# than that now and then; the diagnosis allows as many.
_PASSES, _MOST_OUTLIERS = 3, 0.15


@runtime_checkable
class HasTerms(Protocol):
    """A result with effects and their values, such as a diagnosis."""

    @property
    def terms(self) -> Terms:
        """The effects."""


GivenSeveral: TypeAlias = Iterable[Term | str] | str | HasTerms
"""Names of effects, effects with their values, or a result that has some."""

Fitter: TypeAlias = Callable[[Problem, Terms, Array], Fit]
"""Fits effects to a problem, given the effects of the model and the noise."""


def add_effect(
    robot: GivenRobot,
    data: GivenData,
    name: str,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    per: str | None = None,
) -> Addition:
    """Fit an effect to data, jointly with those that the model has.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        name: name of the effect.
        model: effects of the model, or their file; by default the plain model. If the named effect
            is among them, it is fitted again.
        progress: called with what is being done and the fraction that is done.
        per: "file" or "run" gives the effect separate values for each; by default it has them if
            the model says so.

    Raises:
        InputError: there is no effect of that name, or ``per`` is neither.
        CrosscheckError: the data do not allow the fit.
        UnsolvedError: rows have no equilibrium, or the fit does not converge.
    """
    robot = robot_of(robot)
    layout = layout_of(name, robot)

    def fitter(problem: Problem, terms: Terms, factor: Array) -> Fit:
        return _fitted(problem, terms, layout, factor)

    return _added(robot, data, [layout], model, progress, fitter, per)


def add_effects(
    robot: GivenRobot,
    data: GivenData,
    effects: GivenSeveral,
    model: GivenModel = (),
    progress: Progress = silent,
) -> Addition:
    """Fit several effects to data at once, starting from the values that they have.

    Effects that are only named have none: they are fitted one after the other beside the others,
    from their most promising starts, and then all at once.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        effects: names of effects, or effects with their values, or a result such as a diagnosis.
        model: effects of the model, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.

    Raises:
        InputError: there is no effect of a name, or something else than effects was given.
        CrosscheckError: no effects were given, or the data do not allow the fit.
        UnsolvedError: rows have no equilibrium, or the fit does not converge.
    """
    robot = robot_of(robot)
    valued, named = _several(effects, robot)

    def fitter(problem: Problem, terms: Terms, factor: Array) -> Fit:
        every = {term.name: term for term in (*terms, *valued)}
        known = {term.name: term for term in terms if term.knowledge.any}
        start = Terms((every | known).values())
        if not named:
            return _to_the_end(problem, start, factor)
        for layout in named:
            best = _fitted(problem, start, layout, factor)
            start = best.terms
        return best

    layouts = [*(term.layout for term in valued), *named]
    return _added(robot, data, layouts, model, progress, fitter)


def _several(effects: GivenSeveral, robot: Robot) -> tuple[list[Term], list[Layout]]:
    """Effects with values, and parameters of those that are only named.

    Raises:
        InputError: there is no effect of a name, or something else was given.
        CrosscheckError: nothing was given.
    """
    given = effects.terms if isinstance(effects, HasTerms) else effects
    some = [given] if isinstance(given, str) or not isinstance(given, Iterable) else list(given)
    wrong = [one for one in some if not isinstance(one, Term | str)]
    if wrong:
        raise InputError(
            "expected names of effects, effects with their values, or a result such as a "
            f"diagnosis, got {type(wrong[0]).__name__}"
        )
    if not some:
        raise CrosscheckError("expected at least one effect to add, got none")
    valued = [one for one in some if isinstance(one, Term)]
    has = {term.name for term in valued}
    names = dict.fromkeys(one for one in some if isinstance(one, str) and one not in has)
    return valued, [layout_of(name, robot) for name in names]


def _added(
    robot: GivenRobot, data: GivenData, layouts: Sequence[Layout],
    model: GivenModel, progress: Progress, fitter: Fitter, per: str | None = None,
) -> Addition:  # fmt: skip
    robot = robot_of(robot)
    data = measurements_of(data, robot)
    terms, said = model_of(model, robot)
    names = [layout.name for layout in layouts]
    had = terms.names
    if per is not None:
        terms = Terms([*terms.without(names[0]), _apart(terms, layouts[0], per)])
    ready = prepare(robot, data, terms)
    problem, notes = ready.problem, [*said, *ready.all_notes]
    if ready.refusal is not None:
        kind = UnsolvedError if ready.refusal.unsolved else CrosscheckError
        why = f"{ready.refusal}; {' + '.join(names)} was not fitted: {ready.refusal.remedy}"
        raise kind(f"{data.path}: {why}")
    terms = ready.terms
    for layout in layouts:
        _refuse(problem, layout)
    progress(f"fitting {' + '.join(names)}", 0.0)
    factor = problem.noise(problem.experiment.predict(terms.effects))
    best = fitter(problem, terms, factor)
    progress("looking for outliers", 0.4)
    cleaned, best = _without_outliers(problem, best, lambda some: fitter(some, terms, factor))
    notes += cleaned.left_out[len(problem.left_out) :]
    problem = cleaned
    firmness = _firmness(problem, best)
    if firmness > 1.0:
        terms = firmer(terms, firmness)
        best = fitter(problem, terms, factor)
    progress("predicting held-out runs", 0.6)
    # effects that are free in the data were fitted in advance: they are not in the model before
    before = terms.only(name for name in terms.names if name in had or name not in names)
    return weigh(problem, before, names, factor, best, notes, basis_of(model, robot), firmness)


def _without_outliers(
    problem: Problem, best: Fit, again: Callable[[Problem], Fit]
) -> tuple[Problem, Fit]:
    """The problem without isolated outliers, and the fit to the rest of its rows.

    One in ten rows may be far off, so that two neighbours now and then both are; one that is much
    less so is seen without the other.
    """
    out = np.zeros(problem.data.n_rows, dtype=bool)
    cleaned = problem
    for _ in range(_PASSES):
        more = outlying_rows(cleaned, best.state, _MOST_OUTLIERS, together=2)
        if not more.any():
            break
        out |= more
        cleaned = problem.without(out, f"{problem.data.lines_of(out)} left out as outliers")
        best = again(cleaned)
    return cleaned, best


def _firmness(problem: Problem, best: Fit) -> float:
    """How much firmer than the data, compared with what is stated, independent values count."""
    if not best.terms.knowledge.measured.any():
        return 1.0
    white = whiteness_of(problem, best)
    return 1.0 if white.is_noise else white.inflation


def _apart(terms: Terms, layout: Layout, kind: str) -> Term:
    """An effect with separate values for each file or run."""
    term = terms[layout.name] if layout.name in terms else Term(layout, layout.null)
    known = term.own is not None and term.own.kind == kind
    return term if known else replace(term, own=Own(kind, {}))


def _refuse(problem: Problem, layout: Layout) -> None:
    reason = next(c.why_not for c in candidates_for(problem) if c.name == layout.name)
    if reason is not None:
        raise CrosscheckError(
            f"{problem.data.path}: {layout.name} cannot be fitted to these data: {reason.words}"
        )


def _fitted(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The best joint fit, from the effect's present values and its most promising starts."""
    fits = [_to_the_end(problem, terms, factor)] if layout.name in terms else []
    if fits and fits[0].valid and _is_placed(terms[layout.name]):
        return fits[0]
    base = base_of(problem, terms, [layout.name], factor)
    tried = try_candidate(Trials(problem, factor), base, layout)
    if tried.fit is not None:
        fits.append(_to_the_end(problem, tried.fit.terms, factor, tried.fit.state))
    good = [found for found in fits if found.valid]
    if not good:
        reason = tried.why_not
        unsolved = reason is None or reason.why is Why.UNSOLVED
        kind = UnsolvedError if unsolved else CrosscheckError
        why = reason or fits[0].status.value
        raise kind(f"{problem.data.path}: {layout.name} cannot be fitted to these data: {why}")
    return min(good, key=lambda found: found.chi2)


def _is_placed(term: Term) -> bool:
    """Whether an independent measurement, or separate values, tell where to start the fit."""
    return term.knowledge.any or isinstance(term.layout, ApartLayout)


def _to_the_end(problem: Problem, terms: Terms, factor: Array, near: State | None = None) -> Fit:
    """A fit that is continued until it converges, a few times at most."""
    found = fit(problem, terms, factor, near, iterations=_STEPS)
    for _ in range(_TIMES):
        if found.settled:
            break
        found = fit(problem, found.terms, factor, found.state, iterations=_STEPS)
    return found
