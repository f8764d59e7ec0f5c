"""Searches the sets of effects that explain best, by linear evidence and exact fits in turn.

Linear evidence alone can be confidently wrong: cables go slack, and products of parameters are
nonlinear. So the best sets by linear evidence are refitted exactly, always together with the empty
set, and the catalogue is linearised about the best of them, until the best set stays the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.calibration.joint_fit.joining import (
    amplitudes,
    has_history,
    inside,
    promising_beside,
)
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.challenge import challenge
from crosscheck.calibration.sets.equals import BY_CHANCE, EQUAL, are_equals
from crosscheck.calibration.sets.exact import FEW, LOCAL_MINIMUM, Exact, Refit
from crosscheck.calibration.sets.grown import grown
from crosscheck.calibration.sets.linear_search import Names, Scores, explore
from crosscheck.fit.effects.possible import hardly_happens
from crosscheck.fit.least_squares.state import State
from seecr.effects import Terms
from seecr.effects.base import Layout

# Most sets refitted about one linear model, and how much worse their ln evidence may be.
_REFITTED, _WITHIN = 20, 12.0
# Most rounds of linearising the catalogue about the best set.
ROUNDS = 4
# Most neighbours of the best set that are fitted because they may be as good.
_BESIDE = 6
# Most rounds of challenges: a challenger that wins is challenged in turn.
_CHALLENGES = 3
# Sets up to this size are tried without each of their members.
_THINNED = 8


@dataclass(frozen=True, eq=False)
class ComparedSets:
    """Sets that were compared.

    Attributes:
        refits: exact fits, by set. best: the best of them.
        scores: linear scores about the best.
        refit: fits any set exactly, also one that was not compared; None if it has no solution.
        always: effects that the model has already: they are in every set.
        idle: members of the best set that move nothing beside the others, such as a second
            equivalent.
    """

    refits: dict[Names, Refit]
    best: Refit
    scores: Scores
    refit: Callable[[Names], Refit | None]
    always: Names = frozenset()
    idle: Names = frozenset()

    @property
    def none(self) -> Refit:
        """The fit of the model with nothing added."""
        return self.refits[self.always]


def compare_sets(
    setting: Setting,
    joint: JointFit,
    catalogue: Catalogue,
    plain: State,
    report: Callable[[str], None] = lambda _text: None,
    most: int = _REFITTED,
    rounds: int = ROUNDS,
    given: Iterable[Terms] = (),
    grow: bool = False,
) -> ComparedSets:
    """Search the sets of effects, by linear evidence and exact fits in turn.

    Args:
        setting: the data; noise and weights of the joint fit are kept for all sets.
        joint: the joint fit of all effects, about which the first linear model is.
        catalogue: effects that may be in a set.
        plain: the model as it stands; its effects are in every set.
        report: called with each set that is fitted.
        most: how many sets to refit about one linear model.
        rounds: most rounds of linearising the catalogue about the best set.
        given: sets that were found elsewhere, with their values there.
        grow: also let sets grow member by member; the fit of all effects may mislead.
    """
    always = frozenset(plain.terms.names)
    fixed = replace(setting, frozen=True, weight=joint.weight)
    known = {frozenset(terms.names): terms for terms in given}
    exact = Exact(fixed, joint, catalogue, plain, report, known)
    scores = exact.scores_about(joint)
    best = exact.best_of(scores, [always, *known])
    scores, best = _in_rounds(exact, scores, best, most, rounds)
    if grow:
        scores, best = _moved_on(exact, scores, best, grown(exact), most)
    scores, best = about_given(exact, scores, best, known)
    scores, best = looked_about(exact, scores, best)
    scores, best = _moved_on(exact, scores, best, swapped(exact, scores, best), most)
    scores, best = _challenged(exact, scores, best, most)
    scores, best = _about_plainer(exact, scores, best)
    idle = frozenset(n for n in best.names - always if _is_idle(exact, scores, best, n))
    return ComparedSets(
        exact.possible, best, scores, lambda names: exact.fit(scores, names), always, idle
    )


def _in_rounds(
    exact: Exact, scores: Scores, best: Refit, most: int, rounds: int
) -> tuple[Scores, Refit]:
    """The best set, sought about itself in turn from all effects on, and the scores about it."""
    begin = frozenset(scores.gram.names) | scores.always
    for k in range(rounds):
        before, best = best.names, _searched(exact, scores, begin, most)
        if k and before == best.names:
            break
        begin = best.names
        scores = exact.scores_about(best.joint)
    return scores, best


def _moved_on(
    exact: Exact, scores: Scores, best: Refit, better: Refit, most: int
) -> tuple[Scores, Refit]:
    """The best set after a search about one that is better, unless that is the best already."""
    if better.names == best.names:
        return scores, best
    about = exact.scores_about(better.joint)
    return about, _searched(exact, about, better.names, most)


def _challenged(exact: Exact, scores: Scores, best: Refit, most: int) -> tuple[Scores, Refit]:
    """The best set that stands challenges, or the one after the last of them."""
    for _ in range(_CHALLENGES):
        challenge(exact, scores, best)
        if exact.best.names == best.names:
            break
        scores, best = _moved_on(exact, scores, best, exact.best, most)
    return scores, best


def _about_plainer(exact: Exact, scores: Scores, best: Refit) -> tuple[Scores, Refit]:
    """The set that :func:`plainer` prefers to the best one, and the scores about it."""
    preferred = plainer(exact, best)
    if preferred.names == best.names:
        return scores, best
    return exact.scores_about(preferred.joint), preferred


def plainer(exact: Exact, best: Refit) -> Refit:
    """The best set, or an equivalent one that is easier to believe.

    That is one with an effect that a member contains in its place, such as the cable behind the
    exit points for friction on it, or with fewer members that are larger than any effect is.
    """
    always = frozenset(exact.plain.terms.names)

    def strange(refit: Refit) -> int:
        return sum(t.name not in always and hardly_happens(t) for t in refit.joint.terms)

    def is_plainer(other: Refit) -> bool:
        gone, come = best.names - other.names, other.names - best.names
        if len(gone) != 1 or len(come) != 1 or best.score - other.score >= EQUAL:
            return False
        (member,), (instead,) = gone, come
        contained = exact.catalogue.start(member).layout.effect.parent == instead
        return strange(other) < strange(best) + contained

    some = filter(is_plainer, exact.possible.values())
    return min(some, key=lambda other: (strange(other), -other.score), default=best)


def _searched(exact: Exact, scores: Scores, begin: Names, most: int) -> Refit:
    """The best set that a search by linear evidence leads to, from the empty set and from this."""
    explore(scores, [scores.always, begin])
    return _best_explored(exact, scores, most)


def _best_explored(exact: Exact, scores: Scores, most: int) -> Refit:
    """The best set after the best by linear evidence were fitted, and without needless members."""
    best = exact.best_of(scores, [scores.always, *scores.best(most, _WITHIN)])
    return _thinned(exact, scores, best)


def _thinned(exact: Exact, scores: Scores, best: Refit) -> Refit:
    """The best set after dropping members, by exact fits, as long as that improves it."""
    while len(own := best.names - scores.always) <= _THINNED:
        idle = [name for name in sorted(own) if does_nothing(exact.setting, best, name)]
        # without one of these its values still serve; a fit from another start may miss them
        exact.take(scores, *(best.joint.terms.only(best.names - {name}) for name in idle))
        better = exact.best_of(scores, [best.names - {name} for name in sorted(own)])
        if better.names == best.names:
            break
        best = better
    return best


def _is_idle(exact: Exact, scores: Scores, best: Refit, name: str) -> bool:
    """Whether a member is at null, or moves nothing and the set explains as much without it.

    An effect with history that moves nothing may still decide in which equilibrium the platform
    rests: its rows are walked to, not searched. At null it is no effect all the same.
    """
    own = next(term for term in best.joint.terms if term.name == name)
    if not np.any(own.vector[amplitudes(own)] != own.layout.null[amplitudes(own)]):
        return True
    if not does_nothing(exact.setting, best, name):
        return False
    without = exact.fit(scores, best.names - {name})
    return without is not None and without.score > best.score - BY_CHANCE


def does_nothing(setting: Setting, best: Refit, name: str) -> bool:
    """Whether a member moves all readings together by less than one unit of chi2."""
    joint = best.joint
    own = joint.terms.own(name)
    moved = joint.whitened(setting.chain, joint.jacobian[:, own] @ joint.z[own])
    return float(moved @ moved) < 1.0


def about_given(
    exact: Exact, scores: Scores, best: Refit, known: Iterable[Names]
) -> tuple[Scores, Refit]:
    """The best set after a search about a given one, if the linear model misses what that explains.

    An effect with a shape (eccentric drums, creep) does nothing at the wrong shape. There, the
    linear model of all effects only finds what imitates it.
    """
    later = set(exact.catalogue.later.names)
    few = [names for names in known if names & later and len(names - scores.always) <= FEW]
    last = exact.fit(scores, few[-1]) if few else None
    if last is None:
        return scores, best
    seen = scores.score(last.names) - scores.score(best.names)
    if last.score - best.score < seen + LOCAL_MINIMUM:
        return scores, best
    if last.names <= best.names:
        now = _from_values_of(exact, scores, best, last)
        if now.score < best.score + LOCAL_MINIMUM:
            return scores, now
    near = exact.scores_about(last.joint, own_shapes=True)
    if not _leads_on(exact, near, last.names, best):
        return scores, best
    other = _best_explored(exact, near, _BESIDE)
    if other is best:
        return scores, best
    if other.names != best.names:
        near = exact.scores_about(other.joint, own_shapes=True)
        other = _searched(exact, near, other.names, _BESIDE)
    return exact.scores_about(other.joint, own_shapes=True), other


def _leads_on(exact: Exact, near: Scores, begin: Names, best: Refit) -> bool:
    """Whether the best set by linear evidence, from a given one on, is about as good as the best.

    The next ones differ from it by a member or so: if it explains far less, so do they.
    """
    explore(near, [near.always, begin])
    first = exact.fit(near, near.best(1, _WITHIN)[0])
    return first is not None and first.score > best.score - LOCAL_MINIMUM


def _from_values_of(exact: Exact, scores: Scores, best: Refit, part: Refit) -> Refit:
    """The best set, fitted also from the values that its members have in a part of it."""
    own = {term.name: term for term in part.joint.terms}
    exact.take(scores, Terms(own.get(term.name, term) for term in best.joint.terms))
    return exact.fitted[best.names] or best


def looked_about(exact: Exact, scores: Scores, best: Refit) -> tuple[Scores, Refit]:
    """The best set after its neighbours were fitted, and the scores about it.

    The search ends with a set that was chosen by linear models about other sets, in which a member
    may have mattered that does not matter here. Among the best by linear evidence, larger sets also
    crowd out those in which another effect replaces a member. If no neighbour were fitted, every
    member would seem sure.
    """
    while True:
        beside = _beside(exact, scores, best.names)[:_BESIDE]
        exact.fit_all(scores, beside)
        _begin_at(exact, scores, best, beside)
        exact.fit_all(scores, _beside_equals(exact, scores, best))
        better = exact.best_of(scores, containing(exact, exact.best))
        if better.names == best.names:
            return scores, best
        best = better
        scores = exact.scores_about(best.joint)


def _beside(exact: Exact, scores: Scores, names: Names) -> list[Names]:
    """Sets with one member dropped or exchanged that are as good by linear evidence, in order."""
    near, own = scores.neighbours(names), scores.score(names)

    def as_good(other: Names) -> bool:
        gone, come = (sum(map(exact.size, some)) for some in (names - other, other - names))
        return are_equals(own - near[other], gone, come)

    some = [other for other in near if len(other) <= len(names) and as_good(other)]
    return sorted(some, key=lambda other: (-near[other], sorted(other)))


def _beside_equals(exact: Exact, scores: Scores, best: Refit) -> list[Names]:
    """New sets with a member exchanged in one that explains as well as the best.

    They differ from the best one by two members, of which one can only be exchanged after the
    other: beside a frame that yields another target explains what exit points elsewhere do, but not
    beside cable behind the winches, which does the same as the frame. Only what none of these sets
    has can tell that a member is not as sure as all of them make it.
    """
    equals = [r.names for r in exact.possible.values() if r.score > best.score - EQUAL]
    alike = [names for names in equals if len(names) == len(best.names) and names != best.names]
    known = best.names.union(*alike)
    near = {other for names in alike for other in _beside(exact, scores, names)}
    new = [names for names in near if not names <= known and names not in exact.fitted]
    return sorted(new, key=lambda names: (-scores.score(names), sorted(names)))[:_BESIDE]


def _begin_at(exact: Exact, scores: Scores, best: Refit, some: Iterable[Names]) -> None:
    """Fit parts of the best set from its values, if far more is promised there than was found.

    With the shapes that its members have there (a reference temperature, a time) it may explain as
    much; a fit from other shapes misses that.
    """

    def promises(names: Names) -> bool:
        own = exact.fitted[names]
        return own is None or own.score < scores.score(names) - LOCAL_MINIMUM

    parts = [names for names in some if names < best.names and promises(names)]
    exact.take(scores, *(best.joint.terms.only(names) for names in parts))


def containing(exact: Exact, best: Refit) -> list[Names]:
    """Sets about as good as the best one, with an effect in place of one that it contains.

    The linear model has such an effect at its starting point, together with much of what it
    contains: friction beside half a metre of cable behind the exit points. Once fitted, it explains
    at least as much as what it contains. Only sets of few effects are tried: in large ones it fits
    what others leave.
    """
    always, out = frozenset(exact.plain.terms.names), list[Names]()
    for names, refit in exact.possible.items():
        alike = len(names) == len(best.names) and refit.score > best.score - EQUAL
        if not alike or len(names - always) > FEW:
            continue
        for term in exact.catalogue.later:
            inner = term.layout.effect.parent
            if inner in names - always and term.name not in names:
                out.append((names - {inner}) | {term.name})
    return out


def swapped(exact: Exact, scores: Scores, best: Refit) -> Refit:
    """The best set after exchanging members for effects that the linear model does no justice to.

    The linear model has effects with a shape at one shape (a reference temperature, a time), which
    need not be the one that explains what a member does. And it has what heavy cables do at no
    weight, as straight lines: several members together may do the rest, and a fit of the weight
    beside these ends at none. So such effects also take the place of all members but one.
    """
    own = best.names - scores.always
    if len(own) > FEW:
        return exact.best
    absent = [t.layout for t in exact.catalogue.later if t.name not in best.names]
    bent = [a for a in absent if not has_history(exact.setting.problem, a)]
    shaped = [a for a in absent if a.shape.any() or a in bent]
    for name in sorted(own):
        _exchanged(exact, scores, best, best.names - {name}, shaped)
    for name in sorted(own) if len(own) > 2 else ():
        _exchanged(exact, scores, best, scores.always | {name}, bent)
    return exact.best


def _exchanged(
    exact: Exact, scores: Scores, best: Refit, kept: Names, absent: Sequence[Layout]
) -> None:
    """Fit a part of the best set with each effect that promises about as much as the others do."""
    rest = exact.fit(scores, kept)
    if rest is None:
        return
    least = max(best.score - rest.score - LOCAL_MINIMUM, 0.0)
    looked = promising_beside(exact.setting, rest.joint, absent)
    more = [inside(one.term) for one in looked if one.gain > least]
    exact.take(scores, *(Terms([*rest.joint.terms, term]) for term in more))
