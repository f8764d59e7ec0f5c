"""Values that no robot can have, or hardly any: a fit may come to them, an answer may not."""

from __future__ import annotations

import numpy as np

from crosscheck.fit.registration import NAME as TRACKER
from seecr.description.robot import Robot
from seecr.effects import Term, Terms

# Where structure is left over, an effect of more plausible sizes than this is not believed.
PLAUSIBLE = 20.0
# Nor anywhere one of more than this, five standard deviations of the widest prior there is: a
# builder's lines were 20 plausible sizes longer than told, and it was so.
_EVER = 50.0
_TARGET = "tracker_target"


def can_be(robot: Robot, terms: Terms, stood: Terms) -> bool:
    """Whether a robot can have these values (no negative mass, no wheel larger than its cable).

    Args:
        robot: the robot. terms: what was fitted.
        stood: the model as it stood; what was impossible in it already is its user's.
    """
    own = {term.name for term in stood if not term.is_possible(robot)}
    return all(term.name in own or term.is_possible(robot) for term in terms)


def is_plausible(term: Term) -> bool:
    """Whether an effect is of a size that happens where others may imitate it."""
    return largest_size(term) < PLAUSIBLE


def hardly_happens(term: Term) -> bool:
    """Whether an effect is larger than any; a tracker and its target may stand anywhere."""
    return term.name not in (TRACKER, _TARGET) and largest_size(term) > _EVER


def largest_size(term: Term) -> float:
    """The largest of an effect's values in plausible sizes; what shapes it has none."""
    return float(np.max(np.abs(term.sizes[~term.layout.shape]), initial=0.0))
