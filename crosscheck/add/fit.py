"""Fit effects to measurements, together with those a model has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeAlias

from crosscheck.add.result import Addition
from crosscheck.add.weigh import base_of, weigh
from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.candidates import Trials, candidates_for, try_candidate
from crosscheck.fit.gauss_newton import Fit, fit
from crosscheck.fit.prepare import Progress, outlying_rows, prepare
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Why
from crosscheck.fit.state import State
from crosscheck.given import GivenModel, GivenRobot, basis_of, model_of, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from seecr.effects import ApartLayout, Own, Term, Terms, effect_named, layout_of
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.prediction.model import no_effects

# Steps of a fit, and how often it may go on after that many.
_STEPS, _TIMES = 40, 2

Fitter: TypeAlias = Callable[[Problem, Terms, Array], Fit]
"""Fits effects to a problem, given those of the model and the noise."""


def add_effect(
    robot: GivenRobot,
    data: GivenData,
    name: str,
    model: GivenModel = (),
    progress: Progress = lambda _text, _part: None,
    *,
    per: str | None = None,
) -> Addition:
    """Fit an effect to data, jointly with those the model has.

    Args:
        robot: as described, or its MJCF.
        data: measurements, or their file.
        name: of the effect.
        model: effects of the model, or their file; where the named one is among them it is
            fitted again. The plain model without.
        progress: called with what is being done and the part of it that is done.
        per: "file" or "run" gives the effect values of its own for each; so it has where the model
            says so of it.

    Raises:
        InputError: no effect of that name, or ``per`` is neither.
        CrosscheckError: the data cannot carry it.
        UnsolvedError: rows have no equilibrium, or the fit does not come to an end.
    """
    robot = robot_of(robot)
    layout = layout_of(effect_named(name), robot)

    def fitter(problem: Problem, terms: Terms, factor: Array) -> Fit:
        return _fitted(problem, terms, layout, factor)

    return _added(robot, data, [layout], model, progress, fitter, per)


def add_effects(
    robot: GivenRobot,
    data: GivenData,
    effects: Iterable[Term],
    model: GivenModel = (),
    progress: Progress = lambda _text, _part: None,
) -> Addition:
    """Fit several effects to data at once, from the values that they have.

    Args:
        robot: as described, or its MJCF.
        data: measurements, or their file.
        effects: such as ``diagnose(...).terms``.
        model: effects of the model, or their file; the plain model without.
        progress: called with what is being done and the part of it that is done.

    Raises:
        CrosscheckError: there are none, or the data cannot carry them.
        UnsolvedError: rows have no equilibrium, or the fit does not come to an end.
    """
    some = list(effects) if isinstance(effects, Iterable) else [effects]
    wrong = [one for one in some if not isinstance(one, Term)]
    if wrong:
        raise no_effects(wrong[0])
    if not some:
        raise CrosscheckError("no effects were given; there is nothing to add")

    def fitter(problem: Problem, terms: Terms, factor: Array) -> Fit:
        every = {term.name: term for term in (*terms, *some)}
        known = {term.name: term for term in terms if term.knowledge.any}
        return _to_the_end(problem, Terms((every | known).values()), factor)

    return _added(robot, data, [term.layout for term in some], model, progress, fitter)


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
    outliers = outlying_rows(problem, best.state)
    if outliers.any():
        words = f"{data.lines_of(outliers)} left out: outliers, far off the others"
        notes.append(words)
        problem = problem.without(outliers, words)
        best = fitter(problem, terms, factor)
    progress("predicting runs left out", 0.6)
    # what belongs to files or runs was fitted to them already: before that it was not there
    before = terms.only(name for name in terms.names if name in had or name not in names)
    return weigh(problem, before, names, factor, best, notes, basis_of(model, robot))


def _apart(terms: Terms, layout: Layout, kind: str) -> Term:
    """An effect that is to have values of its own for each file or run."""
    term = terms[layout.name] if layout.name in terms else Term(layout, layout.null)
    known = term.own is not None and term.own.kind == kind
    return term if known else replace(term, own=Own(kind, {}))


def _refuse(problem: Problem, layout: Layout) -> None:
    reason = next(c.why_not for c in candidates_for(problem) if c.name == layout.name)
    if reason is not None:
        raise CrosscheckError(f"{problem.data.path} cannot carry {layout.name}: {reason.words}")


def _fitted(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The best joint fit, from where the effect stands and from its most promising starts."""
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
        raise kind(f"{problem.data.path} cannot carry {layout.name}: {why}")
    return min(good, key=lambda found: found.chi2)


def _is_placed(term: Term) -> bool:
    """Whether what is known of an effect, or of its files or runs, says where to look for it."""
    return term.knowledge.any or isinstance(term.layout, ApartLayout)


def _to_the_end(problem: Problem, terms: Terms, factor: Array, near: State | None = None) -> Fit:
    """A fit that came to an end, however many steps that takes within reason."""
    found = fit(problem, terms, factor, near, iterations=_STEPS)
    for _ in range(_TIMES):
        if found.settled:
            break
        found = fit(problem, found.terms, factor, found.state, iterations=_STEPS)
    return found
