"""What to measure next: tries each measurement that could be added, by its sensitivities.

This serves planned poses as well as data that leave two effects equivalent. A measurement is worth
proposing if it raises a signal that is too weak now to near what a test finds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.state import derivatives
from crosscheck.measurements.data import Measurements
from crosscheck.planning.planned import MORE_POSES, Adding, Extension, Planned
from crosscheck.planning.room import Demand
from crosscheck.planning.visibility import (
    EXACT,
    Signal,
    Wanted,
    signal_left,
    signals_together,
)
from crosscheck.preparation.prepare import Progress
from seecr.arguments import silent
from seecr.counted import counted
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.pose import Array, rotvec_from_quat

# Squared signal, in units of the noise, that tells two effects apart (docs/diagnosis.md).
NEEDED = 15.0
# Repeating everything doubles each signal. A proposal must multiply it by more than GAINS, and
# bring it to this part of what is needed.
GAINS, _NEAR = 2.5, 0.1
# Kinds of measurements that are added at the same poses.
_SENSORS = (Adding.TENSIONS, Adding.POSE)
# Directions of M_hh (squares of columns) do not count if they are so much weaker than the best.
_GRAM_RANK = 1e-10

Signals = Mapping[str, Signal]


@dataclass(frozen=True)
class Gain:
    """What an added measurement would show or tell apart.

    Attributes:
        effect: the effect that gains. other: what it is told from; "" if it becomes visible.
        now, then: squared signal without and with it. needed: squared signal that a test finds.
    """

    effect: str
    other: str
    now: float
    then: float
    needed: float

    @property
    def enough(self) -> bool:
        """Whether a test finds the effect then."""
        return self.then >= self.needed

    def as_json(self) -> dict[str, Any]:
        """The content in ``plan.json``."""
        return {**vars(self), "enough": self.enough}


@dataclass(frozen=True, eq=False)
class Suggestion:
    """Something to measure.

    Attributes:
        kind: what is added. words: what to do.
        gains: first what reaches the needed signal, then what only comes nearer to it.
        poses: (k, 7) poses to add, if poses are added.
        commands: what to command for it; None for sensors.
        slack: the cables that are slack at each of the poses, by name.
        demand: tensions, and how far the robot rests from its commands.
    """

    kind: Adding
    words: str
    gains: tuple[Gain, ...]
    poses: Array | None = None
    commands: Measurements | None = None
    slack: tuple[tuple[str, ...], ...] = ()
    demand: Demand | None = None

    @property
    def reached(self) -> tuple[Gain, ...]:
        """The gains that a test finds."""
        return tuple(g for g in self.gains if g.enough)

    @property
    def places(self) -> tuple[str, ...]:
        """The poses to add, in words."""
        out = []
        for k, pose in enumerate(self.poses if self.poses is not None else ()):
            turn = " ".join(f"{angle:.3g}" for angle in np.degrees(rotvec_from_quat(pose[3:])))
            x, y, z = pose[:3]
            loose = f", slack: {' '.join(self.slack[k])}" if self.slack and self.slack[k] else ""
            out.append(f"({x:.4g} {y:.4g} {z:.4g}) m, turned by ({turn}) deg{loose}")
        return tuple(out)

    def as_json(self) -> dict[str, Any]:
        """The content in ``plan.json``."""
        return {
            "kind": self.kind.value,
            "words": self.words,
            "poses": self.poses,
            "slack": None if self.poses is None else self.slack,
            "demand": self.demand,
            "gains": self.gains,
        }


def propose(
    options: Sequence[Extension],
    own: Signals,
    wanted: Sequence[Wanted],
    signals: Callable[[Planned], Signals],
    progress: Progress = silent,
) -> tuple[Suggestion, ...]:
    """What to add, each tried by itself, the most useful first.

    Args:
        options: what could be added. own: signals of effects in what is read so far.
        wanted: what these do not show or tell apart.
        signals: computes the signals of the same effects in added readings.
        progress: called with what is being done and the fraction that is done.
    """
    out = []
    for k, option in enumerate(options):
        progress(option.words, k / len(options))
        if not option.plan.problem.use.any():
            continue
        there = signals(option.plan)
        if option.kind is Adding.POSES:
            out.append(_few_poses(option, own, there, wanted))
            continue
        told = option.plan.problem.data if option.kind not in _SENSORS else None
        gains = _gains(own, there, wanted)
        demand = None if told is None else Demand.of(option.plan)
        out.append(Suggestion(option.kind, option.words, gains, commands=told, demand=demand))
    useful = [s for s in out if s.gains]
    return tuple(sorted(useful, key=lambda s: (-len(s.reached), -len(s.gains))))


def _gains(own: Signals, there: Signals, wanted: Sequence[Wanted]) -> tuple[Gain, ...]:
    both = signals_together(own, there)
    gains = []
    for want in wanted:
        g = both[want.effect]
        then = signal_left(g, both[want.other]) if want.other else g.power
        if then > GAINS * want.now and then > _NEAR * want.needed:
            gains.append(Gain(want.effect, want.other, want.now, then, want.needed))
    return tuple(sorted(gains, key=lambda g: (not g.enough, -g.then / g.needed)))


def _few_poses(
    grid: Extension, own: Signals, there: Signals, wanted: Sequence[Wanted]
) -> Suggestion:
    """The few poses that gain most."""
    row_of = grid.plan.problem.row_of
    # exact twins stay twins at any pose
    open_ = [want for want in wanted if not want.other or want.now > 0.0]
    rows = chosen_poses(own, there, row_of, open_, MORE_POSES)
    if not rows or grid.poses is None:
        return Suggestion(Adding.POSES, "", ())
    some = np.isin(row_of, rows)
    few = {n: Signal(s.layout, s.shape, s.columns[some]) for n, s in there.items()}
    words = f"add the {counted(len(rows), 'pose')} listed below"
    gains, told = _gains(own, few, open_), grid.plan.problem.data.rows(rows)
    names = np.array(grid.plan.problem.robot.cable_names)
    slack = tuple(tuple(names[loose].tolist()) for loose in grid.plan.base.prediction.slack[rows])
    demand = Demand.of(grid.plan, np.array(rows))
    return Suggestion(Adding.POSES, words, gains, grid.poses[rows], told, slack, demand)


def telling_apart(
    plan: Planned, options: Sequence[Extension], name: str, rival: Layout
) -> tuple[Suggestion, ...]:
    """What of some options would tell an effect of the plan's model from a rival of it."""
    own = _pair(plan, name, rival)
    now = signal_left(own[name], own[rival.name])
    if now <= EXACT * own[name].power:
        now = 0.0
    want = Wanted(name, rival.name, now, NEEDED)
    found = propose(options, own, [want], lambda there: _pair(there, name, rival))
    enough = [suggestion for suggestion in found if suggestion.reached]
    return tuple(sorted(enough, key=lambda suggestion: -suggestion.gains[0].then))


