"""The models that a diagnosis went through, as its page and its recording show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from crosscheck.diagnosis.order import Step
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.effects.held_out import blocks_of
from crosscheck.fit.least_squares.problem import KINDS, Kind, Problem, rms_by_kind
from crosscheck.fit.least_squares.state import State
from crosscheck.fit.preparation.prepare import noise_floor
from seecr.pose import Array

# The longest arrow, as a part of the widest side of the region, and the percentile of errors that
# is drawn with this length.
_ARROW, _LARGEST = 0.13, 98.0
# A side is flat if it is shorter than this part of the longest one.
_FLAT = 0.02

OTHER = 0.25
"""A size of the noise that differs from the assumed one by more than this part is reported."""


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
    """A single model: ``label`` names it, ``state`` has its predictions for the data."""

    label: str
    state: State


@dataclass(frozen=True, eq=False)
class Stage:
    """One of these models.

    Attributes:
        label: what was added, in words.
        added: the effect that was added last, "" for the model as it stood.
        listed: whether the diagnosis lists it.
        step: the step of the search.
    """

    label: str
    added: str
    listed: bool
    step: Step

    @property
    def state(self) -> State:
        """The model fitted to all rows."""
        return self.step.fit.state


def stages_of(found: Diagnosis) -> list[Stage]:
    """All models from the one that stood to the last one; none if there was no search."""
    if found.search is None:
        return []
    listed = {effect.effect for effect in found.missing}
    out = []
    for step in found.search.steps:
        if step.added:
            label = f"+ {step.added}"
        else:
            label = "the given model" if found.search.base else "plain SEECR"
        out.append(Stage(label, step.added, not step.added or step.added in listed, step))
    return out


def shown_stages(found: Diagnosis) -> tuple[Stage, Stage]:
    """The model as it stood, and the last one that holds only effects that are listed."""
    stages = stages_of(found)
    last = stages[0]
    for stage in stages[1:]:
        if not stage.listed:
            break
        last = stage
    return stages[0], last


def by_block(problem: Problem, stage: Stage, kind: Kind) -> Array:
    """The rms error of each held-out run (or block of time), in SI; NaN where nothing was read."""
    out = []
    for rows in blocks_of(problem):
        value = rms_by_kind(problem.only(rows), stage.step.held_out.raw)[kind.key]
        out.append(np.nan if value is None else value)
    return np.array(out)


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


def floor_of(found: Diagnosis, kind: Kind) -> float:
    """The rms error that noise alone would give, in SI, including that of the commanded lengths."""
    return found.floor.get(kind.key) or 0.0


def noise_is_other(found: Diagnosis) -> bool:
    """Whether the estimated size of the noise differs clearly from the assumed one."""
    if found.search is None:
        return False
    assumed = noise_floor(found.search.problem, found.search.last.fit.state)
    sizes = [(found.floor.get(key), value) for key, value in assumed.items()]
    return any(abs(one / value - 1.0) > OTHER for one, value in sizes if one and value)


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
