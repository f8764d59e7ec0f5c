"""Whether fewer effects explain the data as well, with noise of their own.

Sets are compared with the noise of the fit of all effects: its size, autocorrelation and outliers.
With that many parameters it can follow an outlier, above all where a cable is about to go slack,
and in few readings it can follow noise that is correlated. What is left is then too small, and
calls for effects that do not exist. So the best set is also compared with what remains of it
without doubtful members, each with the noise that it leaves itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations

from crosscheck.calibration.exact import FEW, width_of
from crosscheck.calibration.joint import JointFit, Setting, settle
from crosscheck.calibration.refits import Found
from crosscheck.calibration.robust import log_chance_of_outliers
from crosscheck.calibration.sets import Names
from crosscheck.calibration.stages import with_noise, worth
from crosscheck.fit.state import evaluate
from seecr.effects import Terms

# A member that is worth more ln evidence than this is not doubtful.
_NEEDED = 300.0


def noise_of_fewer(setting: Setting, found: Found) -> JointFit | None:
    """The fit of fewer effects that explains the data better than the best set, each by its noise.

    Args:
        setting: the data.
        found: the compared sets.

    Returns:
        None if no such set does, if no member is doubtful, or if the best set is large.
    """
    if len(found.best.names - found.always) > FEW:
        return None
    some = list(_doubtful_members(found))
    whole = _fitted(setting, found, frozenset()) if some else None
    if whole is None:
        return None
    fewer = (_fitted(setting, found, out) for out in some)
    fits = [whole, *(fit for fit in fewer if fit is not None)]
    best = max(fits, key=lambda fit: evidence(setting, found, fit))
    return None if best is whole else best


def evidence(setting: Setting, found: Found, joint: JointFit) -> float:
    """ln evidence of a set by a fit with its own noise, plus ln of its prior."""
    prior = found.scores.log_prior(frozenset(joint.terms.names))
    return worth(setting, joint) + prior + log_chance_of_outliers(setting.chain, joint.weight)


def _doubtful_members(found: Found) -> Iterable[Names]:
    """Members of the best set, alone or together, that are worth little ln evidence each."""
    best, scores = found.best.names, found.scores
    near = scores.neighbours(best)
    least = scores.score(best) - _NEEDED
    some = [name for name in sorted(best - found.always) if near[best - {name}] > least]
    for count in range(1, len(some) + 1):
        yield from map(frozenset, combinations(some, count))


def _fitted(setting: Setting, found: Found, out: Names) -> JointFit | None:
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
