"""All effects are fitted at once, and sets of them compared about that fit and its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from crosscheck.calibration.joint_fit.all_effects import Calibration, fit_all_effects
from crosscheck.calibration.joint_fit.beginning import Beginning
from crosscheck.calibration.joint_fit.joining import layouts
from crosscheck.calibration.joint_fit.joint import JointFit, cost
from crosscheck.calibration.joint_fit.leave_out import leave_out
from crosscheck.calibration.joint_fit.stages import Progress, poor
from crosscheck.calibration.judgement.verdict import SURPRISE
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.equals import EQUAL
from crosscheck.calibration.sets.exact import FEW
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.own_noise import by_own_noise
from crosscheck.calibration.sets.refits import ROUNDS, ComparedSets, compare_sets
from crosscheck.calibration.unknown.beside import UnknownOdds, unknown_beside
from crosscheck.calibration.unknown.not_noise import is_not_noise
from crosscheck.fit.least_squares.problem import KINDS, Problem, kinds_read
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.measurements.data import Sigma
from seecr.effects import Term, Terms
from seecr.pose import Array

# Sets refitted about one linear model; fewer if something unknown is there, which none explains.
_REFITTED, _REFITTED_UNKNOWN = 20, 4
# The noise that fewer effects leave may be so many times what was stated.
_LOUDER = 1.25


@dataclass(frozen=True, eq=False)
class FitAndSets:
    """The fit of all effects, and the sets that were compared about it.

    Attributes:
        whole, catalogue: the fit of all effects, and their starts.
        surprise: chi2 per reading of the worst held-out run over what a fit expects: that of all
            effects, or of the best set.
        unknown: something unknown beside all effects.
        found: the compared sets.
        not_noise: whether what the best of them takes for noise is not noise.
        without: how probable it is that groups of its members are noise.
    """

    whole: Calibration
    catalogue: Catalogue
    surprise: float
    unknown: UnknownOdds
    found: ComparedSets
    not_noise: bool = False
    without: Mapping[Names, float] = field(default_factory=dict)

    @property
    def is_unexplained(self) -> bool:
        """Whether the fit of all effects leaves something, or foretells runs badly."""
        return self.unknown.is_there or self.whole.surprise > SURPRISE

    @property
    def is_a_local_minimum(self) -> bool:
        """Whether the best set is nearer to the readings than the fit of all effects."""
        joint, best = self.whole.joint, self.found.best.joint

        def of(one: JointFit, width: Array) -> float:
            return cost(self.whole.setting, joint.colour, joint.weight, one.state, width)

        return (
            of(best, widths_of(best.terms, self.whole.setting.free))
            < of(joint, joint.width) - 2.0 * EQUAL
        )


def fit_and_compare(
    problem: Problem, stated: Sigma, terms: Terms, progress: Progress, given: Sequence[Terms],
    beginning: Beginning | None = None,
) -> FitAndSets:  # fmt: skip
    """Fit all effects, then compare sets of them.

    If something unknown is there beside all effects, but some of them alone explain more, the fit
    of all ended in a local minimum, as it may where the history of rows matters. Then all of it is
    done again from these.

    Args: as in :func:`crosscheck.calibration.search.search_sets`.
    """

    begun = beginning or Beginning(problem, terms)

    def of(first: Terms | None) -> FitAndSets:
        def report(text: str, part: float) -> None:
            progress(text, 0.5 * part)

        whole = fit_all_effects(problem, terms, report, first, begun)
        return _compared(whole, stated, terms, progress, given)

    every = of(given[-1] if given else None)
    if every.is_unexplained and every.is_a_local_minimum:
        every = of(every.found.best.joint.terms)
    return every


def all_stated(problem: Problem, stated: Sigma) -> bool:
    """Whether the noise of every kind of reading was stated."""
    return len(_stated(problem, stated)) == len(kinds_read(problem))


def _stated(problem: Problem, stated: Sigma) -> list[str]:
    """Names of the kinds of reading whose noise was stated."""
    return [k.name for k in kinds_read(problem) if getattr(stated, k.sigma) is not None]


def _compared(
    whole: Calibration, stated: Sigma, terms: Terms, progress: Progress, given: Sequence[Terms]
) -> FitAndSets:
    """Sets compared about a fit of all effects; the others as in :func:`fit_and_compare`."""
    setting, tried = whole.setting, 0
    problem, kinds = setting.problem, _stated(setting.problem, stated)
    catalogue, plain = _catalogue(problem, terms, whole), evaluate(problem, terms, setting.factor)

    def sets(unknown: bool, *more: Terms, joint: JointFit = whole.joint) -> ComparedSets:
        most, rounds = (_REFITTED_UNKNOWN, 1) if unknown else (_REFITTED, ROUNDS)

        def report(text: str) -> None:
            nonlocal tried
            tried += 1
            progress(f"trying {text}", 0.5 + 0.5 * tried / (tried + most))

        known, grow = [*given, *more], unknown and poor(joint)
        return compare_sets(setting, joint, catalogue, plain, report, most, rounds, known, grow)

    def is_structure(fit: JointFit) -> bool:
        return is_not_noise(setting, fit, kinds)

    def may_be(fit: JointFit) -> bool:
        return not _louder(fit.colour, kinds) and not is_structure(fit)

    unknown = unknown_beside(setting, whole.joint, all_stated(problem, stated))
    by_all = is_structure(whole.joint) or whole.surprise > SURPRISE
    found = sets(by_all or unknown.is_there)
    not_noise = is_structure(found.best.joint)
    surprise = whole.surprise if unknown.is_there else _surprise(whole, found)
    smooth = unknown.is_there or surprise > SURPRISE
    if by_all and not not_noise and not smooth:
        # what few effects explain, all of them could: their fit ended in a local minimum
        found = sets(False, found.best.joint.terms)
        not_noise, surprise = is_structure(found.best.joint), _surprise(whole, found)
        smooth = surprise > SURPRISE
    as_found = FitAndSets(whole, catalogue, surprise, unknown, found, not_noise)
    if not_noise or smooth:
        return as_found
    own = by_own_noise(setting, found, may_be)
    if own.fewer is not None:
        joint = replace(whole.joint, colour=own.fewer.colour, weight=own.fewer.weight)
        found = sets(False, own.fewer.terms, joint=joint)
        if is_structure(found.best.joint):
            return as_found  # nor is what fewer effects leave
        own = by_own_noise(setting, found, may_be)
        as_found = replace(as_found, found=found)
        if own.fewer is not None:
            return as_found  # the noise is still another: it says nothing for sure
    return replace(as_found, without=own.without)


def _surprise(whole: Calibration, found: ComparedSets) -> float:
    """How much worse than expected the worst held-out run is predicted, by all effects or by few.

    With many parameters and few rows a fit of all may go far without some of these, where its
    expectation, which is linear, does not hold. What few effects predict is then no surprise.
    """
    best = found.best
    if whole.surprise <= SURPRISE or len(best.names - found.always) > FEW:
        return whole.surprise
    own = leave_out(replace(whole.setting, frozen=True), best.joint)
    return min(whole.surprise, float(np.max(own.surprise, initial=0.0)))


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
