"""Known values of a model: no search moves fixed ones, and data that contradict them say so."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import made_diagnoses as made
import numpy as np
import pytest
from made_data import COGIRO, measured, term

from crosscheck.calibration.joint_fit.joining import inside
from crosscheck.diagnosis import search
from crosscheck.diagnosis.contradicted import contradicted_values
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Measurements
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

ROBOT = load_robot(COGIRO)
HIDDEN = term(ROBOT, "centre_of_mass", shift_x_m=0.02)
WRONG = term(ROBOT, "centre_of_mass", shift_x_m=0.005)


def with_hidden() -> Measurements:
    return measured(ROBOT, [HIDDEN], points=4, seed=3)


def test_fits_from_nearby_values_do_not_move_fixed_ones() -> None:
    """They had: a true value was found beside a wrong one, and nothing seemed to be missing."""
    begun: list[Terms] = []

    def refit(near: Terms, *_state: object, **_options: object) -> Any:
        begun.append(near)
        return SimpleNamespace(valid=False)

    model = Terms([WRONG.fixed("shift_x_m"), term(ROBOT, "platform_mass")])
    fit = SimpleNamespace(terms=model, state=None, chi2=1.0)
    node: Any = SimpleNamespace(fit=fit, evidence=SimpleNamespace(log=0.0))
    search._from_nearby(cast(Any, SimpleNamespace(refit=refit)), [node], lambda *_told: None)
    values = np.array([near.vector for near in begun])
    moves = np.ptp(values - model.vector, axis=0) > 0.0
    assert moves.tolist() == (~model.knowledge.fixed).tolist() and (~moves).sum() == 1
    assert np.all(values[:, ~moves] == WRONG.vector[0])


def test_fixed_values_that_the_data_contradict_are_doubted() -> None:
    found = diagnose(ROBOT, with_hidden(), Terms([WRONG.fixed()]), exclude=made.SLOW)
    assert found.search is not None
    for step in found.search.steps:
        assert step.fit.terms["centre_of_mass"].vector.tolist() == WRONG.vector.tolist()
    assert found.verdict is not DiagnosisVerdict.NO_EFFECT_MISSING
    first = found.notes[0]
    assert "known of centre_of_mass contradicts these data: fitted to them it would be" in first
    assert "shift_x = 20.0" in first and "Check it first" in first


@pytest.mark.parametrize("known", [True, False])
def test_only_values_that_are_known_are_doubted(known: bool) -> None:
    """What was measured to 0.1 mm is doubted, where the data say 15 mm; what is free is fitted."""
    model = WRONG.measured(shift_x_m=(0.005, 1e-4)) if known else WRONG
    found = diagnose(ROBOT, with_hidden(), Terms([model]), exclude=made.SLOW)
    notes = contradicted_values(found)
    assert list(notes) == ["centre_of_mass"] * known
    told = " ".join(notes.values())
    assert not known or ("shift_x = 20.0" in told and "shift_y" not in told)


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
    assert found.notes[0].startswith("pulley_radius: radius_m is 8.7") == told


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
    assert found.missing and not list(contradicted_values(found))


def test_values_that_the_data_confirm_are_not_doubted() -> None:
    mass = term(ROBOT, "platform_mass", added_kg=0.1)
    data = measured(ROBOT, [HIDDEN, mass], points=4, seed=3)
    found = diagnose(ROBOT, data, Terms([HIDDEN.fixed()]), exclude=made.SLOW)
    assert [one.effect for one in found.missing] and not list(contradicted_values(found))


def test_a_fixed_value_at_its_bound_stays_there() -> None:
    friction = term(ROBOT, "exit_friction", friction=0.0, length_m=0.5).fixed("friction")
    np.testing.assert_array_equal(inside(friction).vector, friction.vector)
