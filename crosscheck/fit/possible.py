"""Values that no robot can have: a fit may come to them, an answer may not."""

from __future__ import annotations

from seecr.effects import Terms
from seecr.robot import Robot


def can_be(robot: Robot, terms: Terms, stood: Terms) -> bool:
    """Whether a robot can have these values (no negative mass, no wheel larger than its cable).

    Args:
        robot: the robot. terms: what was fitted.
        stood: the model as it stood; what was impossible in it already is its user's.
    """
    own = {term.name for term in stood if not term.is_possible(robot)}
    return all(term.name in own or term.is_possible(robot) for term in terms)