def _pair(plan: Planned, name: str, rival: Layout) -> dict[str, Signal]:
    """Signal of an effect at its values, and of all that could imitate it: rival and the rest."""
    shapes = rival.effect.shapes(plan.base.prediction.setup)
    shape = shapes[0] if shapes else {}
    terms = plan.base.terms.with_term(Term(rival, rival.start(shape)))
    columns = derivatives(plan.problem, plan.base.of(terms), frozen=True) * terms.scale
    own = terms.own(name)
    signal = columns[:, own] @ terms.sizes[own]
    return {
        name: Signal(terms[name].layout, {}, signal[:, None]),
        rival.name: Signal(rival, shape, columns[:, ~own]),
    }


# Chooses the poses that tell most, one after the other, each the best beside those before.
#
# For an effect g and its imitator h, the signal that h cannot imitate is tr(M_gg - M_gh M_hh^+
# M_hg), with M the sum of J^T J over all readings (the T-criterion of model discrimination). So a
# pose is tried by adding its own M.


def chosen_poses(
    own: Mapping[str, Signal],
    there: Mapping[str, Signal],
    row_of: NDArray[np.integer],
    pairs: Sequence[Wanted],
    most: int,
    sample: int | None = None,
) -> list[int]:
    """Rows of the candidate poses to add, the best first.

    Args:
        own: signals in the readings planned so far.
        there: signals of the same effects in the readings of all candidates.
        row_of: (N,) the candidate that each of those readings belongs to.
        pairs: what is not shown or told apart so far.
        most: most poses to choose.
        sample: how many candidates to try in each step, drawn anew; by default all. A sample is
            nearly as good and much faster (Mirzasoleiman et al. 2015, Lazier than lazy greedy).
    """
    if not pairs:
        return []
    names = list(own)
    ends = np.cumsum([signal.columns.shape[1] for signal in own.values()]).tolist()
    part = dict(zip(names, map(slice, [0, *ends], ends), strict=False))
    whole = np.concatenate([own[n].columns for n in names], axis=1)
    added = np.concatenate([there[n].columns for n in names], axis=1)
    candidates = np.unique(row_of)
    grams = np.stack([(rows := added[row_of == k]).T @ rows for k in candidates])
    total = np.asarray(whole.T @ whole)
    chosen: list[int] = []
    score = _scores(total[None], part, pairs)[0]
    random = np.random.default_rng(0)
    for _ in range(min(most, len(candidates))):
        # each pose once: measuring it again tells nothing new
        left = np.flatnonzero(~np.isin(candidates, chosen))
        if sample is not None and len(left) > sample:
            left = random.choice(left, sample, replace=False)
        scores = _scores(total[None] + grams[left], part, pairs)
        best = int(np.argmax(scores))
        if not scores[best] > score * (1.0 + 1e-6):
            break
        chosen.append(int(candidates[left[best]]))
        total, score = total + grams[left[best]], float(scores[best])
    return chosen


def _scores(grams: Array, part: Mapping[str, slice], pairs: Sequence[Wanted]) -> Array:
    """Score of each candidate (k,): the sum over pairs of signal over needed, hardly beyond 1."""
    score = np.zeros(len(grams))
    inverse: dict[str, Array] = {}
    for want in pairs:
        g, other = part[want.effect], want.other
        signal = np.trace(grams[:, g, g], axis1=1, axis2=2)
        if other:
            h = part[other]
            if other not in inverse:
                inverse[other] = np.asarray(
                    np.linalg.pinv(grams[:, h, h], rcond=_GRAM_RANK, hermitian=True), dtype=float
                )
            cross = grams[:, g, h]
            imitated = np.einsum("kgh,khi,kgi->k", cross, inverse[other], cross, optimize=True)
            signal = signal - imitated
        ratio = np.maximum(signal, 0.0) / want.needed
        score += np.minimum(ratio, 1.0) + 0.01 * np.log1p(ratio)
    return score
