"""What a user has measured stays: fixed values are not moved, known ones are readings."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import measured
from made_diagnoses import POINTS, SIGMA, SLOW, readings, robot

from crosscheck.add import add_effect
from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.hypothesis import scored
from crosscheck.measurements.data import Measurements
from crosscheck.preparation.prepare import prepare
from seecr.effects import Term, Terms

pytestmark = pytest.mark.slow

TRUE = 0.01


@pytest.fixture(scope="module")
def data() -> Measurements:
    """Pulleys of 10 mm."""
    return readings(radius_m=TRUE)


def pulleys(radius: float) -> Term:
    return Term.of(robot(), "pulley_radius", radius_m=radius)


def test_a_fixed_value_is_not_moved_by_the_next_fit(data: Measurements) -> None:
    found = add_effect(robot(), data, "stiffness", [pulleys(0.03).fixed()])
    sheave = next(f for f in found.fitted if f.term.name == "pulley_radius")
    assert sheave.term.vector == [0.03] and sheave.stderr == [0.0] and not sheave.at_bound.any()
    assert any("radius = 30 mm (fixed)" in line for line in found.lines())
    free = add_effect(robot(), data, "stiffness", [pulleys(0.03)])
    assert free.terms["pulley_radius"].vector == pytest.approx([TRUE], abs=2e-4)


def test_a_known_value_pulls_as_one_more_reading(data: Measurements) -> None:
    alone = add_effect(robot(), data, "pulley_radius").own
    radius, error = alone.term.vector[0], alone.stderr[0]
    known, spread = radius + 5.0 * error, 2.0 * error
    both = add_effect(robot(), data, "pulley_radius", [pulleys(0.0).measured(
        radius_m=(known, spread))]).own  # fmt: skip
    weights = np.array([error, spread]) ** -2.0
    middle = weights @ [radius, known] / weights.sum()
    assert abs(both.term.vector[0] - middle) < 0.05 * error
    assert both.stderr[0] == pytest.approx(weights.sum() ** -0.5, rel=0.02)


def test_beside_a_wrong_fixed_value_a_known_one_keeps_its_weight(data: Measurements) -> None:
    """Pulleys that are fixed at a wrong radius leave far more than the stated noise."""
    mass = Term.of(robot(), "platform_mass").measured(added_kg=(0.0, 1e-4))
    model = [pulleys(3.0 * TRUE).fixed(), mass]
    found = add_effect(robot(), data, "stiffness", model)
    (heavy,) = [f for f in found.fitted if f.term.name == "platform_mass"]
    assert not found.whiteness.is_noise and found.whiteness.scale > 3.0
    # as if the noise were stated as large as it seems
    assert abs(heavy.term.vector[0]) < 3e-4 and heavy.stderr[0] <= 1e-4 * (1 + 1e-9)
    assert heavy.term.knowledge.stderr == pytest.approx([1e-4])


def test_a_known_value_that_the_data_contradict_is_warned_of(data: Measurements) -> None:
    wrong = pulleys(0.0).measured(radius_m=(2.0 * TRUE, 0.1 * TRUE))
    found = add_effect(robot(), data, "pulley_radius", [wrong])
    (warning,) = [text for text in found.warnings if "measured independently" in text]
    assert (
        "pulley_radius: radius_m is 10 standard" in warning and "check that measurement" in warning
    )
    right = pulleys(0.0).measured(radius_m=(TRUE, 0.1 * TRUE))
    assert not any(
        "measured independently" in text
        for text in add_effect(robot(), data, "pulley_radius", [right]).warnings
    )


def test_some_components_may_be_fixed(data: Measurements) -> None:
    held = Term.of(robot(), "cable_length_offset", offset_2_m=1e-3).fixed("offset_2_m")
    ready = prepare(robot(), data, Terms())
    every = Data.of(ready.problem, Terms())
    found = fit(every, every.state(Terms([held, pulleys(0.0)])))
    offsets = found.terms["cable_length_offset"]
    assert offsets.vector[1] == 1e-3 and np.all(offsets.vector[[0, 2, 3]] != 0.0)
    assert offsets.knowledge.fixed.tolist() == [False, True, False, False]


def test_evidence_counts_what_is_known_against_a_model(data: Measurements) -> None:
    ready = prepare(robot(), data, Terms())
    every = Data.of(ready.problem, Terms())

    def log(term: Term) -> float:
        stood = Terms([term])
        found = fit(every, every.state(stood))
        return scored(Catalogue.of(every, stood), frozenset(stood.names), found, {}).score

    near = log(pulleys(TRUE).measured(radius_m=(TRUE, 1e-4)))
    far = log(pulleys(TRUE).measured(radius_m=(TRUE + 1e-3, 1e-4)))
    assert 40.0 < near - far < 55.0  # ten standard errors


def test_a_calibration_holds_what_is_fixed_and_takes_what_is_known(data: Measurements) -> None:
    frame = Term.of(robot(), "tracker_frame", shift_x_m=1e-4).fixed()
    known = pulleys(0.0).measured(radius_m=(0.0105, 1e-5))
    found = calibrate(robot(), data, [frame, known], only=["stiffness", "platform_mass"])
    held, pulled = (
        next(f for f in found.fitted if f.term.name == name)
        for name in ("tracker_frame", "pulley_radius")
    )
    assert np.array_equal(held.term.vector, frame.vector)
    assert np.all(held.stderr == 0.0) and not held.at_bound.any()
    assert pulled.term.vector[0] == pytest.approx(0.0105, abs=5e-5)
    assert pulled.stderr[0] == pytest.approx(1e-5, rel=0.1)


def test_a_diagnosis_beside_a_known_stiffness_names_the_mass_alone() -> None:
    """From poses alone the two are the same thing, unless one of them was measured."""
    heavy = Term.of(robot(), "platform_mass", added_kg=0.25 * robot().mass)
    data = measured(robot(), [heavy], points=POINTS, sigma=SIGMA)
    stiff = Term.of(robot(), "stiffness", factor=1.0)
    told = stiff.measured(factor=(1.0, 0.01))
    both = diagnose(robot(), data, exclude=SLOW)
    named, other = sorted(("platform_mass", "stiffness"), key=lambda n: n != both.missing[0].effect)
    assert both.missing[0].effect == named and other in both.missing[0].indistinguishable
    # once it was also "not significant (p = 1)" beside that
    (why,) = (row.why_not for row in both.candidates if row.effect == other)
    assert str(why) == f"indistinguishable from {named}, which is listed"
    for given in (told, stiff.fixed()):
        (found,) = diagnose(robot(), data, [given], exclude=SLOW).missing
        assert found.effect == "platform_mass" and not found.rivals
        assert abs(found.values[0] - heavy.vector[0]) < 3.0 * found.stderr[0] < 0.03
