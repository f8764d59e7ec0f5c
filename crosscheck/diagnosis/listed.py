"""Turns the steps of a search into a diagnosis: what is listed, what is not, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from crosscheck.calibration.sets.equals import SMALL
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.comparison.associations import Association
from crosscheck.diagnosis.advice import NO_OTHERS, check_of, measure_next
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.common_part import common_part
from crosscheck.diagnosis.result import Diagnosis, MissingEffect, NotListed
from crosscheck.diagnosis.rivals import Rival, rivals_of
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.small import share_of
from crosscheck.diagnosis.words import doubts_about
from crosscheck.fit.effects.candidates import Candidate
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.least_squares.problem import Rms, rms_by_kind
from crosscheck.fit.noise.unstated import overestimated
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from seecr.effects import Terms
from seecr.pose import Array


def diagnosis_of(
    verdict: DiagnosisVerdict,
    sentence: str,
    missing: Sequence[MissingEffect],
    search: Search,
    *,
    before: Rms,
    floor: Rms,
    candidates: Sequence[NotListed],
    notes: Sequence[str],
    chances: Chances,
    shown: Search | None = None,
    where: tuple[Association, ...] = (),
    alternatives: Mapping[Names, Terms] = NO_OTHERS,
) -> Diagnosis:
    """A diagnosis with the steps that lead to it.

    Args:
        verdict, sentence, missing, before, floor, candidates, notes, chances, where: as in the
            diagnosis.
        search: steps from the model as it stands to what is kept.
        shown: the steps whose errors are shown, if ``search`` leads to more than is listed.
        alternatives: sets of effects of which one is missing, with the model that has it.
    """
    last = (search if shown is None else shown).last
    after = rms_by_kind(search.problem, last.fit.state.raw)
    is_unknown = verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    seen = chances.seen if is_unknown or chances.imitated is not None else ()
    alike = [one.common.note for one in missing if one.common is not None]
    doubts = [] if is_unknown else doubts_about(missing, chances)
    return Diagnosis(
        verdict=verdict,
        sentence=sentence,
        missing=tuple(missing),
        before=before,
        after=after,
        held_out=last.held_out.rms,
        floor=floor,
        candidates=tuple(_with_equals(candidates, missing)),
        measure_next=tuple(measure_next(search, missing, verdict, where, alternatives, seen)),
        notes=tuple(
            dict.fromkeys([*notes, *overestimated(search.problem, after), *alike, *doubts])
        ),
        search=search,
        whiteness=search.last.whiteness,
        where=where,
        chances=chances,
    )


def _with_equals(
    candidates: Sequence[NotListed], missing: Sequence[MissingEffect]
) -> Iterator[NotListed]:
    """What may stand for a listed effect is not listed for that reason, and for no other."""
    reasons = {
        rival.name: Reason(Why.IN_COMMON, by=(one.effect,))
        for one in reversed(missing)
        for rival in ([] if one.common is None else one.common.rivals)
    }
    for one in reversed(missing):
        reasons |= dict.fromkeys(one.indistinguishable, Reason(Why.ALIKE, by=(one.effect,)))
    for row in candidates:
        yield replace(row, why_not=reasons[row.effect]) if row.effect in reasons else row


def missing_of(
    found: Search,
    name: str,
    chances: Chances,
    rivals: Sequence[Rival] | None = None,
    spread: Array | None = None,
    best: Fit | None = None,
) -> MissingEffect:
    """An effect that the search found, with what adding it does.

    Args:
        found: the search. name: name of the effect.
        chances: probabilities of all effects.
        rivals: effects that cannot be told from it; if not given, they are searched.
        spread: (p,) further standard deviation of the values, if any.
        best: the fit that they are of; by default the last model, whose errors are larger by what
            it leaves.
    """
    inflation = found.last.whiteness.inflation if best is None else 1.0
    best = found.last.fit if best is None else best
    term, part = best.terms[name], best.terms.part(name)
    index = 1 + found.found.index(name)
    before, step = found.steps[index - 1], found.steps[index]
    stderr = best.stderr[part] * inflation
    stderr = stderr if spread is None else np.hypot(stderr, spread[part])
    return MissingEffect(
        term=term,
        stderr=stderr,
        at_bound=best.at_bound[part],
        rivals=tuple(rivals_of(found, name) if rivals is None else rivals),
        check=check_of(term, found.problem.robot, stderr),
        rms=rms_by_kind(found.problem, step.fit.state.raw),
        held_out_rms=step.held_out.rms,
        share=share_of(before, step),
        probability=chances.of(name),
        common=common_part(found, term, best),
    )


def not_listed(found: Search, listed: Sequence[str]) -> list[NotListed]:
    """Every effect that was tried and is not listed, the best first."""

    def why(c: Candidate) -> Reason:
        return _later_reason(found, c.name) or _beaten_reason(found, c)

    return sorted(left_out(found, listed, why), key=lambda row: -row.score)


def left_out(
    found: Search, listed: Sequence[str], why: Callable[[Candidate], Reason]
) -> list[NotListed]:
    """Every effect that was tried beside the model as it stood and is not listed.

    Args:
        found: the search. listed: names of what is listed.
        why: gives the reason for a candidate that has none of its own.
    """
    start = found.steps[0]
    return [
        NotListed(
            effect=c.name,
            title=c.layout.effect.title,
            score=c.evidence.log - start.evidence.log if c.evidence is not None else 0.0,
            why_not=c.why_not or why(c),
        )
        for c in start.candidates
        if c.name not in listed
    ]


def _beaten_reason(found: Search, c: Candidate) -> Reason:
    """Why a candidate that explains something by itself is not listed."""
    if found.last.whiteness.is_noise:
        return Reason(Why.EXPLAINED_BETTER, by=found.found) if found.found else _NOT_NEEDED
    if len(c.layout) > SMALL:
        return Reason(Why.IMITATES, parameters=len(c.layout))
    return Reason(Why.EXPLAINS_PART)


_NOT_NEEDED = Reason(Why.NOT_NEEDED)


def _later_reason(found: Search, name: str) -> Reason | None:
    """Why an effect was not chosen later, beside effects that were; None if it was never tried."""
    if name in found.found:
        return Reason(Why.EXPLAINS_PART)
    for step in reversed(found.steps[1:]):
        for c in step.candidates:
            if c.name == name and c.why_not is not None:
                return replace(c.why_not, beside=step.fit.terms.names)
    return None
