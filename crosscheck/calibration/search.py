"""From data to sets of effects: all effects are fitted at once, then sets of them are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from crosscheck.calibration.compared import all_stated, fit_and_compare
from crosscheck.calibration.joint_fit.all_effects import PLAIN, Calibration, covariance
from crosscheck.calibration.joint_fit.beginning import Beginning
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
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
from crosscheck.calibration.judgement.verdict import NOTHING, Judgement, SignsOfUnknown, judge
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.equals import EQUAL, parameters_counted
from crosscheck.calibration.sets.exact import FEW, Refit
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.calibration.unknown.beside import UnknownOdds, unknown_beside
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
    beginning: Beginning | None = None,
) -> SetSearch:
    """Fit all effects at once, then compare sets of effects.

    Args:
        problem: readings, from :func:`crosscheck.fit.preparation.prepare.prepare`.
        stated: the noise that the user stated, without estimates.
        terms: effects of the model as it stands; they are in every set.
        progress: called with what is being done and the fraction that is done.
        given: sets that were found elsewhere, with their values, the best last; they are compared
            too.
        beginning: that of the fit of all effects, if it was begun before.
    """
    every = fit_and_compare(problem, stated, terms, progress, given, beginning)
    found, best, setting = every.found, every.found.best, every.whole.setting
    sizes = _sizes(every.catalogue, terms)
    in_place = field_in_place(setting, best.joint, best.widths, found.scores)
    by_sets = _classes(found, best.names, sizes)
    signs = SignsOfUnknown(
        every.unknown.odds, every.surprise, every.not_noise,
        unknown_beside(setting, best.joint, all_stated(problem, stated)).odds,
        in_place, lambda: field_beside(setting, best.joint, best.widths, found.scores),
    )  # fmt: skip
    judged = judge(found, by_sets, signs, _implausible(found), every.without)
    seen = judged.without(nothing_by_themselves(setting, found, judged))
    if seen.verdict is DiagnosisVerdict.MANY_EFFECTS and seen.sure:
        said, classes = _with_replaceable(found, seen, by_sets, sizes, problem.robot, terms)
    else:
        classes = _about_listed(found, seen, by_sets, sizes, problem.robot, terms)
        said = seen.with_sure_ones(found, classes)
    said, outdone = _still_there(said, _outdone(found, in_place), in_place.is_likelier)
    return SetSearch(
        every.whole, found, every.catalogue,
        _less_unknown(classes.at_most(best.names, every.without), said, in_place, outdone),
        every.unknown.odds if said.imitated is None else max(every.unknown.odds, in_place.odds),
        _size_shown(setting, every.whole.joint, said), said, in_place,
        _varying(every.unknown, in_place), outdone,
    )  # fmt: skip


def _sizes(catalogue: Catalogue, terms: Terms) -> dict[str, int]:
    """Of each effect that the model does not have, the number of parameters that counts."""
    names = [name for name in catalogue.names if name not in terms]
    return {name: parameters_counted(catalogue.start(name).layout) for name in names}


def _with_replaceable(
    found: ComparedSets, said: Judgement, classes: Classes, sizes: Mapping[str, int],
    robot: Robot, stood: Terms,
) -> tuple[Judgement, Classes]:  # fmt: skip
    """The judgement of a large set after each sure effect was excluded, and the probabilities."""

    def possible(refit: Refit) -> bool:
        return can_be(robot, refit.joint.terms, stood)

    others = Replaced(found, sizes.__getitem__, possible)
    others.try_without(said.sure, classes)
    replaceable = frozenset(others.replaceable)
    return said.replacing(replaceable), _classes(found, found.best.names, sizes, others.scores)


def _about_listed(
    found: ComparedSets, said: Judgement, classes: Classes, sizes: Mapping[str, int],
    robot: Robot, stood: Terms,
) -> Classes:  # fmt: skip
    """Probabilities with what is equivalent to the listed effects, not to members of a larger set.

    Those of the best set remain where it is listed itself, or where nothing is.
    """
    listed = found.always | set(said.sure)
    alone = found.refit(listed) if said.verdict is DiagnosisVerdict.EFFECTS_FOUND else None
    if alone is None or listed == found.best.names:
        return classes
    further = with_equivalents(found, listed, classes, robot, stood)
    return _classes(found, listed, sizes, {**further, listed: alone.score})


def _less_unknown(classes: Classes, said: Judgement, in_place: Imitated, outdone: Names) -> Classes:
    """The probabilities if something unknown may explain what some members explain."""
    if said.imitated is None:
        return classes.without(outdone, in_place.chance)
    kept = classes.without(in_place.replaced, in_place.chance)
    return kept.without(outdone, in_place.chance)


def _size_shown(setting: Setting, joint: JointFit, said: Judgement) -> Rms | None:
    """The size from which on something unknown would have shown.

    None is stated if something may have been absorbed: one of that size would have shown.
    """
    if said.more or said.imitated:
        return None
    free = free_of(joint)
    return detectable_size(setting, joint, joint.jacobian * free, joint.width * free)


def _varying(unknown: UnknownOdds, in_place: Imitated) -> tuple[Varying, ...]:
    """What something unknown changes in time beside all effects, else in place of some."""
    if unknown.likeliest:
        return (unknown.likeliest,)
    return in_place.seen if in_place.chance else ()


def _still_there(said: Judgement, outdone: Names, likelier: bool) -> tuple[Judgement, Names]:
    """The judgement without what is outdone, and what is, which may be listed no more.

    What outweighs something unknown is there, however much of its worth that could take. Nor is
    anything outdone by what is less likely than the members it replaces, unless it is told.
    """
    if said.imitated is None:
        return said, outdone - set(said.sure) if likelier else frozenset()
    return said.without(outdone), outdone


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
