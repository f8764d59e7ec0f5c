"""A search by steps that ended with noise: what was found on the way is what is missing."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.diagnosis.advice import measure_next
from crosscheck.diagnosis.nearby import chances_near
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.unexplained import missing_of, not_listed
from crosscheck.diagnosis.words import and_what_is_left, words_of
from crosscheck.fit.prepare import noise_floor
from crosscheck.fit.problem import rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict


def settled(found: Search, notes: Sequence[str]) -> Diagnosis:
    """The diagnosis of a search whose last model leaves noise."""
    problem = found.problem
    rivals = {name: rivals_of(found, name) for name in found.found}
    chances = chances_near(found, {n: [r.name for r in some] for n, some in rivals.items()})
    missing = [missing_of(found, name, chances, rivals[name]) for name in found.found]
    some, none = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.NO_EFFECT_MISSING
    verdict = some if missing else none
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(missing, found),
        missing=tuple(missing),
        before=rms_by_kind(problem, found.steps[0].fit.state.raw),
        after=rms_by_kind(problem, found.last.fit.state.raw),
        held_out=found.last.held_out.rms,
        floor=noise_floor(problem, found.last.fit.state, found.noise_scale),
        candidates=tuple(not_listed(found, [m.effect for m in missing])),
        measure_next=tuple(measure_next(found, missing, verdict, ())),
        notes=tuple(dict.fromkeys(notes)),
        search=found,
        whiteness=found.last.whiteness,
        chances=chances,
    )


def _sentence(missing: Sequence[MissingEffect], found: Search) -> str:
    tried = len([c for c in found.steps[0].candidates if c.fit is not None or c.drop])
    if missing:
        return and_what_is_left(words_of(missing), "what is left is noise", tried)
    return (
        f"Model and data agree: what is left is noise, and none of {tried} effects tried "
        "explains any of it."
    )
