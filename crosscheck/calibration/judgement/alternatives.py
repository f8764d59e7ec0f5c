"""Finds alternatives: different sets of few effects that explain the data equally well."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.calibration.judgement.probability import Classes
from crosscheck.calibration.sets.equals import EQUAL
from crosscheck.calibration.sets.exact import FEW
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.calibration.sets.refits import ComparedSets

# More alternatives than these are too many to read.
_MOST = 3


def shared(some: Sequence[Names], classes: Classes) -> Names:
    """Members of the first of several sets that each of them has, or an equivalent."""
    if not some:
        return frozenset()
    same = {e: frozenset(members) for members in classes.members for e in members}
    return frozenset(
        name for name in some[0] if all(same.get(name, {name}) & other for other in some)
    )


def alternatives(found: ComparedSets, classes: Classes) -> list[Names]:
    """Sets of few effects that explain as well as the best one, none a subset of another.

    Args:
        found: the sets that were compared.
        classes: equivalent effects; those of one class count as the same.

    Returns:
        The sets, the best first, without the effects that the model has already: one if no other
        explains as well, none if the best set has many effects or none.
    """
    first = {e: members[0] for members in classes.members for e in members}
    out: list[Names] = []
    kept: list[Names] = []
    for refit in sorted(found.refits.values(), key=lambda r: -r.score):
        own = refit.names - found.always
        if not own or len(own) > FEW:
            if refit is found.best:
                return []
            continue
        if refit.score < found.best.score - EQUAL or len(out) == _MOST:
            break
        kinds = frozenset(first.get(e, e) for e in own)
        if not any(kinds <= other or other <= kinds for other in kept):
            out.append(own)
            kept.append(kinds)
    return out
