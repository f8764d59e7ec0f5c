"""Known values of a model: no search moves fixed ones, and data that contradict them say so."""

from __future__ import annotations

import re

import made_diagnoses as made
import numpy as np
import pytest
from made_data import COGIRO, measured, term

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Measurements
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

ROBOT = load_robot(COGIRO)
HIDDEN = term(ROBOT, "centre_of_mass", shift_x_m=0.02)
WRONG = term(ROBOT, "centre_of_mass", shift_x_m=0.005)


def doubted(found: Diagnosis) -> list[str]:
    """What is said about known values that contradict the data."""
    return [note for note in found.notes if note.startswith("what the model takes for known")]


def with_hidden() -> Measurements:
    return measured(ROBOT, [HIDDEN], points=4, seed=3)


def test_fixed_values_that_the_data_contradict_are_doubted() -> None:
    found = diagnose(ROBOT, with_hidden(), Terms([WRONG.fixed()]), exclude=made.SLOW)
    assert found.path is not None
    for stage in found.path.stages:
        assert stage.fit.terms["centre_of_mass"].vector.tolist() == WRONG.vector.tolist()
    assert found.verdict is not DiagnosisVerdict.NO_EFFECT_MISSING
    first = found.notes[0]
    assert "known of centre_of_mass contradicts these data: fitted to them it would be" in first
    assert re.search(r"shift_x = (19\.\d+|20\.\d) mm", first) and "Check it first" in first


@pytest.mark.parametrize("known", [True, False])
def test_only_values_that_are_known_are_doubted(known: bool) -> None:
    """What was measured to 0.1 mm is doubted, where the data say 15 mm; what is free is fitted."""
    model = WRONG.measured(shift_x_m=(0.005, 1e-4)) if known else WRONG
    found = diagnose(ROBOT, with_hidden(), Terms([model]), exclude=made.SLOW)
    notes = doubted(found)
    assert len(notes) == known
    told = " ".join(notes)
    assert not known or "known of centre_of_mass" in told
    assert not known or (
        re.search(r"shift_x = (19\.\d+|20\.\d) mm", told) and "shift_y" not in told
    )


def test_what_is_contradicted_is_not_also_said_to_be_far_from_what_was_measured() -> None:
    wheels = term(made.robot(), "pulley_radius", radius_m=0.012).measured(radius_m=(0.012, 2e-5))
    data = made.readings(radius_m=0.01)
    found = diagnose(made.robot(), data, Terms([wheels]), only=["stiffness"])
    about = [note for note in found.notes if "pulley_radius" in note]
    assert len(about) == 1 and about[0].startswith("what the model takes for known of")


@pytest.mark.parametrize(("measured_m", "told"), [(0.0102, True), (0.01006, False)])
def test_readings_that_data_outweigh_are_said_where_nothing_is_missing(
    measured_m: float, told: bool
) -> None:
    """Sixty standard errors from a caliper, a diagnosis had nothing to say of it."""
    wheels = term(made.robot(), "pulley_radius", radius_m=measured_m)
    model = Terms([wheels.measured(radius_m=(measured_m, 2e-5))])
    found = diagnose(made.robot(), made.readings(radius_m=0.01), model, only=["stiffness"])
    assert found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    assert any("pulley_radius: radius_m is 8.7" in note for note in found.notes) == told


def test_readings_of_values_count_in_the_evidence_beside_them() -> None:
    """24 true ones had been doubted: what they say by themselves had been left out of one side."""
    plain = term(ROBOT, "anchor_point_error")
    random = np.random.default_rng(0)
    scale = plain.layout.scale
    true = plain.with_vector(scale * random.normal(size=len(scale)))
    read = true.vector + 0.01 * scale * random.normal(size=len(scale))
    readings = zip(read.tolist(), (0.01 * scale).tolist(), strict=True)
    model = plain.measured(**dict(zip(plain.layout.names, readings, strict=True)))
    mass = term(ROBOT, "platform_mass", added_kg=0.1)
    data = measured(ROBOT, [mass, true], points=3, seed=3)
    found = diagnose(ROBOT, data, Terms([model]), exclude=made.SLOW)
    assert found.missing and not doubted(found)


def test_values_that_the_data_confirm_are_not_doubted() -> None:
    mass = term(ROBOT, "platform_mass", added_kg=0.1)
    data = measured(ROBOT, [HIDDEN, mass], points=4, seed=3)
    found = diagnose(ROBOT, data, Terms([HIDDEN.fixed()]), exclude=made.SLOW)
    assert [one.effect for one in found.missing] and not doubted(found)
