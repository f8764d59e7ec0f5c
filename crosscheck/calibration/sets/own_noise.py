"""Whether fewer effects explain the data as well, with noise of their own.

Sets are compared with the noise of the fit of all effects: its size, autocorrelation and outliers.
With that many parameters it can follow an outlier, above all where a cable is about to go slack,
and in few readings it can follow noise that is correlated. What is left is then too small, and
calls for effects that do not exist. So the best set is also compared with what remains of it
without doubtful members, each with the noise that it leaves itself. That also says how sure these
members are: the size of noise that is estimated from few readings, and how much it follows itself,
are uncertain, and the evidence with one value of both is surer than the data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.joint_fit.stages import with_noise
from crosscheck.calibration.linear_evidence.priors import width_of
from crosscheck.calibration.noise.colour import log_det
from crosscheck.calibration.noise.robust import log_chance_of_outliers
from crosscheck.calibration.sets.exact import FEW, scored
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.fit.least_squares.state import evaluate
from seecr.effects import Terms

# A member that is worth more ln evidence than this is not doubtful.
_NEEDED = 300.0


@dataclass(frozen=True, eq=False)
class OwnNoise:
    """The best set and what remains of it without doubtful members, each with its own noise.

    Attributes:
        fewer: the fit of fewer effects that explains the data better than the best set; None if no
            such set does.
        without: for each group of doubtful members, also none, the probability among these sets
            that it is not needed and the others are.
    """

    fewer: JointFit | None = None
    without: Mapping[Names, float] = field(default_factory=dict)


def by_own_noise(
    setting: Setting, found: ComparedSets, may_be: Callable[[JointFit], bool] = lambda _fit: True
) -> OwnNoise:
    """Compare the best set with fewer effects, each by its own noise.

    Args:
        setting: the data.
        found: the compared sets.
        may_be: whether what a fit leaves may be noise.

    Returns:
        nothing if no member is doubtful, or if the best set is large.
    """
    if len(found.best.names - found.always) > FEW:
        return OwnNoise()
    some = list(_doubtful_members(found))
    whole = _fitted(setting, found, frozenset()) if some else None
    if whole is None:
        return OwnNoise()
    fits = {out: _fitted(setting, found, out) for out in some}
    worth = {
        out: evidence_by_own_noise(setting, found, fit)
        for out, fit in fits.items()
        if fit is not None and may_be(fit)
    }
    own = evidence_by_own_noise(setting, found, whole)
    best = max(worth, key=lambda out: worth[out], default=None)
    fewer = None if best is None or worth[best] <= own else fits[best]
    every = {frozenset[str](): own, **worth}
    total = np.logaddexp.reduce(list(every.values()))
    return OwnNoise(fewer, {out: float(np.exp(e - total)) for out, e in every.items()})


def evidence_by_own_noise(setting: Setting, found: ComparedSets, joint: JointFit) -> float:
    """ln evidence of a set by a fit with its own noise, plus ln of its prior."""
    fixed = replace(setting, frozen=True, weight=joint.weight)
    names, noise = frozenset(joint.terms.names), (setting.chain, joint.colour, joint.weight)
    score = scored(fixed, joint, names, found.best.widths, found.scores).score
    return score - 0.5 * log_det(*noise) + log_chance_of_outliers(setting.chain, joint.weight)


def _doubtful_members(found: ComparedSets) -> Iterable[Names]:
    """Members of the best set, alone or together, that are worth little ln evidence each."""
    best, scores = found.best.names, found.scores
    near = scores.neighbours(best)
    least = scores.score(best) - _NEEDED
    some = [name for name in sorted(best - found.always) if near[best - {name}] > least]
    for count in range(1, len(some) + 1):
        yield from map(frozenset, combinations(some, count))


def _fitted(setting: Setting, found: ComparedSets, out: Names) -> JointFit | None:
    """The best set without some members, fitted from its values with its own noise."""
    free = replace(setting, frozen=True, weight=None)
    best = found.best.joint
    kept = Terms(term for term in best.terms if term.name not in out)
    state = evaluate(free.problem, kept, free.factor, best.state)
    if not state.valid:
        return None
    width = width_of(kept, found.best.widths)
    joint = with_noise(free, settle(free, state, width, best.colour))
    return joint if joint.settled else None
