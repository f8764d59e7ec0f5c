"""Which effects are missing: prepare the data, search, and say no more than they warrant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import takewhile
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.diagnosis.advice import check_of, measure_next
from crosscheck.diagnosis.result import Diagnosis, Finding
from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.search import Search, search
from crosscheck.diagnosis.small import is_plausible, share_of, smallest_sure
from crosscheck.fit.candidates import Candidate, null_fit
from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.noise import whiteness
from crosscheck.fit.prepare import Progress, noise_floor, outlying_rows, prepare
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.state import derivatives
from crosscheck.measurements.data import Measurements
from seecr.effects import Term, Terms
from seecr.pose import Array
from seecr.robot import Robot

# Where structure is left over, an effect is sure only if it has few parameters and took away
# most of what was unexplained; by itself, two thirds of all and then a third of the rest.
_SURE_PARAMETERS, _SURE_SHARE, _SURE_ALONE = 3, 0.5, (2.0 / 3.0, 1.0 / 3.0)
# Noise up to this many times the stated one is noise that was stated too small.
_UNDERSTATED = 3.0


# BLAS on several threads takes longer for matrices as narrow as these, and takes the processors
# from the compiled loop.
@threadpool_limits.wrap(limits=1, user_api="blas")
def diagnose(
    robot: Robot,
    data: Measurements,
    terms: Iterable[Term] = (),
    progress: Progress = lambda _text, _part: None,
) -> Diagnosis:
    """Find the effects that a model misses.

    Args:
        robot: as described.
        data: its measurements.
        terms: effects the model has already.
        progress: called with what is being done and the part of it that is done.
    """
    model = Terms(terms)
    problem, notes, why = prepare(robot, data, model)
    factor = problem.noise(problem.experiment.predict(model.effects))
    base = null_fit(problem, model, factor, refit=False)
    if why or not base.valid:
        return no_verdict(problem, base, notes, why or base.why)
    if model:
        # the values of a model come from other fits: they may settle on these data first
        settled = null_fit(problem, model, factor, refit=True)
        if settled.valid and settled.chi2 < base.chi2 - 30.0:
            notes.append("the model's values were refitted to these data before the search")
            base = settled
        else:
            base = _with_derivatives(problem, base)
    found = search(problem, base, factor, 1.0, progress)
    found, more = _without_outliers(problem, found, base, factor, progress)
    notes += more
    found, more = _with_larger_noise(found, progress)
    notes += more
    return conclude(found, notes)


def _with_derivatives(problem: Problem, base: Fit) -> Fit:
    jacobian = derivatives(problem, base.state) * base.terms.scale
    return replace(base, jacobian=jacobian)


def no_verdict(problem: Problem, base: Fit, notes: list[str], why: str) -> Diagnosis:
    """Nothing can be said, and why."""
    empty: Rms = rms_by_kind(problem, base.state.raw)
    nothing: Rms = dict.fromkeys(empty)
    return Diagnosis(
        "no_verdict", f"No verdict: {why}.", (), empty, nothing, nothing, noise_floor(problem),
        (), (), tuple(notes), unsolved="equilibrium" in why or "solved" in why,
    )  # fmt: skip


def _without_outliers(
    problem: Problem, found: Search, base: Fit, factor: Array, progress: Progress
) -> tuple[Search, list[str]]:
    """Search again without rows that stick out alone, if there are a few; name them."""
    rows = outlying_rows(problem, found.last.fit.state)
    if not rows.any():
        return found, []
    lines = ", ".join(str(k) for k in problem.data.line[rows])
    word = "line" if rows.sum() == 1 else "lines"
    cleaned = problem.without(rows, f"{word} {lines} left out: outliers, far from all the others")
    state = found.last.fit.state
    kept = ~rows[problem.row_of]
    if whiteness(cleaned, state.white[kept], found.last.evidence.parameters).structured:
        # nor are the others noise: rows that stick out are part of what is not explained
        return found, []
    again = null_fit(cleaned, base.terms, factor, refit=False)
    if base.terms:
        again = _with_derivatives(cleaned, again)
    better = search(cleaned, again, factor, found.noise_scale, progress)
    note = f"{word} {lines} left out: outliers, far from all the others"
    if better.found != found.found:
        with_all = ", ".join(found.found) or "nothing"
        note += f" (with them the search finds {with_all})"
    return better, [note]


def _with_larger_noise(found: Search, progress: Progress) -> tuple[Search, list[str]]:
    """Where what is left is white but too large, the noise was stated too small."""
    last = found.last.whiteness
    if last.is_noise or last.structured or last.scale > _UNDERSTATED or found.noise_scale != 1.0:
        return found, []
    scale = last.scale
    again = search(found.problem, found.steps[0].fit, found.factor, scale, progress, found)
    return again, [
        f"what is left is white but {scale:.2f} times the stated noise: taken as the noise"
    ]


def conclude(found: Search, notes: list[str]) -> Diagnosis:
    """The verdict of a search."""
    problem, clean = found.problem, found.last.whiteness.is_noise
    if clean:
        findings, sure = [_finding(found, name) for name in found.found], found
    else:
        findings, sure = _sure(found)
        found = sure if findings else found
    verdict = "unknown_effect"
    if clean:
        verdict = "effects_found" if findings else "no_effect_missing"
    where = _where(sure) if verdict == "unknown_effect" else ()
    shown = sure.last
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, findings, found),
        missing=tuple(findings),
        before=rms_by_kind(problem, found.steps[0].fit.state.raw),
        after=rms_by_kind(problem, shown.fit.state.raw),
        held_out=shown.held_out.rms,
        floor=noise_floor(problem, found.last.fit.state, found.noise_scale),
        candidates=tuple(_candidates(found, [f.effect for f in findings])),
        measure_next=tuple(measure_next(found, findings, verdict, where)),
        notes=tuple(dict.fromkeys(notes)),
        search=found,
        whiteness=found.last.whiteness,
        where=where,
    )


def _sure(found: Search) -> tuple[list[Finding], Search]:
    """What is sure where structure is left over, and the way that far."""
    # what was found beside an effect that is not sure is not sure either
    first = list(takewhile(_is_sure, (_finding(found, name) for name in found.found)))
    way: Search | None = replace(found, steps=found.steps[: 1 + len(first)])
    if not first:
        way = smallest_sure(found, _SURE_PARAMETERS, _SURE_ALONE)
    if way is None:
        return [], replace(found, steps=found.steps[:1])
    return [_finding(way, name) for name in way.found], way


def _is_sure(finding: Finding) -> bool:
    few = len(finding.layout) <= _SURE_PARAMETERS
    stopped = bool(np.any(finding.at_bound))
    return few and finding.share > _SURE_SHARE and not stopped and is_plausible(finding.term)


def _finding(found: Search, name: str) -> Finding:
    problem, last = found.problem, found.last
    best = last.fit
    term, part = best.terms[name], best.terms.part(name)
    stderr = best.stderr[part] * last.whiteness.inflation
    index = next((k for k, s in enumerate(found.steps) if s.added == name), len(found.steps) - 1)
    step, before = found.steps[index], found.steps[max(index - 1, 0)]
    return Finding(
        effect=name,
        title=term.layout.effect.title,
        layout=term.layout,
        values=term.vector,
        stderr=stderr,
        at_bound=best.at_bound[part],
        rivals=tuple(rivals_of(found, name)),
        check=check_of(term, problem.robot),
        rms=rms_by_kind(problem, step.fit.state.raw),
        held_out_rms=step.held_out.rms,
        share=share_of(before, step),
    )


def _sentence(verdict: str, findings: list[Finding], found: Search) -> str:
    tried = len([c for c in found.steps[0].candidates if c.fit is not None or c.drop])
    runs = "runs it was not fitted to"
    if verdict == "no_effect_missing":
        return (
            f"Model and data agree: what is left is noise, and none of {tried} effects tried "
            "explains any of it."
        )
    if not findings:
        return (
            f"Structure remains that none of {tried} effects tried explains: an effect that is "
            "not in the catalogue."
        )
    parts = []
    for f in findings:
        alike = f" (or {', '.join(r.name for r in f.rivals)}, alike on these data)"
        parts.append(
            f"adding {f.effect}{alike if f.rivals else ''} removes {percent(f.share)} of the "
            f"unexplained error on {runs}"
        )
    end = (
        "; what is left is noise"
        if verdict == "effects_found"
        else "; structure remains that no known effect explains"
    )
    text = "; then ".join(parts) + end
    return text[0].upper() + text[1:] + f". {tried} effects were tried."


def percent(share: float) -> str:
    """A share for people; what is not all is not called all."""
    return f"{min(100.0 * share, 99.9):.3g} %"


def _candidates(found: Search, listed: list[str]) -> list[dict[str, Any]]:
    """Every effect that was tried and is not listed, the nearest miss first."""
    out = []
    start = found.steps[0]
    for c in start.candidates:
        if c.name in listed:
            continue
        score = c.evidence.log - start.evidence.log if c.evidence is not None else 0.0
        why = c.why_not
        if not why:
            why = _later_reason(found, c.name) or _beaten_reason(found, c)
        out.append({"effect": c.name, "score": float(score), "why_not": why})
    return sorted(out, key=lambda row: -row["score"])


def _beaten_reason(found: Search, c: Candidate) -> str:
    """Why a candidate that explains something by itself is not listed."""
    if found.last.whiteness.is_noise:
        better = ", ".join(found.found)
        return f"explained better by {better}" if better else "not needed"
    if len(c.layout) > _SURE_PARAMETERS:
        return f"not sure: {len(c.layout)} parameters imitate much of what no effect explains"
    return "explains a part, but structure remains: not sure"


def _later_reason(found: Search, name: str) -> str:
    if name in found.found:
        return "explains a part, but structure remains: not sure"
    for step in reversed(found.steps[1:]):
        for c in step.candidates:
            if c.name == name and c.why_not:
                return f"beside {', '.join(step.fit.terms.names)}: {c.why_not}"
    return ""


def _where(found: Search) -> tuple[dict[str, Any], ...]:
    try:
        from crosscheck.comparison.associations import associations
    except ImportError:
        return ()
    last = found.last.fit.state
    return tuple(associations(found.problem, last.white, last.prediction)[:5])
