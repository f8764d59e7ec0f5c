"""Finds alternatives: different sets of few effects that explain the data equally well."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.calibration.judgement.probability import Classes
from crosscheck.calibration.sets.equals import EQUAL
from crosscheck.calibration.sets.exact import FEW, Refit
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets

# More alternatives than these are too many to read.
_MOST = 3


def shared(some: Sequence[Names], classes: Classes) -> Names:
    """Members of the first of several sets that each of them has, or an equivalent."""
    first = some[0] if some else frozenset()
    return frozenset(name for name in first if is_in_each(name, some, classes))


def is_in_each(name: str, some: Sequence[Names], classes: Classes) -> bool:
    """Whether each of several sets has an effect, or an equivalent."""
    return all(not other.isdisjoint(classes.alike(name)) for other in some)


def alternatives(found: ComparedSets, classes: Classes) -> list[Names]:
    """Sets of few effects that explain as well as the best one, none a subset of another.

    Two effects may do together what one in a class with the first of them does by itself: a centre
    of mass elsewhere beside a tilted frame, and a force. Neither set is part of the other then.

    Args:
        found: the sets that were compared.
        classes: equivalent effects; those of one class count as the same.

    Returns:
        The sets, the smallest first and of these the best, without the effects that the model has
        already: one if no other explains as well, none if the best set has many effects or none.
    """
    first = {e: members[0] for members in classes.members for e in members}
    if not _is_few(found, found.best):
        return []

    def is_as_good(refit: Refit | None) -> bool:
        return refit is not None and refit.score >= found.best.score - EQUAL

    def contains(own: Names, kinds: Names, other: Names) -> bool:
        """Whether a set has the kinds of another, and these members alone explain as well."""
        some = frozenset(e for e in own if first.get(e, e) in other)
        return other <= kinds and (some == own or is_as_good(found.refit(found.always | some)))

    out: list[Names] = []
    kept: list[Names] = []
    as_good = [r for r in found.refits.values() if is_as_good(r)]
    for refit in sorted(as_good, key=lambda r: (len(r.names), -r.score)):
        own = refit.names - found.always
        kinds = frozenset(first.get(e, e) for e in own)
        if _is_few(found, refit) and not any(
            kinds <= other or contains(own, kinds, other) for other in kept
        ):
            out.append(own)
            kept.append(kinds)
    return out[:_MOST]


def _is_few(found: ComparedSets, refit: Refit) -> bool:
    """Whether a set has a few effects, that is one at least."""
    return 0 < len(refit.names - found.always) <= FEW
