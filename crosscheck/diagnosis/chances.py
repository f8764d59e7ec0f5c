"""The probabilities that effects are missing, as a diagnosis states them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from crosscheck.calibration.joint_fit.all_effects import JointErrors
from crosscheck.calibration.search import SetSearch
from crosscheck.calibration.unknown.imitated import Imitated
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.fit.least_squares.problem import Rms
from crosscheck.fit.words import rms_words

PROBABLE = 0.5
"""An effect that is not listed is called probable from this probability on."""


# What diagnosis.json has if no probabilities were computed.
NOT_WEIGHED: Mapping[str, Sequence[object]] = {"catalogue": [], "classes": []}


@dataclass(frozen=True)
class Chances:
    """Posterior probabilities of effects and of classes of equivalent effects.

    Attributes:
        effect: for each effect of the catalogue, the probability that it is missing.
        classes: members, the likeliest first, and the probability that one of them is missing; the
            most probable class first.
        field: ln odds that something smooth remains that no effect of the catalogue explains;
            None without a joint fit.
        together: errors and noise of the joint fit; None without one.
        shown: by kind of reading, the rms size from which on a smooth unknown effect would show;
            None if it could hide at any size.
        further: for effects that share a class with others that are needed more, the probability
            that as many members of the class are missing.
        imitated: something smooth and unknown that some of the effects found imitate.
        doubt: something smooth and unknown that is much less likely than the effects it could
            replace, but that the data do not exclude.
        varies: what something unknown changes that is beside all effects, the likeliest first.
    """

    effect: dict[str, float]
    classes: tuple[tuple[tuple[str, ...], float], ...]
    field: float | None
    together: JointErrors | None
    shown: Rms | None = None
    further: Mapping[str, float] = dataclasses.field(default_factory=dict)
    imitated: Imitated | None = None
    doubt: Imitated | None = None
    varies: tuple[Varying, ...] = ()

    @property
    def seen(self) -> tuple[Varying, ...]:
        """What something unknown may change, the likeliest first; empty if that is not known."""
        if self.imitated is not None:
            return self.imitated.seen
        return self.varies

    @property
    def looks_like(self) -> str:
        """A sentence, after a space, about what something unknown may change; "" if unsaid."""
        return f" It looks like {' or '.join(self.seen)}." if self.seen else ""

    @property
    def words(self) -> str:
        """What these data can show of unknown effects, a sentence; "" if effects imitate one.

        In that case it may have any size that known effects can imitate.
        """
        if self.imitated is not None:
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

    def of(self, name: str) -> float:
        """Probability that an effect or an equivalent is missing; see ``further`` for some."""
        every = next((p for members, p in self.classes if name in members), 0.0)
        return self.further.get(name, every)

    def as_json(self) -> dict[str, Any]:
        """``catalogue``, ``classes``, ``calibrated`` and ``unknown`` of ``diagnosis.json``."""
        unknown: dict[str, object] = {"log_odds": self.field, "shown_from": self.shown}
        if self.imitated is not None:
            unknown |= {
                "instead_of": sorted(self.imitated.replaced), **_seen(self.imitated.seen),
            }  # fmt: skip
        elif self.varies:
            unknown |= _seen(self.varies)
        if self.doubt is not None:
            unknown["not_excluded"] = {
                "probability": self.doubt.probability,
                "instead_of": sorted(self.doubt.replaced),
                **_seen(self.doubt.seen),
            }
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


def _seen(some: Sequence[Varying]) -> dict[str, object]:
    """What something unknown changes, the likeliest by itself."""
    likeliest, *others = some
    return {"seen_in": likeliest, **({"or_in": others} if others else {})}


def chances_of(sought: SetSearch) -> Chances:
    """The probabilities that follow from compared sets."""
    classes, in_place = sought.classes, sought.in_place
    pairs = zip(classes.members, classes.probability, strict=True)
    return Chances(
        classes.effect, tuple(pairs), sought.field_odds, sought.calibration.together, sought.shown,
        classes.further, sought.judgement.imitated,
        in_place if in_place.is_doubt else None, sought.varies,
    )  # fmt: skip
