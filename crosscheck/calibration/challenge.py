"""What would explain the data if a member of the best set were not there.

Sets one move away from the best one do not say how sure its members are: two effects together may
do what two others do, and no exchange of one for one leads from here to there. So each member is
barred, with those that can stand in its place, and the best sets without them are fitted in
earnest, the catalogue made linear about the best of those again. They count in the probabilities.
"""

from __future__ import annotations

from dataclasses import replace

from crosscheck.calibration.equals import are_equals
from crosscheck.calibration.exact import Exact, Refit
from crosscheck.calibration.sets import Names, Scores, explore

# Rounds of making the catalogue linear about the best set without a member, at most.
_ROUNDS = 5
# Members of a set that is challenged: more of them can do what any of them does, a little worse
# each, and looking at that takes minutes.
_FEW = 3
# Moves in the linear model: a member that is barred is stood in for by ever more others.
_MOVES = 6
# A member without which the best fit is this much worse is needed, whatever bends.
_NEEDED = 40.0
# Sets fitted in a round; how much worse than the best of all a linear model may say they are.
_EACH, _HOPELESS = 2, 15.0
# What is no worse than the best set by this much has its neighbours fitted too.
_NEAR, _NEIGHBOURS = 5.0, 6


def challenge(exact: Exact, scores: Scores, best: Refit) -> None:
    """Fit the best sets without each member of the best one, where that is of few effects.

    Args:
        exact: sets fitted so far; those that are fitted here are added.
        scores: the linear model about the best set.
        best: that.
    """
    own = best.names - scores.always
    if len(own) > _FEW:
        return
    for name in sorted(own):
        _without(exact, scores, best, name)


def _without(exact: Exact, about: Scores, best: Refit, name: str) -> None:
    """The best sets without a member and without its equals."""
    barred: Names = frozenset()
    top = -float("inf")
    for k in range(_ROUNDS):
        before, barred = barred, equals_of(exact, best, name)
        scores = without(about, barred)
        explore(scores, [scores.always, best.names - barred], _MOVES)
        least = best.score - _HOPELESS
        first, *others = scores.best(_EACH, _HOPELESS)
        some = [n for n in (first, *others) if scores.score(n) > least]
        for names in some or ([first] if k == 0 else []):
            exact.fit(scores, names)
        other = max(
            (r for names, r in exact.possible.items() if not names & barred),
            key=lambda r: r.score,
        )
        if other.score > best.score - _NEAR:
            for names in scores.best(_NEIGHBOURS, _NEAR):
                exact.fit(scores, names)
        stays = barred == before and other.score < top + 1.0
        if stays or other.score < best.score - _NEEDED:
            return
        top = max(top, other.score)
        about = exact.scores_about(other.joint)


def without(scores: Scores, barred: Names) -> Scores:
    """Scores of sets in which these effects are not."""
    groups = {n: g for n, g in scores.gram.groups.items() if n not in barred}
    return replace(scores, gram=replace(scores.gram, groups=groups), solved={}, near={})


def equals_of(exact: Exact, best: Refit, name: str) -> Names:
    """A member, and those that fitted about as well in its place."""
    rest = best.names - {name}
    equals = {name}
    for names, other in exact.possible.items():
        if len(names) != len(best.names) or not rest < names:
            continue
        (come,) = names - rest
        if are_equals(best.score - other.score, exact.size(name), exact.size(come)):
            equals.add(come)
    return frozenset(equals)
