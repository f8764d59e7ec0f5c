"""How errors are drawn: models that can be, how long arrows are, and from where they are seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from crosscheck.fit.problem import KINDS, Problem
from crosscheck.fit.state import State
from seecr.pose import Array

# The longest arrow, as a part of the widest side of the region, and the percentile of errors that
# is drawn with this length.
_ARROW, _LARGEST = 0.13, 98.0
# A side is flat if it is shorter than this part of the longest one.
_FLAT = 0.02


class Drawn(Protocol):
    """A model that can be drawn: it has a label and a state."""

    @property
    def label(self) -> str:
        """The model in words."""

    @property
    def state(self) -> State:
        """The model on the data."""


@dataclass(frozen=True, eq=False)
class Standing:
    """A single model that can be drawn: ``label`` names it, ``state`` has its predictions."""

    label: str
    state: State


def magnification(problem: Problem, state: State) -> float:
    """Factor by which arrows of the position error are enlarged; 0 if there are none.

    It is a round number with which all but the largest arrows are shorter than a given part of the
    measured region.
    """
    place = state.prediction.pose[:, :3]
    size = KINDS[0].sizes(problem, state.raw)
    size = size[np.isfinite(size)]
    if len(size) == 0 or not np.any(size > 0):
        return 0.0
    span = float(np.max(np.ptp(place[problem.use], axis=0)))
    longest = max(float(np.percentile(size, _LARGEST)), 1e-12)
    factor = _ARROW * max(span, 1e-9) / longest
    power = 10.0 ** np.floor(np.log10(factor))
    return float(max(s for s in (1.0, 2.0, 5.0) if s * power <= factor) * power)


def drawn(magnify: float) -> str:
    """The scale of the arrows, in words."""
    if magnify == 1.0:
        return "to scale"
    return f"at {magnify:g} times their length"


def views_of(place: Array) -> list[tuple[int, int]]:
    """Pairs of axes to show: from above and from the side, or the plane of a flat robot.

    Args:
        place: (n, 3) [m] positions that are to be seen.
    """
    span = np.ptp(place, axis=0)
    wide = span > _FLAT * max(float(span.max()), 1e-12)
    if wide.all():
        return [(0, 1), (0, 2)]
    kept = [int(k) for k in np.flatnonzero(wide)]
    kept += [k for k in (0, 2, 1) if k not in kept]
    first, second = sorted(kept[:2])
    return [(first, second)]
