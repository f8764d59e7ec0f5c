"""The models that a diagnosis shows: from the one that stood, effect by effect, to what it found.

They are hypotheses of the search. Effects are added in the order in which that pays: each time the
one is next whose addition has the greatest score, that is, explains most for its parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from crosscheck.fit.least_squares.problem import KINDS, Problem, Rms, rms_by_kind
from crosscheck.fit.least_squares.state import State
from crosscheck.inference.catalogue import Key, name_of, part_of
from crosscheck.inference.fit import Fit
from crosscheck.inference.held_out import HeldOut, by_part, hold_out
from crosscheck.inference.search import Search
from seecr.effects import ApartLayout, Term
from seecr.pose import Array

# The longest arrow, as a part of the widest side of the region, and the percentile of errors that
# is drawn with this length.
_ARROW, _LARGEST = 0.13, 98.0
# A side is flat if it is shorter than this part of the longest one.
_FLAT = 0.02


@dataclass(frozen=True, eq=False)
class Stage:
    """One of the models.

    Attributes:
        label: what was added, in words. added: the effect, "" for the model as it stood.
        key: the hypothesis, see
            :mod:`crosscheck.inference.catalogue`. fit: its fit. held_out: its errors on held-out
            runs.
    """

    label: str
    added: str
    key: Key
    fit: Fit
    held_out: HeldOut

    @property
    def state(self) -> State:
        """The model on all rows."""
        return self.fit.state

    @property
    def rms(self) -> Rms:
        """Errors on all rows, by kind."""
        return rms_by_kind(self.fit.data.problem, self.state.raw)


@dataclass(frozen=True, eq=False)
class ModelPath:
    """The models from the one that stood to the last one.

    Attributes:
        problem: the data. search: the search that met them. stages: the models.
        noise: by kind of reading, the noise of the best hypothesis over the stated one.
    """

    problem: Problem
    search: Search
    stages: tuple[Stage, ...]
    noise: Array

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects that the model had before."""
        return self.search.every.stood.names

    @property
    def first(self) -> Stage:
        """The model as it stood."""
        return self.stages[0]

    @property
    def last(self) -> Stage:
        """The last model: with all effects that are listed."""
        return self.stages[-1]

    @property
    def tried(self) -> int:
        """How many effects were tried beside the model as it stood."""
        return len(self.search.every.effects)

    def alone(self, name: str) -> tuple[float | None, Term] | None:
        """What an effect does when it alone is added to the model as it stood.

        Returns:
            The part of the excess chi2 that it removes on all rows, 0 to 1 (None without excess),
            and its values; None if it moves nothing. By the linear model if it was not fitted.
        """
        search, about = self.search, self.search.none_about
        none, fitted = about.fit, search.cache.get(search.stood | {name})
        if fitted is not None:
            left, term = fitted.fit.state.chi2, fitted.fit.terms[name]
        elif name in about.columns:
            widths = {k: about.linear.groups[k].middle for k in (*search.stood, name)
                      if k in about.linear.groups}  # fmt: skip
            solved = about.solved(widths)
            term = about.values(solved)[name]
            white = none.state.white - about.columns[name] @ solved.values[solved.place(name)]
            left = float(white @ white)
        else:
            return None
        excess = none.state.chi2 - self.problem.n_readings
        share = (none.state.chi2 - left) / excess if excess > 0.0 else None
        return None if share is None else float(np.clip(share, 0.0, 1.0)), term

    def removed_by(self, index: int) -> float:
        """The part of the error on held-out runs that stage ``index`` removes from the one before.

        0 to 1, of the chi2 beyond the noise.
        """
        before, after = self.stages[index - 1].held_out, self.stages[index].held_out
        kinds = [self.problem.counted[:, kind.columns].sum() for kind in KINDS]
        noise = float(np.sum(np.array(kinds) * self.noise**2))
        excess = float(before.chi2.sum()) - noise
        fall = float(before.chi2.sum() - after.chi2.sum())
        return float(np.clip(fall / excess, 0.0, 1.0)) if excess > 0.0 else 0.0


def path_to(search: Search, listed: Sequence[str], whole: bool) -> ModelPath:
    """The path from the model as it stands to the members that are listed.

    Args:
        search: the search. listed: their keys. whole: whether they are all that is missing; the
            last fit is then that of plausible sizes.
    """
    problem, stood = search.data.problem, search.stood
    named = bool(search.every.stood)
    start = "the given model" if named else "plain SEECR"
    none = search.cache[stood]
    assert none is not None
    fit = search.unfitted if named else none.fit
    stages = [Stage(start, "", stood, fit, hold_out(fit))]
    if named and search.wants_refit:
        stages.append(Stage(f"{start}, fitted", "", stood, none.fit, hold_out(none.fit)))
    key, left = stood, list(listed)
    while left:
        tried = {k: search.reached(key, key | {k}) for k in left}
        fitted = {k: found for k, found in tried.items() if found is not None}
        if not fitted:
            break
        best = max(fitted, key=lambda k: (fitted[k].score, k))
        found = fitted[best]
        if whole and len(left) == 1:
            found = search.at_plausible_sizes(found)
        label = f"+ {name_of(best)}" + (f" (each {part_of(best)})" if part_of(best) else "")
        stage = Stage(label, name_of(best), found.key, found.fit, hold_out(_by_part(found.fit)))
        stages.append(stage)
        key = key | {best}
        left.remove(best)
    return ModelPath(problem, search, tuple(stages), search.best.fit.noise.scale)


def _by_part(fit: Fit) -> Fit:
    """A fit with blocks that are parts of each file or run, if effects have values for these."""
    kinds = {t.layout.kind for t in fit.terms if isinstance(t.layout, ApartLayout)}
    if not kinds:
        return fit
    parts = fit.data.problem.data.parts["run" if "run" in kinds else "file"]
    return by_part(fit, np.unique(parts, return_inverse=True)[1].astype(np.int64))


# --- how errors are drawn -------------------------------------------------------------------------


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
