"""Importance beside significance: how large is the remainder beyond noise, and does it matter?

With many rows, structure of a few hundredths of the noise is significant. It only counts as missing
if it matters: above a tolerance that the user states, or else above half the noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.fit.problem import KINDS, Problem, Rms
from crosscheck.fit.words import rms_words
from crosscheck.given import check_above_zero
from crosscheck.measurements.data import SI, Sigma, parse_kind

__all__ = ["HALF_THE_NOISE", "LeftOver", "Tolerance", "doubt_of", "remainder_of"]

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
