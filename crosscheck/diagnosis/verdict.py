"""Which effects are missing: prepare the data, search, and say no more than they warrant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.comparison.associations import Association, associations
from crosscheck.diagnosis.advice import check_of, measure_next
from crosscheck.diagnosis.importance import weighed
from crosscheck.diagnosis.result import Diagnosis, MissingEffect, NotListed
from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.search import Search, search
from crosscheck.diagnosis.small import is_plausible, share_of, small_effects_alone
from crosscheck.fit.candidates import Candidate, Trials, null_fit
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.known import free_derivatives
from crosscheck.fit.noise import whiteness
from crosscheck.fit.prepare import Prepared, Progress, noise_floor, outlying_rows, prepare
from crosscheck.fit.problem import Problem, rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Refusal, Unfit, Why
from crosscheck.fit.smooth import beyond_smooth
from crosscheck.fit.tolerance import HALF_THE_NOISE, Tolerance
from crosscheck.given import GivenModel, GivenRobot, considered, model_of, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from seecr.effects import Terms
from seecr.pose import Array

# Where structure is left over, an effect is listed only if it has few parameters and took away
# most of what was unexplained; by itself, two thirds of all and then a third of the rest.
_FEW_PARAMETERS, _LEAST_SHARE, _LEAST_ALONE = 3, 0.5, (2.0 / 3.0, 1.0 / 3.0)
# The model's values are refitted before the search where that takes away so much chi2.
_STALE_VALUES = 30.0
# What the unexplained part goes with is said of so many quantities.
_MOST_WHERE = 5
# Noise up to this many times the stated one is noise that was stated too small.
_UNDERSTATED = 3.0


def diagnose(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel = (),
    progress: Progress = lambda _text, _part: None,
    *,
    only: Iterable[str] = (),
    exclude: Iterable[str] = (),
    tolerance: Tolerance = HALF_THE_NOISE,
) -> Diagnosis:
    """Find the effects that a model misses.

    Args:
        robot: as described, or its MJCF.
        data: its measurements, or their file.
        model: effects the model has already, or their file; the plain model without.
        progress: called with what is being done and the part of it that is done.
        only: names of the effects that may be missing; all of the catalogue without.
        exclude: names of effects that are not considered.
        tolerance: from where on what is left beyond noise counts as missing.

    Raises:
        SeecrError: a file that cannot be read, or is of another robot.
    """
    robot = robot_of(robot)
    data = measurements_of(data, robot)
    terms, said = model_of(model, robot)
    # BLAS on several threads takes longer for matrices as narrow as these, and takes the
    # processors from the compiled loop
    with threadpool_limits(limits=1, user_api="blas"):
        ready = prepare(robot, data, terms, considered(only, exclude))
        found = _diagnosed(ready, terms, said, progress)
    return weighed(found, ready.problem, tolerance)


Notes = tuple[str, ...]


def _diagnosed(ready: Prepared, terms: Terms, said: Notes, progress: Progress) -> Diagnosis:
    problem = ready.problem
    factor = problem.noise(problem.experiment.predict(terms.effects))
    base = null_fit(problem, terms, factor, refit=False)
    refusal = ready.refusal
    if refusal is None and not base.valid:
        refusal = Refusal(Unfit.UNSOLVED_MODEL, problem.data.n_rows)
    if refusal is not None:
        return no_verdict(problem, base, (*said, *ready.all_notes), refusal)
    base, refitted = _at_its_best(problem, base, factor)
    found = search(Trials(problem, factor), base, progress)
    found, outliers = _without_outliers(found, base, progress)
    found, larger = _with_larger_noise(found, progress)
    return conclude(found, (*said, *ready.all_notes, *refitted, *outliers, *larger))


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


def no_verdict(problem: Problem, base: Fit, notes: Sequence[str], refusal: Refusal) -> Diagnosis:
    """Nothing can be said, and why."""
    before = rms_by_kind(problem, base.state.raw)
    nothing = dict.fromkeys(before)
    return Diagnosis(
        verdict=DiagnosisVerdict.NO_VERDICT,
        sentence=f"No verdict: {refusal}.",
        missing=(),
        before=before,
        after=nothing,
        held_out=nothing,
        floor=noise_floor(problem),
        measure_next=(refusal.remedy,),
        notes=tuple(notes),
        refusal=refusal,
    )


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


def conclude(found: Search, notes: Sequence[str]) -> Diagnosis:
    """The verdict of a search."""
    problem, clean = found.problem, found.last.whiteness.is_noise
    if clean:
        missing, shown = [_missing(found, name) for name in found.found], found
    else:
        missing, shown = _warranted(found)
        found = shown if missing else found
    verdict = DiagnosisVerdict.UNKNOWN_EFFECT
    if clean:
        some, none = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING
        verdict = some if missing else none
    where = _where(shown) if verdict is DiagnosisVerdict.UNKNOWN_EFFECT else ()
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, missing, found),
        missing=tuple(missing),
        before=rms_by_kind(problem, found.steps[0].fit.state.raw),
        after=rms_by_kind(problem, shown.last.fit.state.raw),
        held_out=shown.last.held_out.rms,
        floor=noise_floor(problem, found.last.fit.state, found.noise_scale),
        candidates=tuple(_not_listed(found, [m.effect for m in missing])),
        measure_next=tuple(measure_next(found, missing, verdict, where)),
        notes=tuple(dict.fromkeys(notes)),
        search=found,
        whiteness=found.last.whiteness,
        where=where,
    )


def _warranted(found: Search) -> tuple[list[MissingEffect], Search]:
    """What the data warrant where structure is left over, and the way that far."""
    # what was found beside an effect that is not warranted is not warranted either
    first = list(takewhile(lambda name: _is_warranted(found, name), found.found))
    if first:
        way: Search | None = replace(found, steps=found.steps[: 1 + len(first)])
    else:
        way = small_effects_alone(found, _FEW_PARAMETERS, _LEAST_ALONE)
    if way is None:
        return [], replace(found, steps=found.steps[:1])
    return [_missing(way, name) for name in way.found], way


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


def _missing(found: Search, name: str) -> MissingEffect:
    best = found.last.fit
    term, part = best.terms[name], best.terms.part(name)
    index = 1 + found.found.index(name)
    before, step = found.steps[index - 1], found.steps[index]
    return MissingEffect(
        term=term,
        stderr=best.stderr[part] * found.last.whiteness.inflation,
        at_bound=best.at_bound[part],
        rivals=tuple(rivals_of(found, name)),
        check=check_of(term, found.problem.robot),
        rms=rms_by_kind(found.problem, step.fit.state.raw),
        held_out_rms=step.held_out.rms,
        share=share_of(before, step),
    )


def _sentence(verdict: DiagnosisVerdict, missing: Sequence[MissingEffect], found: Search) -> str:
    tried = len([c for c in found.steps[0].candidates if c.fit is not None or c.drop])
    if verdict is DiagnosisVerdict.NO_EFFECT_MISSING:
        return (
            f"Model and data agree: what is left is noise, and none of {tried} effects tried "
            "explains any of it."
        )
    if not missing:
        return (
            f"Structure remains that none of {tried} effects tried explains: an effect that is "
            "not in the catalogue."
        )
    clean = verdict is DiagnosisVerdict.EFFECTS_FOUND
    end = "what is left is noise" if clean else "structure remains that no known effect explains"
    text = "; then ".join(_words_of(effect) for effect in missing) + f"; {end}"
    return text[0].upper() + text[1:] + f". {tried} effects were tried."


def _words_of(effect: MissingEffect) -> str:
    names = ", ".join(rival.name for rival in effect.rivals)
    alike = f" (or {names}, alike on these data)" if names else ""
    return (
        f"adding {effect.effect}{alike} removes {percent(effect.share)} of the unexplained error "
        "on runs it was not fitted to"
    )


def percent(share: float) -> str:
    """A share for people; what is not all is not called all."""
    return f"{min(100.0 * share, 99.9):.3g} %"


def _not_listed(found: Search, listed: Sequence[str]) -> list[NotListed]:
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
