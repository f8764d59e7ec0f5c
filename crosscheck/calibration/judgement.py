"""What the compared sets say: the verdict, the effects that are sure, and what to do.

Something unknown is there where a smooth field over the workspace earns more evidence than chance
gives it, beside all effects or in the place of some, or where runs left out are predicted worse
than the fit itself expects. Where the data leave open which effects it is, or it takes many, that
is a calibration and no diagnosis; so it is where the whole catalogue leaves a field nothing, but
the best few do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.equals import SMALL
from crosscheck.calibration.field import UNKNOWN
from crosscheck.calibration.instead import NOT_ASKED, Instead
from crosscheck.calibration.probability import Classes
from crosscheck.calibration.refits import Found
from crosscheck.calibration.sets import Names
from crosscheck.fit.reasons import DiagnosisVerdict

# An effect is sure from this probability of it or its equals.
SURE = 0.95
# Sets up to this size are a diagnosis; at most this many classes may be open, or so many where
# every member of the set is sure.
_FEW, _OPEN, _OPEN_BESIDE = 5, 1.0, 2.0
# Effects of more numbers than a pose has, one or more for each cable: more than so many of them are
# a calibration, since together they imitate anything.
_NUMBERS, _LARGE = 6, 2
# A name is owed from this much ln evidence; what explains less may be chance.
_OWED = 12.5
# Runs left out may be this many times as far off as the fit expected.
SURPRISE = 2.0
# In a large set each effect must carry more than this part of what all explain: others may
# imitate what is missing.
_PART, _WORTH = 0.1, 25.0
# Where a field explains what is left, more than this part, and by few parameters; in the place of
# some, of what the others do nearly all.
_MOST, _ALL = 0.5, 0.95

NONE: Names = frozenset()


@dataclass(frozen=True, eq=False)
class Judgement:
    """The verdict and what is sure.

    Attributes:
        verdict: of the data.
        sure: effects that are missing beyond doubt, each the first of its class.
        undecided: how many classes are open.
        doubted: members of the best set of a size that hardly happens.
        more: whether a smooth field explains what the best set leaves.
        imitated: something unknown that members of the best set imitate; None where nothing is.
    """

    verdict: DiagnosisVerdict
    sure: tuple[str, ...]
    undecided: float
    doubted: Names = NONE
    more: bool = False
    imitated: Instead | None = None


def judge(
    found: Found,
    classes: Classes,
    field_odds: float,
    surprise: float,
    strange: bool = False,
    doubted: Names = NONE,
    beside: float = -np.inf,
    instead: Instead = NOT_ASKED,
) -> Judgement:
    """The verdict.

    Args:
        found: the compared sets.
        classes: probabilities.
        field_odds: ln odds of a smooth field beside the whole catalogue.
        surprise: of the worst run left out of the joint fit, a reading.
        strange: what was taken for noise is none.
        doubted: members of the best set of a size that hardly happens.
        beside: ln odds of a smooth field beside the best set.
        instead: of one in the place of some of its members.
    """
    best, undecided = found.best.names - found.always - found.idle, classes.undecided
    unknown = strange or field_odds > UNKNOWN or surprise > SURPRISE
    sure = sure_effects(found, classes, True)
    few = len(best) <= _FEW and undecided < (_OPEN_BESIDE if set(sure) == best else _OPEN)
    more = beside > UNKNOWN
    large = too_large(_size(found, name) for name in best)
    few = few and not doubted and not more and not large
    sure = adequate(found, sure) if few and sure else sure_effects(found, classes, False)
    sure = tuple(name for name in sure if name not in doubted)
    if more:
        worth = worths(found)
        sure = tuple(name for name in carrying_most(found, worth, _MOST) if name in sure)
    if instead.chance:
        # of several that stay some may take in what others of them do
        kept = carrying_most(found, instead.worth, _ALL)
        kept = tuple(name for name in kept if name not in doubted)
        if kept or not unknown:
            return Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, kept, undecided, imitated=instead)
    if unknown:  # known effects imitate it: none of them is sure
        return Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, (), undecided)
    if not sure and not more and undecided < _OPEN and explained(found) < _OWED:
        return Judgement(DiagnosisVerdict.NO_EFFECT_MISSING, (), undecided)
    verdict = DiagnosisVerdict.EFFECTS_FOUND if few and sure else DiagnosisVerdict.MANY_EFFECTS
    return Judgement(verdict, sure, undecided, doubted, more)


def too_large(sizes: Iterable[int]) -> bool:
    """Whether effects of so many parameters are a calibration together, and no diagnosis."""
    return sum(size > _NUMBERS for size in sizes) > _LARGE


def sure_effects(found: Found, classes: Classes, few: bool) -> tuple[str, ...]:
    """Members of the best set that are missing beyond doubt, the most valuable first.

    Args:
        found: the compared sets.
        classes: probabilities.
        few: these few effects explain everything; else those count that carry much of it.
    """
    worth = worths(found)
    least = 0.0 if few else max(_WORTH, _PART * sum(worth.values()))
    some = [e for e in worth if classes.of(e) > SURE and worth[e] > least]
    return tuple(sorted(some, key=lambda e: -worth[e]))


def adequate(found: Found, sure: tuple[str, ...]) -> tuple[str, ...]:
    """These effects, and further ones of the best set while it explains much that they do not.

    Which effect it is may be open where that something is missing is not.
    """
    worth, listed = worths(found), list(sure)
    for name in sorted(set(worth) - set(sure), key=lambda e: -worth[e]):
        alone = found.refit(found.always | set(listed))
        if alone is not None and alone.score > found.best.score - _OWED:
            break
        listed.append(name)
    return tuple(sorted(listed, key=lambda e: -worth[e]))


def carrying_most(found: Found, worth: Mapping[str, float], part: float) -> tuple[str, ...]:
    """The one of few parameters that carries more than a part of what its set does, if any.

    Args:
        found: the compared sets. worth: ln evidence that members of one are worth.
        part: at least a half.
    """
    least = max(_WORTH, part * sum(worth.values()))
    return tuple(n for n in worth if _size(found, n) <= SMALL and worth[n] > least)


def _size(found: Found, name: str) -> int:
    """How many numbers an effect has, shapes aside; none where the linear model does not see it."""
    group = found.scores.gram.groups.get(name)
    return 0 if group is None else len(group.columns)


def worths(found: Found) -> dict[str, float]:
    """ln evidence that each member of the best set is worth: refitted without it, or linear.

    What moves nothing where the others are is worth none, and left out.
    """
    best = found.best
    linear = found.scores.neighbours(best.names)
    base = found.scores.score(best.names)
    return {
        name: _worth(found, linear, base, best.names - {name})
        for name in best.names - found.always - found.idle
    }


def _worth(found: Found, linear: dict[Names, float], base: float, rest: Names) -> float:
    if rest in found.refits:
        return found.best.score - found.refits[rest].score
    return base - linear.get(rest, -np.inf)


def explained(found: Found) -> float:
    """ln evidence of the best set over none at all."""
    return found.best.score - found.none.score
