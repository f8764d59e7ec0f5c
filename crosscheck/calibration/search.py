"""From data to sets of effects: all effects are fitted at once, then sets of them are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.all_effects import PLAIN, Calibration, covariance, fit_all_effects
from crosscheck.calibration.catalogue import Catalogue
from crosscheck.calibration.colour import Colour
from crosscheck.calibration.detectable import detectable_size
from crosscheck.calibration.equals import EQUAL, parameters_counted
from crosscheck.calibration.exact import FEW, Refit
from crosscheck.calibration.imitated import Imitated, field_in_place
from crosscheck.calibration.joining import layouts
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.judgement import NOTHING, SURPRISE, Judgement, judge
from crosscheck.calibration.linearised import free_of
from crosscheck.calibration.not_noise import is_not_noise
from crosscheck.calibration.own_noise import by_own_noise
from crosscheck.calibration.probability import (
    Classes,
    alike_beyond,
    all_scores,
    probabilities,
)
from crosscheck.calibration.refits import ROUNDS, Found, compare_sets
from crosscheck.calibration.replaceable import Replaced
from crosscheck.calibration.sets import Names
from crosscheck.calibration.stages import Progress
from crosscheck.calibration.unknown import unknown_beside
from crosscheck.calibration.varying import Varying
from crosscheck.calibration.widened import widened
from crosscheck.fit.nothing import distance_from_nothing, is_nothing
from crosscheck.fit.possible import can_be, hardly_happens
from crosscheck.fit.problem import KINDS, Problem, Rms, kinds_read
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.fit.state import State, evaluate
from crosscheck.measurements.data import Sigma
from seecr.description.robot import Robot
from seecr.effects import Term, Terms

# Sets refitted about one linear model; fewer if something unknown is there, which none explains.
_REFITTED, _REFITTED_UNKNOWN = 20, 4
# The noise that fewer effects leave may be so many times what was stated.
_LOUDER = 1.25
# Most equivalents that are fitted in place of a listed member.
_SWAPPED = 6


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
    """

    calibration: Calibration
    found: Found
    catalogue: Catalogue
    classes: Classes
    field_odds: float
    shown: Rms | None
    judgement: Judgement
    in_place: Imitated
    varies: tuple[Varying, ...] = ()


def search_sets(
    problem: Problem,
    stated: Sigma,
    terms: Terms = PLAIN,
    progress: Progress = lambda _text, _part: None,
    given: Sequence[Terms] = (),
) -> SetSearch:
    """Fit all effects at once, then compare sets of effects.

    Args:
        problem: readings, from :func:`crosscheck.fit.prepare.prepare`.
        stated: the noise that the user stated, without estimates.
        terms: effects of the model as it stands; they are in every set.
        progress: called with what is being done and the fraction that is done.
        given: sets that were found elsewhere, with their values, the best last; they are compared
            too.
    """
    first = given[-1] if given else None
    whole = fit_all_effects(problem, terms, lambda text, part: progress(text, 0.5 * part), first)
    setting, joint = whole.setting, whole.joint
    known = [k.name for k in kinds_read(problem) if getattr(stated, k.sigma) is not None]
    all_stated = len(known) == len(kinds_read(problem))
    unknown = unknown_beside(setting, joint, all_stated)
    surprise = float(np.max(whole.held_out.surprise, initial=0.0))
    odds, smooth = unknown.odds, unknown.is_there or surprise > SURPRISE
    catalogue = _catalogue(problem, terms, whole)
    found, not_noise, without = _compared(
        whole, catalogue, evaluate(problem, terms, setting.factor), progress, given, known, smooth
    )
    effects = [n for n in catalogue.names if n not in terms]
    sizes = {name: parameters_counted(catalogue.start(name).layout) for name in effects}
    best = found.best
    in_place = field_in_place(setting, best.joint, best.widths, found.scores)
    classes = _classes(found, best.names, sizes)
    beside = unknown_beside(setting, best.joint, all_stated).odds
    said = judge(
        found, classes, odds, surprise, not_noise, _doubted(found), beside, in_place, without
    )
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
    free = free_of(joint)
    # no size is stated if something may have been absorbed: one of that size would have shown
    shown = None if said.more or said.imitated else detectable_size(
        setting, joint, joint.jacobian * free, joint.width * free
    )  # fmt: skip
    in_time = unknown.likeliest
    varies = (in_time,) if in_time else in_place.seen if in_place.chance else ()
    return SetSearch(whole, found, catalogue, classes, odds, shown, said, in_place, varies)


