"""Fitted values that are far from what somebody measured independently."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import POINTS, SIGMA

from crosscheck.calibration import calibrate
from crosscheck.comparison.residuals import compare
from crosscheck.fit.effects.contradictions import contradictions
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms

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
