"""A search by steps that ended with noise: what was found on the way is what is missing."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.diagnosis.listed import diagnosis_of, missing_of, not_listed
from crosscheck.diagnosis.nearby import chances_near
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.rivals import rivals_of
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.words import agreement, and_what_is_left, words_of
from crosscheck.fit.prepare import noise_floor
from crosscheck.fit.problem import rms_by_kind
from crosscheck.fit.reasons import DiagnosisVerdict


def settled(found: Search, notes: Sequence[str]) -> Diagnosis:
    """The diagnosis of a search whose last model leaves noise."""
    rivals = {name: rivals_of(found, name) for name in found.found}
    chances = chances_near(found, {n: [r.name for r in some] for n, some in rivals.items()})
    missing = [missing_of(found, name, chances, rivals[name]) for name in found.found]
    verdict, sentence = DiagnosisVerdict.NO_EFFECT_MISSING, agreement(found.tried)
    if missing:
        verdict = DiagnosisVerdict.EFFECTS_FOUND
        sentence = and_what_is_left(words_of(missing), "what is left is noise", found.tried)
    return diagnosis_of(
        verdict,
        sentence,
        missing,
        found,
        before=rms_by_kind(found.problem, found.steps[0].fit.state.raw),
        floor=noise_floor(found.problem, found.last.fit.state, found.noise_scale),
        candidates=not_listed(found, found.found),
        notes=notes,
        chances=chances,
    )
