"""Turns the compared sets into a verdict and a list of effects that are sure.

Something unknown is there if a smooth field over the workspace, or something that changes in time,
earns evidence beside all effects or in place of some, or if held-out runs are predicted worse than
the fit itself expects. If the data leave open which effects are missing, or if it takes many, the
verdict is ``many_effects``: a calibration and no diagnosis. The same holds if something unknown
explains more beside the best set, but nothing beside the whole catalogue; or if it may be there in
place of some members, but is not sure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.judgement.alternatives import alternatives, is_in_each, shared
from crosscheck.calibration.judgement.probability import Classes
from crosscheck.calibration.sets.equals import BY_CHANCE, SMALL
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.calibration.unknown.field import UNKNOWN
from crosscheck.calibration.unknown.imitated import NOT_ASKED, Imitated
from crosscheck.fit.reasons import DiagnosisVerdict

# An effect is sure from this probability on that it or an equivalent is missing.
SURE = 0.95
# Largest set that counts as few effects. The number of open classes must be below _OPEN, or below
# _OPEN_BESIDE if every member of the set is sure.
_FEW, _OPEN, _OPEN_BESIDE = 5, 1.0, 2.0
# Effects with more parameters than a pose has can together imitate anything: more than _LARGE of
# them are a calibration.
_NUMBERS, _LARGE = 6, 2
# Held-out runs may be so many times as far off as the fit expects.
SURPRISE = 2.0
# In a large set, an effect is only sure if it carries more than this part of what all explain, and
# more ln evidence than _WORTH: others may imitate what is missing.
_PART, _WORTH = 0.1, 25.0
# If a field explains something beside the best set, or in place of members, an effect must have few
# parameters and carry more than this part of what all members, or those that stay, explain.
_MOST, _ALL = 0.5, 0.95
# Beside something unknown that all effects together leave, an effect must be worth so many times
# what that explains.
_FAR = 3.0

NONE: Names = frozenset()
NOTHING: Mapping[Names, float] = {}


@dataclass(frozen=True, eq=False)
class Judgement:
    """The verdict, and what is sure.

    Attributes:
        verdict: the verdict.
        sure: effects that are missing beyond doubt, each one representing its class.
        undecided: the expected number of open classes, see :class:`Classes`.
        implausible: members of the best set that are implausibly large.
        more: whether something unknown explains more beside the best set.
        imitated: something unknown that members of the best set imitate; None if there is nothing.
        replaceable: members that are probable, but others together explain as much.
    """

    verdict: DiagnosisVerdict
    sure: tuple[str, ...]
    undecided: float
    implausible: Names = NONE
    more: bool = False
    imitated: Imitated | None = None
    replaceable: Names = NONE

    def without(self, some: Names) -> Judgement:
        """The same with some effects that are not sure after all; a model of none is no finding."""
        if not some:
            return self
        sure, verdict = tuple(n for n in self.sure if n not in some), self.verdict
        if not sure and verdict is DiagnosisVerdict.EFFECTS_FOUND:
            verdict = DiagnosisVerdict.MANY_EFFECTS
        return replace(self, sure=sure, verdict=verdict)

    def with_sure_ones(self, found: ComparedSets, classes: Classes) -> Judgement:
        """The same, given probabilities about just the effects that are listed.

        That one of several effects is missing may be sure, as members of one class, and still be
        open of each where two of them stand for the first. Then sets that explain as well lack it.
        """
        others = alternatives(found, classes)
        if self.verdict is not DiagnosisVerdict.EFFECTS_FOUND or len(others) < 2:
            return self
        sure = tuple(n for n in self.sure if classes.of(n) > SURE or is_in_each(n, others, classes))
        if len(sure) == len(self.sure):
            return self
        return replace(self, sure=sure, verdict=DiagnosisVerdict.MANY_EFFECTS)

    def replacing(self, some: Names) -> Judgement:
        """The same, but effects that others together can replace are not sure."""
        return replace(self.without(some), replaceable=some)


@dataclass(frozen=True, eq=False)
class SignsOfUnknown:
    """What says that something unknown is at work.

    Attributes:
        beside_all: ln odds of something unknown beside the whole catalogue.
        surprise: chi2 per reading of the worst held-out run over what the joint fit expects.
        not_noise: whether what was taken for noise is not noise.
        beside_best: ln odds of something unknown beside the best set.
        in_place: a field in place of some members of the best set.
        beside_field: computes a field beside the best set; it is asked if one is likely beside all
            effects.
    """

    beside_all: float
    surprise: float
    not_noise: bool = False
    beside_best: float = -np.inf
    in_place: Imitated = NOT_ASKED
    beside_field: Callable[[], Imitated] = lambda: NOT_ASKED

    @property
    def are_clear(self) -> bool:
        """Whether not even all effects together explain the data."""
        return self.not_noise or self.beside_all > UNKNOWN or self.surprise > SURPRISE

    @property
    def more(self) -> bool:
        """Whether something unknown explains more beside the best set."""
        return self.beside_best > UNKNOWN


def judge(
    found: ComparedSets,
    classes: Classes,
    signs: SignsOfUnknown,
    implausible: Names = NONE,
    without: Mapping[Names, float] = NOTHING,
) -> Judgement:
    """Decide on the verdict.

    Args:
        found: the compared sets.
        classes: probabilities of the classes of equivalent effects.
        signs: of something unknown.
        implausible: members of the best set that are implausibly large.
        without: how probable it is that groups of its members are noise; that makes them less sure,
            but it does not take many effects.
    """
    undecided, likely = classes.undecided, classes.at_most(found.best.names, without)
    plain = not implausible and not too_large(_size(found, name) for name in _members(found))
    few = plain and not signs.more and _is_few(found, likely, undecided)
    named = [name for name in _named(found, likely, few) if name not in implausible]
    in_all = in_each(found, likely) if plain else ()
    sure = tuple(dict.fromkeys([*named, *in_all]))
    if signs.more:
        sure = tuple(n for n in carrying_most(found, worths(found), _MOST) if n in sure)
    unknown = _beside_unknown(found, signs, implausible, undecided)
    if unknown is not None:
        return unknown
    is_open = bool(sure) or signs.more or undecided >= _OPEN
    if not is_open and explained_evidence(found) < BY_CHANCE:
        return Judgement(DiagnosisVerdict.NO_EFFECT_MISSING, (), undecided)
    verdict = DiagnosisVerdict.EFFECTS_FOUND if few and sure else DiagnosisVerdict.MANY_EFFECTS
    return Judgement(verdict, sure, undecided, implausible, signs.more)


def _is_few(found: ComparedSets, likely: Classes, undecided: float) -> bool:
    """Whether the best set has few members, and it is hardly open which they are."""
    best = _members(found)
    all_sure = set(sure_effects(found, likely, True)) == best
    return len(best) <= _FEW and undecided < (_OPEN_BESIDE if all_sure else _OPEN)


def _named(found: ComparedSets, likely: Classes, few: bool) -> tuple[str, ...]:
    """Sure members; of few effects also those that it takes beside them to explain as much."""
    sure = sure_effects(found, likely, few)
    if few and sure:
        return adequate(found, sure)
    return sure_effects(found, likely, False)


def _beside_unknown(
    found: ComparedSets, signs: SignsOfUnknown, implausible: Names, undecided: float
) -> Judgement | None:
    """What is sure where something unknown is at work, or may be; None if nothing is."""
    in_place = signs.in_place
    # where something unknown is there anyway, it need not be in the place of these members
    if in_place.is_likelier or (in_place.chance and not signs.are_clear):
        # of several members that stay, some may absorb what others explain
        most = carrying_most(found, in_place.worth, _ALL)
        kept = tuple(name for name in most if name not in implausible)
        if kept or not signs.are_clear:
            sure = signs.are_clear or in_place.chance > SURE
            verdict = DiagnosisVerdict.UNKNOWN_EFFECT if sure else DiagnosisVerdict.MANY_EFFECTS
            return Judgement(verdict, kept, undecided, imitated=in_place)
    if not signs.are_clear:
        return None
    # known effects imitate it: none of them is sure but one that outweighs all else; where no field
    # explains what is unknown, nothing limits what a member may imitate of it
    field = signs.beside_field() if signs.beside_all > UNKNOWN else NOT_ASKED
    alone = tuple(name for name in outweighing(found, field) if name not in implausible)
    return Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, alone, undecided)


def _members(found: ComparedSets) -> Names:
    """Members of the best set that move something; not those that the model has already."""
    return found.best.names - found.always - found.idle


def in_each(found: ComparedSets, classes: Classes) -> tuple[str, ...]:
    """Members that are sure in each of several sets of few effects that explain as well.

    What these do in different ways may be most of what is there, so that no part of it counts.
    """
    some = alternatives(found, classes)
    if len(some) < 2:
        return ()
    every, worth = shared(some, classes), worths(found)
    sure = [e for e in every if classes.of(e) > SURE and worth.get(e, 0.0) > _WORTH]
    return tuple(sorted(sure, key=lambda e: -worth[e]))


def too_large(sizes: Iterable[int]) -> bool:
    """Whether effects with these numbers of parameters are together a calibration, no diagnosis."""
    return sum(size > _NUMBERS for size in sizes) > _LARGE


def sure_effects(found: ComparedSets, classes: Classes, few: bool) -> tuple[str, ...]:
    """Members of the best set that are missing beyond doubt, the most valuable first.

    Args:
        found: the compared sets.
        classes: probabilities.
        few: whether these few effects explain everything; if not, members only count that carry
            much of it.
    """
    worth = worths(found)
    least = 0.0 if few else max(_WORTH, _PART * sum(worth.values()))
    some = [e for e in worth if classes.of(e) > SURE and worth[e] > least]
    return tuple(sorted(some, key=lambda e: -worth[e]))


def adequate(found: ComparedSets, sure: tuple[str, ...]) -> tuple[str, ...]:
    """These effects, plus further ones of the best set as long as it explains much more.

    That something is missing may be certain even if it is open which effect it is.
    """
    worth, listed = worths(found), list(sure)
    for name in sorted(set(worth) - set(sure), key=lambda e: -worth[e]):
        alone = found.refit(found.always | set(listed))
        if alone is not None and alone.score > found.best.score - BY_CHANCE:
            break
        listed.append(name)
    return tuple(sorted(listed, key=lambda e: -worth[e]))


def carrying_most(found: ComparedSets, worth: Mapping[str, float], part: float) -> tuple[str, ...]:
    """The small effect that carries more than a part of what its set explains, if there is one.

    Args:
        found: the compared sets. worth: ln evidence that each member of a set is worth.
        part: at least a half.
    """
    least = max(_WORTH, part * sum(worth.values()))
    return tuple(n for n in worth if _size(found, n) <= SMALL and worth[n] > least)


def outweighing(found: ComparedSets, field: Imitated) -> tuple[str, ...]:
    """The member that is worth far more than all others and something unknown, if there is one.

    What is unknown follows no field exactly. Members may imitate what the field misses, those of
    many parameters more of it: worth that is to count is several times what the field explains.
    """
    worth = field.worth
    others = _ALL * sum(max(w, 0.0) for w in worth.values())
    least = max(_WORTH, others, _FAR * field.odds)
    return tuple(n for n, w in worth.items() if w > max(least, BY_CHANCE * _size(found, n)))


def _size(found: ComparedSets, name: str) -> int:
    """An effect's number of amplitudes; 0 if it is not in the linear model."""
    group = found.scores.gram.groups.get(name)
    return 0 if group is None else len(group.columns)


def worths(found: ComparedSets) -> dict[str, float]:
    """ln evidence that each member of the best set is worth, by a refit without it or linearly.

    Members that move nothing beside the others are left out.
    """
    best = found.best
    linear = found.scores.neighbours(best.names)
    base = found.scores.score(best.names)
    return {name: _worth(found, linear, base, best.names - {name}) for name in _members(found)}


def _worth(found: ComparedSets, linear: dict[Names, float], base: float, rest: Names) -> float:
    if rest in found.refits:
        return found.best.score - found.refits[rest].score
    return base - linear.get(rest, -np.inf)


def explained_evidence(found: ComparedSets) -> float:
    """ln evidence of the best set over that of the model as it stands."""
    return found.best.score - found.none.score
