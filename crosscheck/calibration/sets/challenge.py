"""Challenges to the best set: how well can the data be explained without each of its members?

Sets that differ from the best one by one move do not tell how sure its members are. Two effects
together may do what two others do, and no exchange of a single effect leads from one pair to the
other. So each member is excluded in turn, with everything that can replace it. The best sets
without it are fitted exactly, and the catalogue is linearised about the best of them, several times
over. All these sets count in the probabilities.
"""

from __future__ import annotations

from dataclasses import replace

from crosscheck.calibration.sets.equals import are_equals
from crosscheck.calibration.sets.exact import Exact, Refit
from crosscheck.calibration.sets.linear_search import Names, Scores, explore

# Most rounds of linearising the catalogue about the best set without a member.
_ROUNDS = 5
# Largest set that is challenged. In a larger one, each member can be replaced by several others
# together that are a little worse, and searching for these takes minutes.
_FEW = 3
# Moves of the search in the linear model: more and more other effects replace the excluded one.
_MOVES = 6
# If the best fit without a member is worse by this much ln evidence, the member is needed.
_NEEDED = 40.0
# Sets fitted in a round, and how much worse than the best set the linear model may expect them.
_EACH, _HOPELESS = 2, 15.0
# If a fit comes this near to the best set, so many of its neighbours are fitted too.
_NEAR, _NEIGHBOURS = 5.0, 6


def challenge(exact: Exact, scores: Scores, best: Refit) -> None:
    """Fit the best sets without each member of the best one, if that has few members.

    Args:
        exact: sets fitted so far; those that are fitted here are added.
        scores: the linear model about the best set.
        best: the best set.
    """
    own = best.names - scores.always
    if len(own) > _FEW:
        return
    for name in sorted(own):
        _without(exact, scores, best, name)


def _without(exact: Exact, about: Scores, best: Refit, name: str) -> None:
    """Fit the best sets without a member and without its equivalents."""
    barred: Names = frozenset()
    top = -float("inf")
    for k in range(_ROUNDS):
        before, barred = barred, tried_equals(exact, best, name)
        scores = excluding(about, barred)
        explore(scores, [scores.always, best.names - barred], _MOVES)
        least = best.score - _HOPELESS
        first, *others = scores.best(_EACH, _HOPELESS)
        some = [n for n in (first, *others) if scores.score(n) > least]
        exact.fit_all(scores, some or ([first] if k == 0 else []))
        other = max(
            (r for names, r in exact.possible.items() if not names & barred),
            key=lambda r: r.score,
        )
        if other.score > best.score - _NEAR:
            exact.fit_all(scores, scores.best(_NEIGHBOURS, _NEAR))
        stays = barred == before and other.score < top + 1.0
        if stays or other.score < best.score - _NEEDED:
            return
        top = max(top, other.score)
        about = exact.scores_about(other.joint)


def excluding(scores: Scores, barred: Names) -> Scores:
    """The scores of a search from which these effects are excluded."""
    groups = {n: g for n, g in scores.gram.groups.items() if n not in barred}
    return replace(scores, gram=replace(scores.gram, groups=groups), solved={}, near={})


def tried_equals(exact: Exact, best: Refit, name: str) -> Names:
    """A member, and the effects that fitted about as well in its place."""
    rest = best.names - {name}
    equals = {name}
    for names, other in exact.possible.items():
        if len(names) != len(best.names) or not rest < names:
            continue
        (come,) = names - rest
        if are_equals(best.score - other.score, exact.size(name), exact.size(come)):
            equals.add(come)
    return frozenset(equals)
