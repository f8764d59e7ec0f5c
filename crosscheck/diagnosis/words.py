"""The sentences of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from crosscheck.diagnosis.chances import PROBABLE, Chances
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.fit.effects.possible import largest_size
from crosscheck.fit.reasons import DiagnosisVerdict, probability_words
from crosscheck.fit.words import rms_words
from seecr.counted import counted
from seecr.effects import Term

# How many effects of a class are named.
_FIRST = 2
# A smaller share of the unexplained error is none.
_NO_SHARE = 1e-3
# Classes that are not listed are told from this probability on.
_WORTH_SAYING = 0.05


def words_of(missing: Sequence[MissingEffect]) -> str:
    """What adding each effect does, in words."""
    return "; then ".join(_words_of(effect) for effect in missing)


def and_what_is_left(text: str, left: str, tried: int) -> str:
    """A sentence that says what was added, what is left then, and how many effects were tried."""
    text = f"{text}; {left}" if text else left
    return (
        text[0].upper()
        + text[1:]
        + f". {counted(tried, 'effect')} {'was' if tried == 1 else 'were'} tried."
    )


def agreement_words(tried: int, hints: Mapping[str, float] | None = None) -> str:
    """The sentence about a model that lacks nothing for sure.

    Args:
        tried: how many effects were tried.
        hints: probable effects, or classes in words, that explain a little, with their
            probabilities.
    """
    if not hints:
        return f"Model and data agree: the residuals are noise, and {none_of(tried)} any of it."
    return (
        f"Model and data agree: the residuals are noise; among {counted(tried, 'effect')} tried "
        f"there is a {_hint_of(hints)}."
    )


def hints_of(
    chances: Chances, listed: Iterable[str], found: Iterable[str] = ()
) -> dict[str, float]:
    """Classes that are probable and not listed, in words, with their probabilities.

    Args:
        chances: probabilities.
        listed: effects that are listed.
        found: effects that a search ended with: their classes are hints, however improbable.
    """
    listed, found = set(listed), set(found)
    return {
        one_of(members): p
        for members, p in chances.classes
        if listed.isdisjoint(members) and (p > PROBABLE or not found.isdisjoint(members))
    }


def size_notes(terms: Iterable[Term]) -> list[str]:
    """Notes about effects that only explain the data with implausibly large values."""
    return [
        f"{term.name} would be {largest_size(term):.3g} times its plausible size, which is very "
        "unlikely: check it by hand first, as it may stand for an effect that was not tried"
        for term in terms
    ]


def doubts_about(missing: Iterable[MissingEffect], chances: Chances | None) -> list[str]:
    """A note about something unknown that may be there in place of listed effects, if any."""
    doubt = None if chances is None else chances.doubt
    listed = {name for one in missing for name in (one.effect, *one.indistinguishable)}
    if doubt is None or listed.isdisjoint(doubt.replaced):
        return []
    advice = "".join(f"; {what.advice}" for what in doubt.seen if what.advice)
    likely = probability_words(doubt.probability)
    return [
        f"there may be something else in place of {' + '.join(sorted(doubt.replaced))} "
        f"(probability {likely}): {doubt.words}{advice}"
    ]


def noise_left(hints: Mapping[str, float]) -> str:
    """Says that what was added leaves noise, with ``hints`` as for `agreement`."""
    return f"the remaining residuals are noise{f', with a {_hint_of(hints)}' if hints else ''}"


def _hint_of(hints: Mapping[str, float]) -> str:
    return f"hint of {probable_words(hints)}, too weak to be certain"


def probable_words(hints: Mapping[str, float]) -> str:
    """Effects, or classes of them in words, each with its probability."""
    return ", ".join(f"{name} ({probability_words(p)})" for name, p in hints.items())


def either(sets: Sequence[Iterable[str]]) -> str:
    """Sets of effects of which one is missing: "a + b, or c"."""
    return ", or ".join(" + ".join(sorted(names)) for names in sets)


def one_of(members: Sequence[str]) -> str:
    """Effects of which one is missing, the likeliest first: "a or b", "a, b or one of 4 others"."""
    some, others = list(members[:_FIRST]), members[_FIRST:]
    if others:
        some.append(others[0] if len(others) == 1 else f"one of {len(others)} others")
    return " or ".join([", ".join(some[:-1]), some[-1]] if len(some) > 1 else some)


def equals_of(found: Diagnosis) -> list[str]:
    """Classes of equivalent effects of which none is listed, with their probabilities.

    Those with a single member, or that are hardly probable, are left out.
    """
    if found.chances is None:
        return []
    listed = {name for one in found.missing for name in (one.effect, *one.indistinguishable)}
    said = probability_name(found)
    return [
        f"one of {', '.join(members)}: {said} {probability_words(p)}"
        for members, p in found.chances.classes
        if len(members) > 1 and p >= _WORTH_SAYING and listed.isdisjoint(members)
    ]


def none_of(tried: int) -> str:
    """Says that no effect that was tried explains something, which is to follow."""
    if tried == 1:
        return "the one effect tried does not explain"
    return f"none of {tried} effects tried explains"


def _words_of(effect: MissingEffect) -> str:
    names = ", ".join(effect.indistinguishable)
    alike = f" (or {names}, indistinguishable on these data)" if names else ""
    does = removed(effect.share)
    if effect.share < _NO_SHARE:
        does = f"leaves {rms_words(effect.rms)} on all rows, though it {does}"
    return f"adding {effect.effect}{alike} {does}"


def removed(share: float) -> str:
    """What an effect does to the error on held-out runs.

    Noise may have been stated too large, or be small by chance. Then all error is below it, and
    what an effect explains of that is no share of the unexplained. Or an effect predicts nothing
    until the next one is in the model.
    """
    if share < _NO_SHARE:
        return "removes no error beyond the noise on held-out runs by itself"
    return f"removes {percent(share)} of the unexplained error on held-out runs"


def probability_name(found: Diagnosis) -> str:
    """What probabilities are called: those within the catalogue say so."""
    return f"probability{' within the catalogue' if found.within_catalogue else ''}"


WITHIN = (
    "Probabilities within the catalogue assume that what is missing is one of its effects. Here "
    "something remains that is none of them and may act like this one."
)
"""What is said about probabilities if structure remains."""

OTHERS_WITHIN = (
    "Probabilities of effects that are not listed assume that the catalogue alone explains the "
    "data. Here something unknown does, which these effects may imitate, or be imitated with."
)
"""The same where what is listed has been weighed against something unknown."""


def within_words(found: Diagnosis) -> str:
    """What probabilities assume of the catalogue beside something unknown; "" elsewhere."""
    if found.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or found.chances is None:
        return ""
    return WITHIN if found.within_catalogue else OTHERS_WITHIN


def percent(share: float) -> str:
    """A share as people read it; less than all is never rounded to all."""
    return f"{min(100.0 * share, 99.9):.3g} %"