def _compared(
    whole: Calibration, catalogue: Catalogue, plain: State, progress: Progress,
    given: Sequence[Terms], stated: Sequence[str], smooth: bool,
) -> tuple[Found, bool, Mapping[Names, float]]:  # fmt: skip
    """The compared sets, whether what the best of them takes for noise is not noise, and how
    probable it is that groups of its members are noise.

    Args:
        whole, catalogue, plain: the fit of all effects, their starts, and the model as it stands.
        progress, given: as in :func:`search_sets`.
        stated: names of the kinds of reading whose noise was stated.
        smooth: whether something smooth and unknown is there beside all effects.
    """
    setting, tried = whole.setting, 0

    def compared(unknown: bool, *more: Terms, joint: JointFit = whole.joint) -> Found:
        most, rounds = (_REFITTED_UNKNOWN, 1) if unknown else (_REFITTED, ROUNDS)

        def report(text: str) -> None:
            nonlocal tried
            tried += 1
            progress(f"trying {text}", 0.5 + 0.5 * tried / (tried + most))

        return compare_sets(setting, joint, catalogue, plain, report, most, rounds, [*given, *more])

    structure_beside_all = is_not_noise(setting, whole.joint, stated)
    found = compared(structure_beside_all or smooth)
    not_noise = is_not_noise(setting, found.best.joint, stated)
    if structure_beside_all and not not_noise and not smooth:
        # what few effects explain, all of them could: their fit ended in a local minimum
        found = compared(False, found.best.joint.terms)
        not_noise = is_not_noise(setting, found.best.joint, stated)
    if not_noise or smooth:
        return found, not_noise, NOTHING

    def may_be(fit: JointFit) -> bool:
        return not _louder(fit.colour, stated) and not is_not_noise(setting, fit, stated)

    own = by_own_noise(setting, found, may_be)
    if own.fewer is not None:
        joint = replace(whole.joint, colour=own.fewer.colour, weight=own.fewer.weight)
        again = compared(False, own.fewer.terms, joint=joint)
        if is_not_noise(setting, again.best.joint, stated):
            return found, False, NOTHING  # nor is what fewer effects leave
        found = again
        own = by_own_noise(setting, found, may_be)
        if own.fewer is not None:
            return found, False, NOTHING  # the noise is still another: it says nothing for sure
    return found, False, own.without


def _louder(colour: Colour, stated: Sequence[str]) -> bool:
    """Whether noise is larger than was stated: something unknown may be taken for noise."""
    scale = [colour.scale[k] for k, kind in enumerate(KINDS) if kind.name in stated]
    return max(scale, default=0.0) > _LOUDER


def _catalogue(problem: Problem, terms: Terms, whole: Calibration) -> Catalogue:
    """Every effect with its start: at null, or at the shape that the joint fit found promising."""
    at_once, _later = layouts(problem)
    nulls = (Term(a, a.null) for a in at_once if a.name not in terms)
    here = Terms([*nulls, *(t for t in terms if t.name not in whole.later)])
    return Catalogue(here, whole.later, whole.prices)


def _classes(
    found: Found, own: Names, sizes: Mapping[str, int], further: Mapping[Names, float] = NOTHING
) -> Classes:
    """Probabilities, and what is equivalent to members of a set.

    Args:
        found: the compared sets. own: the set.
        sizes: of all effects, the number of parameters by
            :func:`crosscheck.calibration.equals.parameters_counted`.
        further: scores of further sets that were fitted.
    """
    scores = {**all_scores(found), **further}
    fitted = {names: scores[names] for names in (*found.refits, *further)}
    hints = alike_beyond(found.scores, own, sizes)
    classes = probabilities(scores, own, list(sizes), sizes, fitted, hints)
    # of many effects none is sure because others explain nearly as well: nor are all together
    few = len(own - found.always) <= FEW
    return widened(classes, scores, fitted, own) if few else classes


def with_equivalents(
    found: Found, listed: Names, classes: Classes, robot: Robot, stood: Terms
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


def nothing_by_themselves(setting: Setting, found: Found, said: Judgement) -> Names:
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


def _doubted(found: Found) -> Names:
    """Members of the best set that are implausibly large."""
    own = (term for term in found.best.joint.terms if term.name not in found.always)
    return frozenset(term.name for term in own if hardly_happens(term))
