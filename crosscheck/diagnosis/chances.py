"""How probable it is that each effect is missing, as a diagnosis says it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from crosscheck.calibration.all_effects import JointErrors
from crosscheck.calibration.instead import Instead
from crosscheck.calibration.search import Sought
from crosscheck.fit.problem import Rms
from crosscheck.fit.words import rms_words

PROBABLE = 0.5
"""From this probability on an effect that is not listed is called probable."""


# What diagnosis.json says where nothing was weighed.
NOT_WEIGHED: dict[str, Any] = {"catalogue": [], "classes": []}


@dataclass(frozen=True)
class Chances:
    """Probabilities of the effects and of classes of equals.

    Attributes:
        effect: of each effect of the catalogue, that it is missing.
        classes: members, the first of them the likeliest, and the probability that one of them
            is missing; the most probable class first.
        field: ln odds that something smooth is left which no effect of the catalogue explains;
            None where no joint fit was made.
        together: the joint fit; None where none was made.
        further: of effects that share a class with one needed more, that both are missing.
        shown: rms size by kind of reading from which on a smooth effect that nobody knows would
            show beside the catalogue; None where it could hide at any size.
        imitated: something smooth that no effect explains, and some of what was found imitates.
    """

    effect: dict[str, float]
    classes: tuple[tuple[tuple[str, ...], float], ...]
    field: float | None
    together: JointErrors | None
    shown: Rms | None = None
    further: Mapping[str, float] = dataclasses.field(default_factory=dict)
    imitated: Instead | None = None

    @property
    def words(self) -> str:
        """What these data can show of effects that nobody knows, a sentence; "" where one is there.

        It may be of any size that known effects can imitate.
        """
        if self.imitated is not None:
            return ""
        if self.shown is None:
            return "these data could not show an unknown effect of any size: the catalogue fits all"
        return (
            f"an unknown effect that is smooth over the workspace would have shown from about "
            f"{rms_words(self.shown)} rms on"
        )

    def of(self, name: str) -> float:
        """Probability that an effect or one of its class is missing, beside those needed more."""
        every = next((p for members, p in self.classes if name in members), 0.0)
        return self.further.get(name, every)

    def as_json(self) -> dict[str, Any]:
        """``catalogue``, ``classes``, ``calibrated`` and ``unknown`` of ``diagnosis.json``."""
        unknown: dict[str, Any] = {"log_odds": self.field, "shown_from": self.shown}
        if self.imitated is not None:
            unknown |= {
                "instead_of": sorted(self.imitated.replaced), "seen_in": self.imitated.seen,
            }  # fmt: skip
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


def chances_of(sought: Sought) -> Chances:
    """The probabilities of compared sets."""
    classes = sought.classes
    pairs = zip(classes.members, classes.probability, strict=True)
    return Chances(
        classes.effect, tuple(pairs), sought.field_odds, sought.calibration.together, sought.shown,
        classes.further, sought.judgement.imitated,
    )  # fmt: skip
