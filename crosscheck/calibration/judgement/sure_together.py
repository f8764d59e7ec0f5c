"""Wider classes, for members of the best set of effects that are not sure by themselves.

That one of a few effects is missing may be certain though one of them explains a little better than
the others, but not by enough to exclude these: stiffer cables may be 0.85 probable and a heavier
platform 0.1. Then all of them are named, since the data cannot tell for sure which it is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crosscheck.calibration.judgement.probability import Classes, of_classes
from crosscheck.calibration.judgement.verdict import SURE
from crosscheck.calibration.sets.linear_search import Names

# An effect may join a class if it costs less ln evidence than this. Those that cost least join, as
# few as make the class surer than _TO, and what costs no more than these.
_NEARLY, _TO = 6.0, 0.97


def sure_together(
    classes: Classes, scores: Mapping[Names, float], fitted: Mapping[Names, float], best: Names
) -> Classes:
    """The classes, joined by what explains nearly as well where that makes them sure.

    Args:
        classes: classes of equivalent effects.
        scores: ln evidence plus ln prior of each set.
        fitted: scores of those sets that were fitted exactly; only these can show that an effect
            explains nearly as well in place of another.
        best: the best set.
    """
    for members in classes.members:
        own = best.intersection(members)  # what the model has already is in no class
        if len(own) == 1 and classes.of(min(own)) <= SURE:
            classes = _joined(classes, scores, fitted, best, min(own))
    return classes


def _joined(
    classes: Classes,
    scores: Mapping[Names, float],
    fitted: Mapping[Names, float],
    best: Names,
    name: str,
) -> Classes:
    """The class of one member of the best set joined by others until it is sure, or as it was.

    Then whatever explains as well as one of these joins too, though it takes no more to be sure.
    """
    loss = _losses(fitted, best, name)
    members, wider, worst = list(classes.members), classes, np.inf
    for other in sorted(loss, key=lambda e: (loss[e], e)):
        mine, its = (next(some for some in members if e in some) for e in (name, other))
        if its == mine or not best.isdisjoint(its):
            continue
        if loss[other] > worst:
            break
        members = [some for some in members if some not in (mine, its)] + [(*mine, *its)]
        wider = of_classes(scores, best, classes.effect, members)
        if wider.of(name) > _TO:
            worst = max(loss.get(member, 0.0) for member in (*mine, *its))
    return wider if np.isfinite(worst) else classes


def _losses(fitted: Mapping[Names, float], best: Names, name: str) -> dict[str, float]:
    """ln evidence that it costs to have other effects in place of one member, if it is little."""
    rest, most = best - {name}, fitted.get(best, 0.0)
    return {
        next(iter(names - rest)): most - score
        for names, score in fitted.items()
        if names > rest and len(names) == len(best) and most - score < _NEARLY
    }
