"""From data to sets of effects: all effects are fitted at once, then sets of them are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from crosscheck.calibration.compared import all_stated, fit_and_compare
from crosscheck.calibration.joint_fit.all_effects import PLAIN, Calibration, covariance
from crosscheck.calibration.joint_fit.joint import Setting
from crosscheck.calibration.joint_fit.linearised import free_of
from crosscheck.calibration.joint_fit.stages import Progress
from crosscheck.calibration.judgement.probability import (
    Classes,
    alike_beyond,
    all_scores,
    probabilities,
)
from crosscheck.calibration.judgement.replaceable import Replaced
from crosscheck.calibration.judgement.sure_together import sure_together
from crosscheck.calibration.judgement.verdict import NOTHING, Judgement, judge
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.equals import EQUAL, parameters_counted
from crosscheck.calibration.sets.exact import FEW, Refit
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.calibration.unknown.beside import unknown_beside
from crosscheck.calibration.unknown.detectable import detectable_size
from crosscheck.calibration.unknown.imitated import Imitated, field_beside, field_in_place
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.fit.effects.nothing import distance_from_nothing, is_nothing
from crosscheck.fit.effects.possible import can_be, hardly_happens
from crosscheck.fit.least_squares.problem import Problem, Rms
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Sigma
from seecr.description.robot import Robot
from seecr.effects import Terms

# Most equivalents that are fitted in place of a listed member.
_SWAPPED = 6
# Part of its worth that an effect keeps beside something unknown if it is there itself.
_LEFT = 0.1


@dataclass(frozen=True, eq=False)
class SetSearch:
    """The effects that the data need.

    Attributes:
        calibration: the fit of all effects at once. found: the sets that were compared.
        catalogue: all effects with their starting values.
        classes: posterior probabilities.
        field_odds: ln odds of something unknown that varies, beside all effects or in place of
            some.
        shown: by kind of reading, the size from which on that would have shown; None if unsaid.
        judgement: the verdict.
        in_place: something unknown in place of some members of the best set.
        varies: what something unknown changes in time beside all effects, else in place of some.
        outdone: members of the best set of which something unknown leaves hardly anything.
    """

    calibration: Calibration
    found: ComparedSets
    catalogue: Catalogue
    classes: Classes
    field_odds: float
    shown: Rms | None
    judgement: Judgement
    in_place: Imitated
    varies: tuple[Varying, ...] = ()
    outdone: Names = frozenset()


def search_sets(
    problem: Problem,
    stated: Sigma,
    terms: Terms = PLAIN,
    progress: Progress = lambda _text, _part: None,
    given: Sequence[Terms] = (),
) -> SetSearch:
    """Fit all effects at once, then compare sets of effects.

    Args:
        problem: readings, from :func:`crosscheck.fit.preparation.prepare.prepare`.
        stated: the noise that the user stated, without estimates.
        terms: effects of the model as it stands; they are in every set.
        progress: called with what is being done and the fraction that is done.
        given: sets that were found elsewhere, with their values, the best last; they are compared
            too.
    """
    every = fit_and_compare(problem, stated, terms, progress, given)
    whole, catalogue, found, unknown = every.whole, every.catalogue, every.found, every.unknown
    setting, joint, odds, without = whole.setting, whole.joint, unknown.odds, every.without
    effects = [n for n in catalogue.names if n not in terms]
    sizes = {name: parameters_counted(catalogue.start(name).layout) for name in effects}
    best = found.best
    in_place = field_in_place(setting, best.joint, best.widths, found.scores)
    classes = _classes(found, best.names, sizes)
    beside = unknown_beside(setting, best.joint, all_stated(problem, stated)).odds
    said = judge(
        found, classes, odds, every.surprise, every.not_noise, _implausible(found), beside,
        in_place, without, lambda: field_beside(setting, best.joint, best.widths, found.scores),
    )  # fmt: skip
    said = said.without(nothing_by_themselves(setting, found, said))
    if said.verdict is DiagnosisVerdict.MANY_EFFECTS and said.sure:

        def possible(refit: Refit) -> bool:
            return can_be(problem.robot, refit.joint.terms, terms)

        others = Replaced(found, sizes.__getitem__, possible)
        others.try_without(said.sure, classes)
        classes = _classes(found, best.names, sizes, others.scores)
        said = said.replacing(frozenset(others.replaceable))
    listed = found.always | set(said.sure)
    alone = found.refit(listed) if said.verdict is DiagnosisVerdict.EFFECTS_FOUND else None
    if alone is not None and listed != best.names:
        # find what is equivalent to the listed effects, not to members of a larger set
        further = {
            **with_equivalents(found, listed, classes, problem.robot, terms),
            listed: alone.score,
        }
        classes = _classes(found, listed, sizes, further)
    classes = classes.at_most(best.names, without)
    if said.imitated is not None:
        odds = max(odds, in_place.odds)
        classes = classes.without(in_place.replaced, in_place.chance)
    # what outweighs something unknown is there, however much of its worth that could take
    outdone = _outdone(found, in_place) - set(() if said.imitated else said.sure)
    classes = classes.without(outdone, in_place.chance)
    free = free_of(joint)
    # no size is stated if something may have been absorbed: one of that size would have shown
    shown = None if said.more or said.imitated else detectable_size(
        setting, joint, joint.jacobian * free, joint.width * free
    )  # fmt: skip
    in_time = unknown.likeliest
    varies = (in_time,) if in_time else in_place.seen if in_place.chance else ()
    return SetSearch(whole, found, catalogue, classes, odds, shown, said, in_place, varies, outdone)


def _outdone(found: ComparedSets, in_place: Imitated) -> Names:
    """Members of the best set of which something unknown leaves hardly anything.

    Readings that lag look much like backlash; where they follow an unknown law that no field has
    exactly, a little is left for backlash.
    """
    best, scores = found.best.names, found.scores
    alone = {name: scores.score(best) - scores.score(best - {name}) for name in in_place.worth}
    return frozenset(n for n, worth in in_place.worth.items() if worth < _LEFT * alone[n])


def _classes(
    found: ComparedSets,
    own: Names,
    sizes: Mapping[str, int],
    further: Mapping[Names, float] = NOTHING,
) -> Classes:
    """Probabilities, and what is equivalent to members of a set.

    Args:
        found: the compared sets. own: the set.
        sizes: of all effects, the number of parameters by
            :func:`crosscheck.calibration.sets.equals.parameters_counted`.
        further: scores of further sets that were fitted.
    """
    scores = {**all_scores(found), **further}
    fitted = {names: scores[names] for names in (*found.refits, *further)}
    hints = alike_beyond(found.scores, own, sizes)
    classes = probabilities(scores, own, list(sizes), sizes, fitted, hints)
    # of many effects none is sure because others explain nearly as well: nor are all together
    few = len(own - found.always) <= FEW
    return sure_together(classes, scores, fitted, own) if few else classes


def with_equivalents(
    found: ComparedSets, listed: Names, classes: Classes, robot: Robot, stood: Terms
) -> dict[Names, float]:
    """Scores of the listed set with a member replaced by an equivalent, fitted exactly."""
    out = dict[Names, float]()
    for members in classes.members:
        for name in listed.intersection(members) - found.always:
            likely = sorted(set(members) - listed, key=lambda e: (-classes.effect[e], e))
            for other in likely[:_SWAPPED]:
                swapped = found.refit((listed - {name}) | {other})
                if swapped is not None and can_be(robot, swapped.joint.terms, stood):
                    out[swapped.names] = swapped.score
    return out


def nothing_by_themselves(setting: Setting, found: ComparedSets, said: Judgement) -> Names:
    """Sure effects whose values are within one standard error of nothing, the nearest first.

    That one of a class is there may be probable because all of its members help a little, each in
    its own way; what its values cannot tell from nothing is no finding. Where the set without it
    explains much less, its errors are those of a linear model that does not hold.
    """
    sure, none = set(said.sure), set[str]()
    is_model = said.verdict is DiagnosisVerdict.EFFECTS_FOUND
    while sure:
        names = found.always | sure if is_model else found.best.names
        fit = found.refit(names)
        near = {} if fit is None else _near_nothing(setting, fit, sure)
        for name in sorted(near, key=lambda n: near[n]):
            rest = found.refit(names - {name})
            if fit is not None and rest is not None and rest.score > fit.score - EQUAL:
                sure, none = sure - {name}, none | {name}
                break
        else:
            break
    return frozenset(none)


def _near_nothing(setting: Setting, fit: Refit, some: Iterable[str]) -> dict[str, float]:
    """Those of some effects whose values are within one standard error of nothing, and how far."""
    terms, spread = fit.joint.terms, covariance(setting, fit.joint)
    far = {name: distance_from_nothing(terms, spread, terms.own(name)) for name in sorted(some)}
    return {name: both[0] for name, both in far.items() if is_nothing(*both)}


def _implausible(found: ComparedSets) -> Names:
    """Members of the best set that are implausibly large."""
    own = (term for term in found.best.joint.terms if term.name not in found.always)
    return frozenset(term.name for term in own if hardly_happens(term))
