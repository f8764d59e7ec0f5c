"""The result of a diagnosis: the verdict, the effects that are missing, and its JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.calibration import JointErrors
from crosscheck.comparison.associations import Association
from crosscheck.diagnosis.path import ModelPath
from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import KINDS, Problem, Rms
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Refusal
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.fit.words import rms_words
from crosscheck.given import check_above_zero
from crosscheck.inference.fields import Varying
from crosscheck.measurements.data import SI, Sigma, parse_kind
from crosscheck.model.fitted import Fitted
from crosscheck.planning.result import Sight
from seecr.effects import ApartLayout, Layout, Terms
from seecr.files import plain
from seecr.pose import Array
from seecr.prediction.model import Model
from seecr.result import Record, Result

PROBABLE = 0.5
"""An effect that is not listed is called probable from this probability on."""


@dataclass(frozen=True, eq=False, repr=False)
class MissingEffect(Result, Fitted):
    """An effect that the data justify adding to the model.

    Attributes:
        term, stderr, at_bound: the effect as fitted, see :class:`crosscheck.model.fitted.Fitted`.
        rivals: effects that these data cannot tell from it.
        check: how to check it without the robot's poses, with what to expect.
        rms: errors by kind, with it and those listed before it in the model.
        held_out_rms: the same on test runs.
        share: part of the unexplained chi2 (on test runs) that it removed.
        probability: posterior probability that it, or an equivalent, is missing.
    """

    rivals: tuple[Layout, ...]
    check: str
    rms: Rms
    held_out_rms: Rms
    share: float
    probability: float

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.term.name

    @property
    def per(self) -> str:
        """What it has other values for: "file" or "run"; "" if all rows share them."""
        return self.layout.kind if isinstance(self.layout, ApartLayout) else ""

    @property
    def title(self) -> str:
        """The effect in words."""
        title = self.layout.effect.title
        return f"{title}, another in each {self.per}" if self.per else title

    @property
    def indistinguishable(self) -> tuple[str, ...]:
        """Names of the rivals."""
        return tuple(rival.name for rival in self.rivals)

    @property
    def confirmation(self) -> str:
        """Its check, as an item of what to measure next."""
        return f"to confirm {self.effect}: {self.check}"

    @property
    def layout(self) -> Layout:
        """The parameters of the effect."""
        return self.term.layout

    @property
    def values(self) -> Array:
        """(p,) values in their units."""
        return self.term.vector

    def lines(self) -> list[str]:
        """Errors with it, values, what it cannot be told from, and how to check it."""
        left_out = rms_words(self.held_out_rms)
        out = [f"+ {self.effect}: {rms_words(self.rms)} (on test runs {left_out})"]
        out += [f"    {line}" for line in self.value_lines()]
        if self.rivals:
            out.append(f"    indistinguishable from: {', '.join(self.indistinguishable)}")
        return [*out, f"    check: {self.check}"]

    def records(self) -> list[Record]:
        """A record for each of its parameters: value and standard error, SI."""
        rivals = ", ".join(self.indistinguishable)
        return [{**record, "indistinguishable": rivals} for record in self.value_records()]

    def as_json(self) -> dict[str, Any]:
        """An item of ``missing``: SI, null where a number does not exist."""
        return {
            "effect": self.effect,
            "indistinguishable": list(self.indistinguishable),
            "parameters": self.parameters(),
            "probability": self.probability,
            "check": self.check,
            **self.rms,
            "held_out": self.held_out_rms,
            "share_of_error_removed": self.share,
            **({"per": self.per} if self.per else {}),
        }


@dataclass(frozen=True)
class NotListed:
    """An effect of the catalogue that is not listed.

    Attributes:
        effect: its name. title: the effect in words.
        score: gain in ln evidence by itself; 0 if it was not fitted.
        why_not: the reason why it is not listed.
    """

    effect: str
    title: str
    score: float
    why_not: Reason

    def as_json(self) -> dict[str, Any]:
        """An item of ``candidates``."""
        return {"effect": self.effect, "score": self.score, "why_not": str(self.why_not)}


@dataclass(frozen=True)
class Chances:
    """Posterior probabilities of effects, of classes of equivalent effects, and of the unknown.

    Attributes:
        effect: for each effect of the catalogue, the probability that it is missing.
        classes: members, the likeliest first, and the probability that one of them is missing; the
            most probable class first.
        unknown: probability of something that no effect of the catalogue is.
        seen: what something unknown may change, the likeliest first.
        shown: by kind of reading, the rms size from which on a smooth unknown effect would show;
            None if it could hide at any size, or if one is there.
        together: errors and noise of the fit of all effects; None if it was not made.
    """

    effect: dict[str, float]
    classes: tuple[tuple[tuple[str, ...], float], ...]
    unknown: float
    seen: tuple[Varying, ...] = ()
    shown: Rms | None = None
    together: JointErrors | None = None

    @property
    def looks_like(self) -> str:
        """A sentence, after a space, about what something unknown may change; "" if unsaid."""
        return f" It looks like {' or '.join(self.seen)}." if self.seen else ""

    @property
    def words(self) -> str:
        """What these data can show of unknown effects, a sentence; "" if one may be there."""
        if self.seen:
            return ""
        if self.shown is None:
            return (
                "these data could not reveal an unknown effect of any size: the effects of the "
                "catalogue can fit everything"
            )
        return (
            "an unknown effect that varies smoothly over the workspace would have been detected "
            f"from about {rms_words(self.shown)} rms on"
        )

    def as_json(self) -> dict[str, Any]:
        """``catalogue``, ``classes``, ``calibrated`` and ``unknown`` of ``diagnosis.json``."""
        unknown: dict[str, object] = {"probability": self.unknown, "shown_from": self.shown}
        if self.seen:
            likeliest, *others = self.seen
            unknown |= {"seen_in": likeliest, **({"or_in": others} if others else {})}
        place = {n: k for k, (members, _p) in enumerate(self.classes) for n in members}
        return {
            "catalogue": [
                {"effect": name, "probability": p, "class": place[name]}
                for name, p in sorted(self.effect.items(), key=lambda item: -item[1])
            ],
            "classes": [{"members": list(m), "probability": p} for m, p in self.classes],
            "unknown": unknown,
            **({} if self.together is None else {"calibrated": self.together.as_json()}),
        }


# What diagnosis.json has if no probabilities were computed.
_NOT_WEIGHED: dict[str, list[object]] = {"catalogue": [], "classes": []}


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """The complete result of a diagnosis.

    Attributes:
        verdict: the verdict. sentence: the same in words.
        missing: effects that are missing, in the order of adding.
        before, after, held_out: rms errors by kind (``position_rms_m``, ...).
        floor: rms errors that noise alone would give.
        candidates: effects that are not listed, the most probable or the best first.
        measure_next: what to measure next, in words.
        notes: what was assumed, left out or estimated.
        path: the models from the one that stood to what was found; None without a verdict.
        whiteness: test of the residuals of the last of them.
        where: what the unexplained part is associated with, the strongest first.
        refusal: why there is no verdict; None if there is one.
        left: the remainder beyond noise, and whether it matters; None without a verdict.
        chances: posterior probabilities of all effects; None without a verdict.
        sight: what the data can show and what not, whatever the verdict; None without one.
        model: the model with the missing effects, fitted together; None without a verdict.
        refitted: effects of the given model that agree with the data only with other values.
    """

    verdict: DiagnosisVerdict
    sentence: str
    missing: tuple[MissingEffect, ...]
    before: Rms
    after: Rms
    held_out: Rms
    floor: Rms
    candidates: tuple[NotListed, ...] = ()
    measure_next: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    path: ModelPath | None = None
    whiteness: Whiteness | None = None
    where: tuple[Association, ...] = ()
    refusal: Refusal | None = None
    left: LeftOver | None = None
    chances: Chances | None = None
    sight: Sight | None = None
    model: Model | None = None
    refitted: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """False if rows could not be solved; True even if the data were insufficient."""
        return self.refusal is None or not self.refusal.unsolved

    @property
    def reason(self) -> str:
        """The sentence, to stand beside the verdict's name, which it does not say again."""
        if self.refusal is None:
            return self.sentence
        why = str(self.refusal)
        return f"{why[0].upper()}{why[1:]}."

    @property
    def terms(self) -> Terms:
        """The missing effects with the values that are listed.

        Only of ``effects_found`` do these make a model by themselves, as :attr:`model` always does.
        """
        return Terms(found.term for found in self.missing)

    @property
    def measure_further(self) -> tuple[str, ...]:
        """What to measure next beside the checks of the listed effects, which say it themselves."""
        said = {found.confirmation for found in self.missing}
        return tuple(line for line in self.measure_next if line not in said)

    def lines(self) -> list[str]:
        """The verdict, how the error falls, and what to measure next."""
        out = [] if self.sight is None else self.sight.lines()
        out.append(f"{self.verdict.value}: {self.reason}")
        if self.refusal is None:
            out.append(f"before: {rms_words(self.before)}")
            out += [line for found in self.missing for line in found.lines()]
            out.append(f"noise alone: {rms_words(self.floor)}")
        if self.left is not None:
            out.append(f"error beyond the noise: {self.left.words}")
        out += [f"note: {note}" for note in self.notes]
        return [*out, *(f"measure next: {line}" for line in self.measure_further)]

    def records(self) -> list[Record]:
        """A record for each parameter of a missing effect: value and standard error, SI."""
        return [
            {"step": step, **record}
            for step, found in enumerate(self.missing, 1)
            for record in found.records()
        ]

    def as_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``: numbers in SI, null where one does not exist."""
        document: dict[str, Any] = plain(
            {
                "verdict": self.verdict.value,
                "sentence": self.sentence,
                "can_show": self.sight,
                "missing": self.missing,
                "before": self.before,
                "after": self.after,
                "held_out": self.held_out,
                "noise_floor": self.floor,
                "left_over": self.left,
                "candidates": self.candidates,
                "measure_next": self.measure_next,
                "residual": self.whiteness,
                "where": self.where,
                "notes": self.notes,
                **(_NOT_WEIGHED if self.chances is None else self.chances.as_json()),
            }
        )
        return document


# Importance beside significance: how large is the remainder beyond noise, and does it matter?
#
# With many rows, structure of a few hundredths of the noise is significant. It only counts as
# missing if it matters: above a tolerance that the user states, or else above half the noise.

# Without a stated tolerance, what is smaller than this part of the noise does not matter.
_PART = 0.5
# Chance may add so many standard errors to the mean square of the noise.
_DOUBT = 2.0


@dataclass(frozen=True)
class Tolerance:
    """How large an error beyond noise must be to matter, as rms by kind of reading.

    Attributes:
        position_m, orientation_rad, tension_N: None for half the noise.

    Raises:
        InputError: something else than a number above zero.
    """

    position_m: float | None = None
    orientation_rad: float | None = None
    tension_N: float | None = None

    def __post_init__(self) -> None:
        check_above_zero(self)

    @classmethod
    def parsed(cls, texts: Iterable[str]) -> Tolerance:
        """Parse quantities such as ``0.1mm``, ``0.05deg`` and ``1N``; the unit tells the kind.

        Raises:
            CrosscheckError: a text is no quantity, has another unit, or repeats a kind.
        """
        values: dict[str, float] = {}
        for text in texts:
            kind, value = parse_kind("--tolerance", ("position", "orientation", "tension"), text)
            key = f"{kind}_{SI[kind]}"
            if key in values:
                raise CrosscheckError(
                    f"--tolerance {text}: expected one for the {kind}, got two; leave one out"
                )
            values[key] = value
        return cls(**values)


HALF_THE_NOISE = Tolerance()
"""The tolerance if the user states none."""


@dataclass(frozen=True)
class LeftOver:
    """What a model leaves that noise does not explain.

    Attributes:
        size: rms by kind, with the keys of :class:`crosscheck.fit.problem.Kind`; 0 if
            noise explains all, None where nothing was read.
        limit: from where on it matters; None if neither tolerance nor noise was stated.
        important: whether the size exceeds the limit for some kind, by more than chance.
    """

    size: Rms
    limit: Rms
    important: bool

    @property
    def undecided(self) -> bool:
        """Whether some kind that was read has no limit."""
        return any(self.limit[key] is None for key, size in self.size.items() if size is not None)

    @property
    def words(self) -> str:
        """The size and the limit, in a few words."""
        matters = rms_words(self.limit) or "not stated, use --tolerance"
        return f"{rms_words(self.size)} (tolerance: {matters})"

    def as_json(self) -> dict[str, Any]:
        """``left_over`` of ``diagnosis.json``, SI; ``important`` is null where nothing says so."""
        important = None if self.undecided and not self.important else self.important
        return {"size": self.size, "tolerance": self.limit, "important": important}


def remainder_of(
    rms: Rms,
    noise: Rms,
    tolerance: Tolerance,
    stated: Sigma,
    doubt: Mapping[str, float] | None = None,
) -> LeftOver:
    """How far errors exceed the noise, and whether that matters.

    Noise that was not stated sets no limit, because it may contain some of the remainder. What
    chance may add to the noise, see :func:`doubt_of`, is not important.
    """
    size: Rms = {}
    limit: Rms = {}
    important = False
    for kind in KINDS:
        error, floor = rms.get(kind.key), noise.get(kind.key)
        if error is None or floor is None:
            size[kind.key] = limit[kind.key] = None
            continue
        said = getattr(tolerance, kind.sigma)
        known = getattr(stated, kind.sigma) is not None
        most = said if said is not None else (_PART * floor if known else None)
        beyond = error**2 - floor**2
        chance = _DOUBT * (doubt or {}).get(kind.key, 0.0) * floor**2
        size[kind.key], limit[kind.key] = float(np.sqrt(max(beyond, 0.0))), most
        important = important or (most is not None and beyond - chance > most**2)
    return LeftOver(size, limit, important)


def doubt_of(problem: Problem, correlation: float = 0.0) -> dict[str, float]:
    """By kind, the relative standard error of the mean square of its noise.

    It is sqrt(2/n) for n readings. With a correlation rho between successive rows, they count for
    n (1 - rho^2)/(1 + rho^2) (Bartlett 1946).
    """
    rho2 = float(np.clip(correlation, 0.0, 0.98)) ** 2
    counts = {kind.key: int(problem.counted[:, kind.columns].sum()) for kind in KINDS}
    part = (1.0 - rho2) / (1.0 + rho2)
    return {key: float(np.sqrt(2.0 / (part * n))) for key, n in counts.items() if n}
