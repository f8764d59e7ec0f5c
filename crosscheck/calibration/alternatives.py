"""Few effects that explain the data, where others explain them as well: which it is stays open."""

from __future__ import annotations

from crosscheck.calibration.equals import EQUAL
from crosscheck.calibration.exact import FEW
from crosscheck.calibration.probability import Classes
from crosscheck.calibration.refits import Found
from crosscheck.calibration.sets import Names

# As many as one can read.
_MOST = 3


def alternatives(found: Found, classes: Classes) -> list[Names]:
    """Sets of few effects that explain as well as the best one, but are not parts of each other.

    Args:
        found: sets that were compared.
        classes: effects of one class count as one.

    Returns:
        the best set first, each without what the model has; one where nothing else does as well,
        none where the best is not of few effects.
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
