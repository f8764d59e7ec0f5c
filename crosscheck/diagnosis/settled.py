"""The diagnosis of a search that ended with noise: the effects that it added are missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from crosscheck.calibration.judgement.verdict import SURE
from crosscheck.diagnosis.averaged import spread_by_others
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.exchanged_effects import exchanged, replaced
from crosscheck.diagnosis.listed import diagnosis_of, missing_of, not_listed
from crosscheck.diagnosis.nearby import chances_near
from crosscheck.diagnosis.result import Diagnosis, NotListed
from crosscheck.diagnosis.rivals import Rival, in_place_of, rivals_of
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.words import (
    agreement_words,
    and_what_is_left,
    hints_of,
    noise_left,
    words_of,
)
from crosscheck.fit.least_squares.problem import rms_by_kind
from crosscheck.fit.preparation.prepare import noise_floor
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from seecr.processes import Shared, shared_out


def settled(
    found: Search, notes: Sequence[str], told: Callable[[str], None] = lambda _text: None
) -> Diagnosis:
    """The diagnosis of a search whose last model leaves noise; ``told`` says what is being done."""
    found, rivals = _with_better(found, told)
    chances = _chances(found, rivals)
    other = exchanged(found, chances)
    if other is not found:
        found, rivals = _with_better(other, told)
        chances = _chances(found, rivals)
    wider = _by_evidence(found, rivals, chances)
    if wider != rivals:
        rivals, chances = wider, _chances(found, wider)
    kept = _sure_part(found, chances)
    if kept is not found:
        rivals = _all_rivals(kept, told)
    spread = spread_by_others(kept.problem, kept.last.fit, chances)
    missing = [missing_of(kept, name, chances, rivals[name], spread) for name in kept.found]
    hints = hints_of(chances, kept.found, found.found)
    verdict, sentence = DiagnosisVerdict.NO_EFFECT_MISSING, agreement_words(found.tried, hints)
    if missing:
        verdict = DiagnosisVerdict.EFFECTS_FOUND
        sentence = and_what_is_left(words_of(missing), noise_left(hints), found.tried)
    return diagnosis_of(
        verdict,
        sentence,
        missing,
        kept,
        before=rms_by_kind(found.problem, found.steps[0].fit.state.raw),
        floor=noise_floor(found.problem, found.last.fit.state),
        candidates=_with_hints(
            not_listed(kept, kept.found),
            {name: chances.of(name) for name in found.found if name not in kept.found},
        ),
        notes=notes,
        chances=chances,
    )


def _chances(found: Search, rivals: Mapping[str, Sequence[Rival]]) -> Chances:
    return chances_near(found, {n: [r.name for r in some] for n, some in rivals.items()})


def _with_better(
    found: Search, told: Callable[[str], None]
) -> tuple[Search, dict[str, list[Rival]]]:
    """The search with what explains more in place of some of its effects, and their rivals."""
    for _ in found.found:
        every = _for_each(found, in_place_of, told)
        other = replaced(found, (rival for some in every.values() for rival in some))
        if other is found:
            return found, {n: [r for r in some if not r.is_better] for n, some in every.items()}
        found = other
    return found, _all_rivals(found, told)


def _all_rivals(found: Search, told: Callable[[str], None]) -> dict[str, list[Rival]]:
    return _for_each(found, rivals_of, told)


def _for_each(
    found: Search, look: Callable[[Search, str], list[Rival]], told: Callable[[str], None]
) -> dict[str, list[Rival]]:
    """What is found in place of each effect."""
    some = shared_out(
        partial(look, found), found.found, partial(Shared, found),
        lambda name: told(f"looking for effects that could replace {name}"),
    )  # fmt: skip
    return dict(zip(found.found, some, strict=True))


def _by_evidence(
    found: Search, rivals: Mapping[str, list[Rival]], chances: Chances
) -> dict[str, list[Rival]]:
    """Rivals, where effects that are not sure get all rivals that evidence alone does not exclude.

    If a rival leaves more chi2, a further parameter of the effect may explain that by chance.
    """
    out = dict(rivals)
    for name in found.found:
        if chances.of(name) < SURE:
            some = rivals_of(found, name, np.inf)
            out[name] = some if len(some) > len(rivals[name]) else rivals[name]
    return out


def _sure_part(found: Search, chances: Chances) -> Search:
    """The search without its last effects that are not sure, if it leaves noise without them."""
    kept = found
    while kept.found and chances.of(kept.found[-1]) < SURE and kept.steps[-2].whiteness.is_noise:
        kept = replace(kept, steps=kept.steps[:-1])
    return kept


def _with_hints(rows: Sequence[NotListed], hints: Mapping[str, float]) -> list[NotListed]:
    """Rows in which effects that the search found, and that are not sure, say so."""
    return [
        replace(row, why_not=Reason(Why.NOT_SURE, p=hints[row.effect]))
        if row.effect in hints
        else row
        for row in rows
    ]
