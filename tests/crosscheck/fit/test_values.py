"""Fitted values: in words, far from what was measured, or more than what any robot has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term
from made_diagnoses import POINTS, SIGMA, robot

from crosscheck.calibration import calibrate
from crosscheck.comparison.residuals import compare
from crosscheck.fit.state import can_be, contradictions
from crosscheck.model.fitted import Fitted
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, layout_of

ROBOT = load_robot("planar_vertical")
SAID = "pulley_radius: radius_m is 60 standard errors from what was measured independently"


def known(value: float, stderr: float, now: float) -> Term:
    """A radius that a caliper gave, and its value now."""
    pulleys = Term.of(ROBOT, "pulley_radius").measured(radius_m=(value, stderr))
    return pulleys.with_vector(np.array([now]))


@pytest.mark.parametrize(("now", "is_said"), [(0.0, True), (0.0286, False), (0.0284, True)])
def test_more_than_three_standard_errors_are_said(now: float, is_said: bool) -> None:
    assert bool(contradictions([known(0.03, 0.0005, now)])) == is_said


def test_what_is_fixed_or_unknown_contradicts_nothing() -> None:
    fixed = replace(
        known(0.03, 0.0005, 0.0),
        knowledge=replace(known(0.03, 0.0005, 0.0).knowledge, fixed=np.array([True])),
    )
    assert contradictions([fixed, term(ROBOT, "stiffness", factor=3.0)]) == []


def test_a_comparison_says_it_of_the_model_and_a_calibration_of_what_it_fitted() -> None:
    """Both said nothing: sixty standard errors from the caliper, a model simply agreed."""
    data = measured(ROBOT, [], points=POINTS, sigma=SIGMA, tensions=True)
    there = compare(ROBOT, data, Terms([known(0.03, 0.0005, 0.0)]))
    assert any(note.startswith(SAID) for note in there.notes)
    begun = Terms([known(0.03, 0.0005, 0.03)])
    fitted = calibrate(ROBOT, data, begun, only=["stiffness"])
    assert any(note.startswith("pulley_radius: radius_m is ") for note in fitted.notes)


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


def test_what_is_not_determined_has_no_value_unless_it_is_at_its_bound() -> None:
    """In a plane, shift_y was 1.227e-09 mm."""
    radius = term(soft_cogiro(), "pulley_radius", radius_m=0.01)
    for error, bound, line in [
        (np.inf, False, "radius = not determined by these data"),
        (np.inf, True, "radius = 10 mm (at its bound)"),
        (1e-4, False, "radius = 10.00 ± 0.10 mm"),
        (1e-4, True, "radius = 10.00 ± 0.10 mm (at its bound)"),
    ]:
        assert Fitted(radius, np.array([error]), np.array([bound])).value_lines() == [line]
