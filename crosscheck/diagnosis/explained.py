"""The diagnosis by compared sets of effects that explain the data: none, a few, or many.

It may also be that something unknown explains the data better in place of some effects, or that
one effect is sure beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.calibration.judgement.alternatives import alternatives, is_in_each
from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.noise.robust import outliers
from crosscheck.calibration.search import SetSearch
from crosscheck.calibration.sets.equals import EQUAL
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.unknown.imitated import Imitated
from crosscheck.diagnosis.averaged import spread_by_others
from crosscheck.diagnosis.chances import PROBABLE, Chances, chances_of
from crosscheck.diagnosis.listed import diagnosis_of, left_out, missing_of
from crosscheck.diagnosis.result import Diagnosis, MissingEffect, NotListed
from crosscheck.diagnosis.rivals import Rival, loss_of_its_part
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.set_steps import fit_of, steps_of_set
from crosscheck.diagnosis.steps import OTHER
from crosscheck.diagnosis.unexplained import estimated_floor, structure_words, where_of
from crosscheck.diagnosis.words import (
    agreement_words,
    and_what_is_left,
    either,
    hints_of,
    noise_left,
    probable_words,
    size_notes,
    words_of,
)
from crosscheck.fit.effects.candidates import Candidate
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why, probability_words
from crosscheck.fit.words import rms_words
from seecr.counted import counted

# A note mentions noise with a larger autocorrelation than this.
_ALIKE = 0.3

MORE = (
    "the residuals of a few effects vary smoothly over the workspace or in time and are not noise: "
    "all effects together absorb them, and so might an unknown effect"
)


def explained(sought: SetSearch, notes: Sequence[str]) -> Diagnosis:
    """The diagnosis by compared sets of effects; its notes are added to these."""
    verdict = sought.judgement.verdict
    unknown = verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    search = steps_of_set(sought, frozenset(sought.judgement.sure))
    fitted = len(sought.calibration.terms.names)
    chances = chances_of(sought)
    more = sought.judgement.more
    open_to_known = not (more or unknown or sought.judgement.imitated)
    some = alternatives(sought.found, sought.classes) if open_to_known else []
    listed_in_all = all(is_in_each(name, some, sought.classes) for name in search.found)
    if search.found and (len(some) < 2 or not listed_in_all):
        some = []
    # effects that are not sure are missing too, and with them in the model values are better;
    # for EFFECTS_FOUND, the listed effects have to be a model by themselves
    best = search.last.fit
    if verdict is not DiagnosisVerdict.EFFECTS_FOUND:
        best = fit_of(sought.calibration.setting, sought.found.best.joint)
    spread = spread_by_others(search.problem, best, chances)
    own = frozenset(search.last.fit.terms.names)
    missing = [
        missing_of(search, name, chances, _rivals(sought, own, name), spread, best)
        for name in search.found
    ]
    return diagnosis_of(
        verdict,
        _sentence(sought.judgement, missing, search.tried, chances, some, fitted),
        missing,
        search,
        before=sought.calibration.before,
        floor=estimated_floor(sought),
        candidates=_not_listed(search, chances, sought.judgement, frozenset().union(*some)),
        notes=(*notes, *_fit_notes(sought), *([MORE] * more)),
        chances=chances,
        where=where_of(search) if unknown else (),
        alternatives={
            names: sought.found.refits[sought.found.always | names].joint.terms for names in some
        },
    )


def _rivals(sought: SetSearch, names: Names, name: str) -> list[Rival]:
    """The other members of an effect's class, each with a fit of the model that has it instead."""
    found = sought.found
    members = sought.classes.alike(name)
    own = found.refit(names)
    if own is None:
        return []
    every: dict[str, Rival] = {}
    for other in members:
        swapped = found.refit((names - {name}) | {other}) if other not in names else None
        if swapped is not None:
            every[other] = _rival(sought, own, swapped, other)
    # an effect that contains another does all that it does, and stays if its further parameters
    # may be present too
    out = [r for r in every.values() if r.loss <= loss_of_its_part(r.name, name, every) + EQUAL]
    return sorted(out, key=lambda r: r.loss)


def _rival(sought: SetSearch, own: Refit, swapped: Refit, other: str) -> Rival:
    fit = fit_of(sought.calibration.setting, swapped.joint)
    return Rival(other, fit, own.score - swapped.score)


def _fit_notes(sought: SetSearch) -> list[str]:
    """Notes about the fit of the best set; where it leaves structure, that is not called noise."""
    said = sought.judgement
    left = said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and said.imitated is None
    return [*([] if left else _noise_notes(sought)), *_size_notes(sought)]


def _noise_notes(sought: SetSearch) -> list[str]:
    """Notes about noise that is not as stated, and about lines that hardly count."""
    out, setting, joint = list[str](), sought.calibration.setting, sought.found.best.joint
    scales, rhos = joint.colour.by_kind(setting.problem)
    for name, scale in scales.items():
        rho = rhos[name]
        if abs(scale - 1.0) > OTHER or rho > _ALIKE:
            alike = (
                (f", with a correlation of {rho:.2f} from row to row of a run")
                if rho > _ALIKE
                else ""
            )
            out.append(f"noise of the {name}: {scale:.2f} times the assumed noise{alike}")
    rows = outliers(setting.chain, joint.weight, setting.problem.data.n_rows)
    if rows.any():
        lines = setting.problem.data.lines_of(rows)
        out.append(f"outliers, given little weight and not included in these errors: {lines}")
    return out


