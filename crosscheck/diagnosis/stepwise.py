"""The stepwise search on real measurements, with outdated values of the model and outliers."""

from __future__ import annotations

from dataclasses import replace

from crosscheck.diagnosis.search import Search, search
from crosscheck.fit.effects.candidates import Trials, null_fit
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.least_squares.known import free_derivatives
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.noise.outliers import outlying_rows
from crosscheck.fit.noise.whiteness import whiteness
from crosscheck.fit.preparation.prepare import Progress
from seecr.pose import Array

# The model's values are refitted before the search if that lowers chi2 by this much.
_STALE_VALUES = 30.0

Notes = tuple[str, ...]


def by_steps(
    problem: Problem, base: Fit, factor: Array, progress: Progress
) -> tuple[Search, Notes]:
    """The stepwise search, and notes about what was done to model and data before it."""
    base, refitted = _at_its_best(problem, base, factor)
    found = search(Trials(problem, factor), base, progress)
    found, outliers = _without_outliers(found, base, progress)
    return found, (*refitted, *outliers)


def _at_its_best(problem: Problem, base: Fit, factor: Array) -> tuple[Fit, Notes]:
    """The model to start from, refitted if its values, which are of other data, fit badly here."""
    if not base.terms:
        return base, ()
    refitted = null_fit(problem, base.terms, factor, refit=True)
    if refitted.valid and refitted.chi2 < base.chi2 - _STALE_VALUES:
        return refitted, ("the model's values were refitted to these data before the search",)
    return _with_derivatives(problem, base), ()


def _with_derivatives(problem: Problem, base: Fit) -> Fit:
    return replace(base, derive=lambda: free_derivatives(problem, base.state))


def _without_outliers(found: Search, base: Fit, progress: Progress) -> tuple[Search, Notes]:
    """Repeat the search without isolated outliers, if there are a few, and name them."""
    problem, state = found.problem, found.last.fit.state
    rows = outlying_rows(problem, state)
    if not rows.any():
        return found, ()
    note = f"{problem.data.lines_of(rows)} left out as outliers"
    cleaned = problem.without(rows, note)
    kept = ~rows[problem.row_of]
    if whiteness(cleaned, state.white[kept], found.last.evidence.parameters).structured:
        # the other rows are not noise either, so that outliers are part of the unexplained
        return found, ()
    again = null_fit(cleaned, base.terms, found.factor, refit=False)
    if base.terms:
        again = _with_derivatives(cleaned, again)
    better = search(replace(found.trials, problem=cleaned), again, progress)
    if better.found != found.found:
        with_all = ", ".join(found.found) or "nothing"
        note += f" (with them, the search finds {with_all})"
    return better, (note,)
