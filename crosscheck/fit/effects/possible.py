"""Sizes that no robot can have, or hardly any. A fit may pass through them, a result may not."""

from __future__ import annotations

import numpy as np

from seecr.description.robot import Robot
from seecr.effects import Term, Terms


def can_be(robot: Robot, terms: Terms, stood: Terms) -> bool:
    """Whether a robot can have these values (no negative mass, no wheel larger than its cable).

    A fit that is stopped by a bound other than nothing wants more than what any robot has, and its
    evidence, which is that of an optimum, says nothing.

    Args:
        robot: the robot. terms: the fitted model.
        stood: the model before the fit. Effects that are impossible in it are the user's own
            and are not rejected.
    """

    def may_be(term: Term) -> bool:
        return term.is_possible(robot) and not _is_stopped(term)

    own = {term.name for term in stood if not may_be(term)}
    return all(term.name in own or may_be(term) for term in terms)


def _is_stopped(term: Term) -> bool:
    """Whether a fitted amplitude is at a bound that is not nothing."""
    layout, value = term.layout, term.vector
    at_bound = (value <= layout.lower) | (value >= layout.upper)
    fitted = ~layout.shape & ~term.knowledge.fixed
    return bool(np.any(at_bound & (value != layout.null) & fitted))


def largest_size(term: Term) -> float:
    """The largest absolute value of an effect's parameters in plausible sizes, without shapes."""
    return float(np.max(np.abs(term.sizes[~term.layout.shape]), initial=0.0))