def _size_notes(sought: SetSearch) -> list[str]:
    terms = sought.found.best.joint.terms
    return size_notes(terms[name] for name in sorted(sought.judgement.implausible))


def _sentence(
    said: Judgement,
    missing: Sequence[MissingEffect],
    tried: int,
    chances: Chances,
    alternatives: Sequence[Names] = (),
    fitted: int = 0,
) -> str:
    """The verdict in words.

    Args:
        said, missing, tried, chances: as in the diagnosis.
        alternatives: sets of effects that explain as much.
        fitted: how many effects were fitted together.
    """
    if said.verdict is DiagnosisVerdict.NO_EFFECT_MISSING:
        return agreement_words(tried, hints_of(chances, ()))
    if said.imitated is not None:
        return and_what_is_left(words_of(missing), _instead(said, said.imitated), tried)
    if said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT:
        return structure_words(missing, tried, chances)
    if said.verdict is DiagnosisVerdict.EFFECTS_FOUND:
        left = noise_left(hints_of(chances, [m.effect for m in missing]))
        return and_what_is_left(words_of(missing), left, tried)
    together = chances.together
    assert together is not None
    all_of_them = (
        f"On held-out runs it is {rms_words(together.before)} as the model stands and "
        f"{rms_words(together.held_out)} with all effects that can be fitted together."
    )
    sure = ", ".join(_or_in_its_place(m, alternatives) for m in missing)
    if len(alternatives) > 1:
        return (
            "No few effects explain the error with certainty: these data leave open whether it is "
            f"{either(alternatives)}. "
            + (f"Certain in each of them: {sure}. " if sure else "")
            + all_of_them
        )
    if alternatives:
        some = probable_words(hints_of(chances, (), alternatives[0]))
        return (
            "No few effects explain the error with certainty; most probably it is "
            f"{some}. {all_of_them}"
        )
    every = counted(fitted, "effect")
    return (
        f"No few effects explain the error, but {every} together do: they reduce it from "
        f"{rms_words(together.before)} to {rms_words(together.held_out)} on held-out runs. "
        + (f"Certain among them: {sure}." if sure else "None of them is certain by itself.")
    )


def _instead(said: Judgement, unknown: Imitated) -> str:
    """That something unknown may be there instead of members that can imitate it, and how sure."""
    known, chance, doubt = " + ".join(sorted(unknown.replaced)), "", ""
    how = "is more probable than" if unknown.is_likelier else "may be there in place of"
    if said.verdict is DiagnosisVerdict.MANY_EFFECTS:
        chance = f" (probability {probability_words(unknown.probability)})"
        doubt = ", but not certain" if unknown.is_likelier else ""
    return f"an unknown effect {how} {known}, which can imitate it{chance}{doubt}: {unknown.words}"


def _or_in_its_place(one: MissingEffect, alternatives: Sequence[Names]) -> str:
    """A listed effect, and what does the same in those sets that do not have it."""
    lacking = frozenset().union(*(names for names in alternatives if one.effect not in names))
    also = sorted(lacking.intersection(r.name for r in one.rivals))
    return f"{one.effect} (or {', '.join(also)})" if also else one.effect


def _not_listed(
    search: Search, chances: Chances, said: Judgement, undecided: Names
) -> list[NotListed]:
    """All effects that are not listed, the most probable first.

    Args:
        said: the verdict, and the effects that others can replace.
        undecided: members of sets of which the data leave open which it is.
    """
    listed = search.found

    def why_not(c: Candidate) -> Reason:
        p = chances.effect.get(c.name, 0.0)
        alike = _alike(search, chances, c)
        if alike is not None:
            return alike
        if listed and said.verdict is not DiagnosisVerdict.MANY_EFFECTS:
            why = Why.CARRIES_LITTLE if p > PROBABLE else Why.NOT_NEEDED_BESIDE
            return Reason(why, p=p, by=listed)
        if p <= PROBABLE:
            return Reason(Why.OPEN if c.name in undecided else Why.IMPROBABLE, p=p)
        if c.name in said.replaceable:
            return Reason(Why.REPLACEABLE, p=p)
        is_small = listed and c.name not in undecided
        return Reason(Why.DOES_LITTLE if is_small else Why.NOT_SURE, p=p)

    rows = left_out(search, listed, why_not)
    return sorted(rows, key=lambda row: (-chances.effect.get(row.effect, 0.0), -row.score))


def _alike(search: Search, chances: Chances, c: Candidate) -> Reason | None:
    """That an effect imitates something unknown, or is a listed one's equivalent."""
    if chances.imitated is not None and c.name in chances.imitated.replaced:
        return Reason(Why.MAY_IMITATE)
    for members, _p in chances.classes:
        first = next((m for m in members if m in search.found), None)
        if c.name in members and first is not None:
            return Reason(Why.ALIKE, by=(first,))
    return None
