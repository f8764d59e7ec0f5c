"""Values that a robot can have, and fits that want more than what any robot has."""

from __future__ import annotations

import pytest
from made_diagnoses import robot

from crosscheck.fit.effects.possible import can_be
from seecr.effects import Term, Terms, layout_of

NONE = Terms()


@pytest.mark.parametrize("factor", [0.02, 50.0])
def test_what_is_stopped_by_a_bound_cannot_be_found(factor: float) -> None:
    """A cable 50 times as soft: with stiffening ones it had explained what something else does."""
    stopped = Terms([Term.of(robot(), "cable_stiffness", factor_1=1.2, factor_3=factor)])
    assert not can_be(robot(), stopped, NONE)
    half = 0.5 * (1.0 + factor)
    within = Terms([Term.of(robot(), "cable_stiffness", factor_1=1.2, factor_3=half)])
    assert can_be(robot(), within, NONE)


def test_what_the_user_states_or_fixes_may_be_at_its_bound() -> None:
    stated = Terms([Term.of(robot(), "stiffness", factor=50.0)])
    assert can_be(robot(), stated, stated)
    assert can_be(robot(), Terms([stated["stiffness"].fixed()]), NONE)


def test_nothing_and_shapes_may_be_at_a_bound() -> None:
    radius = Terms([Term.of(robot(), "pulley_radius", radius_m=0.0)])
    assert layout_of("pulley_radius", robot()).lower[0] == 0.0 and can_be(robot(), radius, NONE)
    creep = layout_of("creep", robot())
    late = Terms([Term.of(robot(), "creep", amount=0.1, time_s=float(creep.upper[1]))])
    assert can_be(robot(), late, NONE)
