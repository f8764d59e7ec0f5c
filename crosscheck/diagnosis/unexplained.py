"""Where structure is left that no effect explains: what the data warrant all the same.

The effects are added one at a time; listed is what is small, of a size that happens, takes away
most of what was unexplained, and does more than any smooth field over the workspace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from crosscheck.comparison.associations import Association, associations
from crosscheck.diagnosis.advice import check_of, measure_next
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.result import Diagnosis, MissingEffect, NotListed
from crosscheck.diagnosis.rivals import Rival, rivals_of
from crosscheck.diagnosis.search import Search, search
from crosscheck.diagnosis.small import is_plausible, share_of, small_effects_alone
from crosscheck.diagnosis.words import and_what_is_left, words_of
from crosscheck.fit.candidates import Candidate, Trials, null_fit
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.known import free_derivatives
from crosscheck.fit.noise import whiteness
from crosscheck.fit.prepare import Progress, noise_floor, outlying_rows
from crosscheck.fit.problem import Problem, rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from crosscheck.fit.smooth import beyond_smooth
from seecr.pose import Array

# An effect is listed only if it has few parameters and took away most of what was unexplained;
# by itself, two thirds of all and then a third of the rest.
_FEW_PARAMETERS, _LEAST_SHARE, _LEAST_ALONE = 3, 0.5, (2.0 / 3.0, 1.0 / 3.0)
# The model's values are refitted before the search where that takes away so much chi2.
_STALE_VALUES = 30.0
# What the unexplained part goes with is said of so many quantities.
_MOST_WHERE = 5
# Noise up to this many times the stated one is noise that was stated too small.
_UNDERSTATED = 3.0

Notes = tuple[str, ...]


def by_steps(
    problem: Problem, base: Fit, factor: Array, progress: Progress
) -> tuple[Search, Notes]:
    """Effects added one at a time, and what was done to the data on the way."""
    base, refitted = _at_its_best(problem, base, factor)
    found = search(Trials(problem, factor), base, progress)
    found, outliers = _without_outliers(found, base, progress)
    found, larger = _with_larger_noise(found, progress)
    return found, (*refitted, *outliers, *larger)


def _at_its_best(problem: Problem, base: Fit, factor: Array) -> tuple[Fit, Notes]:
    """The model to start from: its values come from other fits, and may settle on these data."""
    if not base.terms:
        return base, ()
    refitted = null_fit(problem, base.terms, factor, refit=True)
    if refitted.valid and refitted.chi2 < base.chi2 - _STALE_VALUES:
        return refitted, ("the model's values were refitted to these data before the search",)
    return _with_derivatives(problem, base), ()


def _with_derivatives(problem: Problem, base: Fit) -> Fit:
    return replace(base, derive=lambda: free_derivatives(problem, base.state))


def _without_outliers(found: Search, base: Fit, progress: Progress) -> tuple[Search, Notes]:
    """Search again without rows that stick out alone, if there are a few; name them."""
    problem, state = found.problem, found.last.fit.state
    rows = outlying_rows(problem, state)
    if not rows.any():
        return found, ()
    lines = problem.data.places(rows)
    word = "line" if rows.sum() == 1 else "lines"
    note = f"{word} {lines} left out: outliers, far from all the others"
    cleaned = problem.without(rows, note)
    kept = ~rows[problem.row_of]
    if whiteness(cleaned, state.white[kept], found.last.evidence.parameters).structured:
        # nor are the others noise: rows that stick out are part of what is not explained
        return found, ()
    again = null_fit(cleaned, base.terms, found.factor, refit=False)
    if base.terms:
        again = _with_derivatives(cleaned, again)
    better = search(replace(found.trials, problem=cleaned), again, progress)
    if better.found != found.found:
        with_all = ", ".join(found.found) or "nothing"
        note += f" (with them the search finds {with_all})"
    return better, (note,)


def _with_larger_noise(found: Search, progress: Progress) -> tuple[Search, Notes]:
    """Where what is left is white but too large, the noise was stated too small."""
    last = found.last.whiteness
    if last.is_noise or last.structured or last.scale > _UNDERSTATED or found.noise_scale != 1.0:
        return found, ()
    scale = last.scale
    again = search(replace(found.trials, noise_scale=scale), found.steps[0].fit, progress, found)
    note = f"what is left is white but {scale:.2f} times the stated noise: taken as the noise"
    return again, (note,)


def unexplained(found: Search, chances: Chances, notes: Sequence[str]) -> Diagnosis:
    """The verdict of a search that leaves structure."""
    problem, verdict = found.problem, DiagnosisVerdict.UNKNOWN_EFFECT
    missing, shown = _warranted(found, chances)
    found = shown if missing else found
    where = _where(shown)
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(missing, found),
        missing=tuple(missing),
        before=rms_by_kind(problem, found.steps[0].fit.state.raw),
        after=rms_by_kind(problem, shown.last.fit.state.raw),
        held_out=shown.last.held_out.rms,
        floor=noise_floor(problem, found.last.fit.state, found.noise_scale),
        candidates=tuple(not_listed(found, [m.effect for m in missing])),
        measure_next=tuple(measure_next(found, missing, verdict, where)),
        notes=tuple(dict.fromkeys(notes)),
        search=found,
        whiteness=found.last.whiteness,
        where=where,
        chances=chances,
    )


def _warranted(found: Search, chances: Chances) -> tuple[list[MissingEffect], Search]:
    """What the data warrant where structure is left over, and the way that far."""
    # what was found beside an effect that is not warranted is not warranted either
    first = list(takewhile(lambda name: _is_warranted(found, name), found.found))
    if first:
        way: Search | None = replace(found, steps=found.steps[: 1 + len(first)])
    else:
        way = small_effects_alone(found, _FEW_PARAMETERS, _LEAST_ALONE)
    if way is None:
        return [], replace(found, steps=found.steps[:1])
    return [missing_of(way, name, chances) for name in way.found], way


def _is_warranted(found: Search, name: str) -> bool:
    index = 1 + found.found.index(name)
    before, step = found.steps[index - 1], found.steps[index]
    best, part = found.last.fit, found.last.fit.terms.part(name)
    few = len(best.terms[name].layout) <= _FEW_PARAMETERS and is_plausible(best.terms[name])
    stopped = bool(np.any(best.at_bound[part]))
    if not few or stopped or share_of(before, step) <= _LEAST_SHARE:
        return False
    # no share of what the field leaves: that may all be what nobody knows
    return beyond_smooth(found.problem, before.fit.state, step.fit.state, 0.0)


def missing_of(
    found: Search, name: str, chances: Chances, rivals: Sequence[Rival] | None = None
) -> MissingEffect:
    best = found.last.fit
    term, part = best.terms[name], best.terms.part(name)
    index = 1 + found.found.index(name)
    before, step = found.steps[index - 1], found.steps[index]
    return MissingEffect(
        term=term,
        stderr=best.stderr[part] * found.last.whiteness.inflation,
        at_bound=best.at_bound[part],
        rivals=tuple(rivals_of(found, name) if rivals is None else rivals),
        check=check_of(term, found.problem.robot),
        rms=rms_by_kind(found.problem, step.fit.state.raw),
        held_out_rms=step.held_out.rms,
        share=share_of(before, step),
        probability=chances.of(name),
    )


def _sentence(missing: Sequence[MissingEffect], found: Search) -> str:
    tried = len([c for c in found.steps[0].candidates if c.fit is not None or c.drop])
    if not missing:
        return (
            f"Structure remains that none of {tried} effects tried explains: an effect that is "
            "not in the catalogue."
        )
    left = "structure remains that no known effect explains"
    return and_what_is_left(words_of(missing), left, tried)


def not_listed(found: Search, listed: Sequence[str]) -> list[NotListed]:
    """Every effect that was tried and is not listed, the nearest miss first."""
    start = found.steps[0]
    rows = [
        NotListed(
            effect=c.name,
            title=c.layout.effect.title,
            score=c.evidence.log - start.evidence.log if c.evidence is not None else 0.0,
            why_not=c.why_not or _later_reason(found, c.name) or _beaten_reason(found, c),
        )
        for c in start.candidates
        if c.name not in listed
    ]
    return sorted(rows, key=lambda row: -row.score)


def _beaten_reason(found: Search, c: Candidate) -> Reason:
    """Why a candidate that explains something by itself is not listed."""
    if found.last.whiteness.is_noise:
        return Reason(Why.EXPLAINED_BETTER, by=found.found) if found.found else _NOT_NEEDED
    if len(c.layout) > _FEW_PARAMETERS:
        return Reason(Why.IMITATES, parameters=len(c.layout))
    return Reason(Why.EXPLAINS_PART)


_NOT_NEEDED = Reason(Why.NOT_NEEDED)


def _later_reason(found: Search, name: str) -> Reason | None:
    """Why it was not chosen later on, beside effects that were."""
    if name in found.found:
        return Reason(Why.EXPLAINS_PART)
    for step in reversed(found.steps[1:]):
        for c in step.candidates:
            if c.name == name and c.why_not is not None:
                return replace(c.why_not, beside=step.fit.terms.names)
    return None


def _where(found: Search) -> tuple[Association, ...]:
    last = found.last.fit.state
    return tuple(associations(found.problem, last.white, last.prediction)[:_MOST_WHERE])
