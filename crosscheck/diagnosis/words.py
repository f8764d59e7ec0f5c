"""The sentences of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.path import ModelPath
from crosscheck.diagnosis.result import PROBABLE, Chances, Diagnosis, LeftOver, MissingEffect
from crosscheck.fit.reasons import DiagnosisVerdict, probability_words
from crosscheck.fit.state import largest_size
from crosscheck.fit.words import rms_words
from crosscheck.inference.fit import Fit
from crosscheck.inference.verdict import Judgement
from seecr.counted import counted
from seecr.effects import Term

# How many effects of a class are named.
_FIRST = 2
# A smaller share of the unexplained error is none.
_NO_SHARE = 1e-3
# Classes that are not listed are told from this probability on.
_WORTH_SAYING = 0.05
# A size of the noise that differs from the stated one by more than this part is told, and a
# correlation from row to row above this.
OTHER, _ALIKE = 0.25, 0.3


def sentence_of(
    said: Judgement, missing: Sequence[MissingEffect], path: ModelPath, chances: Chances,
    small: LeftOver | None,
) -> str:  # fmt: skip
    """The verdict in words; ``small`` is what is left, if it is too small to matter."""
    noise = _noise_words(path.search.best.fit)
    if small is not None:
        names = " and ".join(effect.effect for effect in missing)
        start = f"Missing: {names}. The structure" if names else "The structure"
        return f"{start} that remains is too small to matter: {small.words}.{chances.looks_like}"
    match said.verdict:
        case DiagnosisVerdict.NO_EFFECT_MISSING:
            return _agreement(path.tried, hints_of(chances, ()), noise)
        case DiagnosisVerdict.UNKNOWN_EFFECT if not missing:
            return (
                f"A pattern remains that {none_of(path.tried)}: an unknown effect is missing."
                f"{chances.looks_like}"
            )
        case DiagnosisVerdict.UNKNOWN_EFFECT:
            left = "a pattern remains that no known effect explains"
            return _and_what_is_left(missing, left, path.tried) + chances.looks_like
        case DiagnosisVerdict.EFFECTS_FOUND:
            hints = hints_of(chances, [m.effect for m in missing])
            hint = f", with a {_hint_of(hints)}" if hints else ""
            return _and_what_is_left(
                missing, f"the remaining residuals are noise{noise}{hint}", path.tried
            )
    return _many(said, missing, chances)


def _many(said: Judgement, missing: Sequence[MissingEffect], chances: Chances) -> str:
    together = chances.together
    assert together is not None
    fall = (
        f"{rms_words(together.before)} as the model stands and {rms_words(together.held_out)} with "
        "all effects that can be fitted together"
    )
    sure = ", ".join(_with_rivals(one) for one in missing)
    if chances.unknown > PROBABLE or said.posterior.unknown > 1.0 - PROBABLE:
        return (
            "An unknown effect may be there, which known effects can imitate (probability "
            f"{probability_words(chances.unknown)}): no name is certain.{chances.looks_like} On "
            f"test runs the error is {fall}."
        )
    hints = hints_of(chances, [m.effect for m in missing])
    likely = f" Most probably it is {probable_words(hints)}." if hints and not missing else ""
    return (
        f"No few effects explain the error with certainty.{likely} On test runs it is {fall}. "
        + (f"Certain among them: {sure}." if sure else "None of them is certain by itself.")
    )


def _agreement(tried: int, hints: Mapping[str, float], noise: str) -> str:
    if not hints:
        return (
            f"Model and data agree: the residuals are noise{noise}, and {none_of(tried)} any of it."
        )
    return (
        f"Model and data agree: the residuals are noise{noise}; among {counted(tried, 'effect')} "
        f"tried there is a {_hint_of(hints)}."
    )


def _and_what_is_left(missing: Sequence[MissingEffect], left: str, tried: int) -> str:
    """What adding each effect does, what is left then, and how many effects were tried."""
    text = "; ".join(["; then ".join(map(_words_of, missing)), left])
    was = "was" if tried == 1 else "were"
    return f"{text[0].upper()}{text[1:]}. {counted(tried, 'effect')} {was} tried."


def _words_of(effect: MissingEffect) -> str:
    names = ", ".join(effect.indistinguishable)
    alike = f" (or {names}, indistinguishable on these data)" if names else ""
    each = f" with other values in each {effect.per}" if effect.per else ""
    does = removed(effect.share)
    if effect.share < _NO_SHARE:
        does = f"leaves {rms_words(effect.rms)} on all rows, though it {does}"
    return f"adding {effect.effect}{each}{alike} {does}"


def _with_rivals(one: MissingEffect) -> str:
    also = ", ".join(one.indistinguishable)
    return f"{one.effect} (or {also})" if also else one.effect


def removed(share: float) -> str:
    """What an effect does to the error on test runs.

    That may be nothing: noise was stated too large, or it predicts nothing until the next one is in
    the model.
    """
    if share < _NO_SHARE:
        return "removes no error beyond the noise on test runs by itself"
    return f"removes {percent(share)} of the unexplained error on test runs"


def percent(share: float) -> str:
    """A share as people read it; less than all is never rounded to all."""
    return f"{min(100.0 * share, 99.9):.3g} %"


def none_of(tried: int) -> str:
    """Says that no effect that was tried explains something, which is to follow."""
    if tried == 1:
        return "the one effect tried does not explain"
    return f"none of {tried} effects tried explains"


# --- the noise ------------------------------------------------------------------------------------


def _noise_words(fit: Fit) -> str:
    """That noise is so many times as large as it was stated, after a space; "" if it is not."""
    scales, _rhos = fit.noise.by_kind(fit.data.problem)
    given = fit.data.problem.data.sigma
    key = {"position": "position_m", "orientation": "orientation_rad", "tension": "tension_N"}
    other = [
        f"{name} {scale:.2g} times" for name, scale in scales.items()
        if abs(scale - 1.0) > OTHER and getattr(given, key[name]) is not None
    ]  # fmt: skip
    return f" (of the {', of the '.join(other)} as large as stated)" if other else ""


def noise_notes(fit: Fit, far: NDArray[np.bool_]) -> list[str]:
    """Notes about noise that is not as stated, and about lines that hardly count."""
    out, problem = list[str](), fit.data.problem
    scales, rhos = fit.noise.by_kind(problem)
    for name, scale in scales.items():
        rho = rhos[name]
        if abs(scale - 1.0) > OTHER or rho > _ALIKE:
            alike = f", with a correlation of {rho:.2f} from row to row of a run" * (rho > _ALIKE)
            out.append(f"noise of the {name}: {scale:.2f} times the assumed noise{alike}")
    if far.any():
        lines = problem.data.lines_of(far)
        out.append(f"outliers, given little weight and not included in these errors: {lines}")
    return out


def noise_is_other(found: Diagnosis) -> bool:
    """Whether the estimated size of the noise differs clearly from the assumed one."""
    if found.path is None:
        return False
    scales, _rhos = found.path.search.best.fit.noise.by_kind(found.path.problem)
    unknown = found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    return not unknown and any(abs(scale - 1.0) > OTHER for scale in scales.values())


def size_notes(terms: Iterable[Term]) -> list[str]:
    """Notes about effects that only explain the data with implausibly large values."""
    return [
        f"{term.name} would be {largest_size(term):.3g} times its expected size, which is very "
        "unlikely: check it by hand first, as it may stand for an effect that was not tried"
        for term in terms
    ]


# --- effects that are not listed ------------------------------------------------------------------


def hints_of(chances: Chances, listed: Iterable[str]) -> dict[str, float]:
    """Classes that are probable and not listed, in words, with their probabilities."""
    listed = set(listed)
    return {
        one_of(members): p for members, p in chances.classes
        if listed.isdisjoint(members) and p > PROBABLE
    }  # fmt: skip


def _hint_of(hints: Mapping[str, float]) -> str:
    return f"hint of {probable_words(hints)}, too weak to be certain"


def probable_words(hints: Mapping[str, float]) -> str:
    """Effects, or classes of them in words, each with its probability."""
    return ", ".join(f"{name} ({probability_words(p)})" for name, p in hints.items())


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
    return [
        f"one of {', '.join(members)}: {probability_name(found)} {probability_words(p)}"
        for members, p in found.chances.classes
        if len(members) > 1 and p >= _WORTH_SAYING and listed.isdisjoint(members)
    ]


def probability_name(found: Diagnosis) -> str:
    """What probabilities are called: beside something unknown they say so."""
    beside = found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    return f"probability{' beside something unknown' if beside else ''}"


def within_words(found: Diagnosis) -> str:
    """What probabilities assume beside something unknown; "" elsewhere."""
    if found.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT or found.chances is None:
        return ""
    return (
        "Probabilities beside something unknown assume that it changes what was tried for it. No "
        "such field is followed exactly, so that effects may imitate what remains: only those are "
        "listed that are needed beside every field."
    )
