"""The model of a diagnosis: how well its values are known."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import made_diagnoses as made
import numpy as np
import pytest
from made_data import COGIRO, measured, term
from made_diagnoses import (
    POINTS,
    SIGMA,
    diagnose_with,
    none,
    nothing,
    pulleys,
    readings,
    robot,
    unknown,
)
from scipy.signal import lfilter

from crosscheck.comparison.residuals import compare
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.found import found_covariance, found_effects
from crosscheck.diagnosis.result import (
    HALF_THE_NOISE,
    Chances,
    Diagnosis,
    Tolerance,
    doubt_of,
    remainder_of,
)
from crosscheck.diagnosis.words import hints_of, removed
from crosscheck.errors import CrosscheckError
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.inference.fields import Varying
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.model.write import save_model
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.prediction.experiment import predict
from seecr.prediction.model import load_model
from seecr.prediction.uncertainty import covariance_of


def test_the_covariance_is_that_of_the_errors_as_listed() -> None:
    found = pulleys()
    (listed,) = found.missing
    wider = replace(found, missing=(replace(listed, stderr=3.0 * listed.stderr),))
    for one, factor in ((found, 1.0), (wider, 3.0)):
        covariance = found_covariance(one)
        assert covariance is not None
        own = np.concatenate([effect.stderr for effect in found_effects(one)])
        assert np.sqrt(np.diag(covariance)) == pytest.approx(own)
        assert own[-1] == pytest.approx(factor * listed.stderr[-1])


def test_the_covariance_goes_in_the_order_of_the_effects() -> None:
    """Which is that of their worth, not of the fit."""
    hidden = [term(robot(), "pulley_radius", radius_m=0.01)]
    hidden.append(term(robot(), "stiffness", factor=0.8))
    data = measured(robot(), hidden, points=POINTS, sigma=SIGMA, tensions=True)
    found = diagnose_with(robot(), data, only=[one.name for one in hidden])
    assert len(found.missing) == 2
    for missing in (found.missing, found.missing[::-1]):
        one = replace(found, missing=missing)
        covariance = found_covariance(one)
        assert covariance is not None
        own = np.concatenate([effect.stderr for effect in found_effects(one)])
        assert own[0] != pytest.approx(own[1])
        assert np.sqrt(np.diag(covariance)) == pytest.approx(own)


@pytest.mark.parametrize(
    "verdict", [DiagnosisVerdict.MANY_EFFECTS, DiagnosisVerdict.UNKNOWN_EFFECT]
)
def test_where_more_is_missing_than_is_listed_there_is_none(verdict: DiagnosisVerdict) -> None:
    assert found_covariance(replace(pulleys(), verdict=verdict)) is None


def test_a_diagnosis_has_a_model_that_is_kept_compared_and_predicts(tmp_path: Path) -> None:
    found, data = pulleys(), readings(radius_m=0.01)
    assert found.model is not None and found.model is found.model
    save_model(tmp_path / "m.toml", found.model)
    kept = load_model(tmp_path / "m.toml", robot())
    assert kept.document["effect"][0]["provenance"]["by"] == "crosscheck diagnose"
    assert covariance_of(kept) == pytest.approx(covariance_of(found.model))
    assert kept.stderr["pulley_radius"] == pytest.approx(found.missing[0].stderr, rel=1e-2)
    assert compare(robot(), data, found.model).is_noise
    poses = data.command_pose
    assert predict(robot(), poses, found.model).pose == pytest.approx(
        predict(robot(), poses, kept).pose
    )


def test_the_model_of_a_diagnosis_has_what_was_given_too(tmp_path: Path) -> None:
    data, few = readings(radius_m=0.01), ["pulley_radius"]
    given = [term(robot(), "stiffness", factor=1.0001)]
    found = diagnose_with(robot(), data, given, only=few)
    assert found.model is not None and found.model.names == ("stiffness", "pulley_radius")
    save_model(tmp_path / "m.toml", found.model)
    # with its own model nothing is missing, and that stays as it is, with its covariance
    again = diagnose_with(robot(), data, tmp_path / "m.toml", only=few)
    assert again.model is not None and again.refitted == () and not again.missing
    save_model(tmp_path / "again.toml", again.model)
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "m.toml").read_text()


def test_without_a_verdict_there_is_no_model_and_of_nothing_missing_the_plain_one() -> None:
    plain = nothing().model
    assert none().model is None and plain is not None and plain.names == ()


def test_the_model_has_the_values_that_explain_most_by_themselves() -> None:
    """What is listed beside many effects is nearer to the truth, and no model without the rest."""
    found = pulleys()
    (listed,) = found.missing
    beside = replace(listed, term=listed.term.with_vector(3.0 * listed.term.vector),
                     stderr=5.0 * listed.stderr)  # fmt: skip
    (kept,) = found_effects(replace(
        found, missing=(beside,), verdict=DiagnosisVerdict.MANY_EFFECTS
    ))  # fmt: skip
    assert kept.term.vector == pytest.approx(listed.term.vector)
    assert kept.stderr == pytest.approx(5.0 * listed.stderr)


# Known values of a model: no search moves fixed ones, and data that contradict them say so

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


# Sentences of a diagnosis that are made of lists


def test_what_is_probable_and_not_listed_is_a_hint() -> None:
    """Stiffness at 78 % stood nowhere in the sentence that named the tracker's frame."""
    classes = ((("tracker_frame",), 1.0), (("stiffness", "platform_mass"), 0.78), (("creep",), 0.3))
    chances = Chances({}, classes, 0.0)
    assert hints_of(chances, ["tracker_frame"]) == {"stiffness or platform_mass": 0.78}
    assert hints_of(chances, ["tracker_frame", "platform_mass"]) == {}


def test_what_something_unknown_may_change_is_told_and_kept() -> None:
    chances = Chances({}, (), 0.97, (Varying.POSITION, Varying.WINCHES))
    assert chances.looks_like == f" It looks like {Varying.POSITION} or {Varying.WINCHES}."
    kept = chances.as_json()["unknown"]
    assert kept["seen_in"] is Varying.POSITION and kept["or_in"] == [Varying.WINCHES]
    # what no smooth field follows has no such sentence
    assert unknown().sentence.endswith("an unknown effect is missing.")


def test_where_all_error_is_below_the_noise_no_share_of_it_is_told() -> None:
    """Points that moved were "removes 0 %", beside errors that fell."""
    assert removed(0.0) == "removes no error beyond the noise on test runs by itself"
    assert removed(0.526) == "removes 52.6 % of the unexplained error on test runs"
    assert "removes 0.1 %" in removed(0.001)


# What is left counts as missing where it matters, and is told in any case

NOISE = {"position_rms_m": 1e-4, "orientation_rms_rad": 1e-3, "tension_rms_N": None}


def rms(position: float, orientation: float) -> dict[str, float | None]:
    return NOISE | {"position_rms_m": position, "orientation_rms_rad": orientation}


def test_tolerances_are_quantities_whose_unit_says_the_kind() -> None:
    told = Tolerance.parsed(["0.1mm", "0.05deg", "1N"])
    assert told.orientation_rad == pytest.approx(np.radians(0.05))
    assert told == Tolerance(1e-4, told.orientation_rad, 1.0)
    assert Tolerance.parsed([]) == HALF_THE_NOISE


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["0.1kg"], r"--tolerance: expected a number with its unit \(m, .*rad.*N.*got unit 'kg'"),
        (["0.1"], r"got no unit in '0.1'"),
        (["-1mm"], r"expected more than zero, got '-1mm'"),
        (["1mm", "2mm"], r"--tolerance 2mm: expected one for the position, got two; leave one out"),
    ],
)
def test_what_is_no_tolerance_is_refused(texts: list[str], words: str) -> None:
    with pytest.raises(CrosscheckError, match=words):
        Tolerance.parsed(texts)


def test_what_is_left_is_what_noise_does_not_explain() -> None:
    left = remainder_of(rms(1.25e-4, 0.9e-3), NOISE, HALF_THE_NOISE, SIGMA)
    assert left.size == {
        "position_rms_m": pytest.approx(0.75e-4), "orientation_rms_rad": 0.0, "tension_rms_N": None,
    }  # fmt: skip
    assert left.limit["position_rms_m"] == pytest.approx(0.5e-4) and left.important
    assert "0.0750 mm" in left.words and "0.0500 mm" in left.words
    assert not remainder_of(rms(1.1e-4, 1.1e-3), NOISE, HALF_THE_NOISE, SIGMA).important
    # as the user says, each kind by itself
    assert not remainder_of(rms(1.25e-4, 1e-3), NOISE, Tolerance(position_m=1e-4), SIGMA).important
    assert remainder_of(rms(1.1e-4, 1e-3), NOISE, Tolerance(position_m=1e-5), SIGMA).important
    assert remainder_of(rms(1.25e-4, 2e-3), NOISE, Tolerance(position_m=1e-4), SIGMA).important


def test_what_chance_adds_to_few_readings_is_not_important() -> None:
    doubt = {"position_rms_m": 0.3}
    assert not remainder_of(rms(1.25e-4, 1e-3), NOISE, HALF_THE_NOISE, SIGMA, doubt).important
    assert remainder_of(rms(2e-4, 1e-3), NOISE, HALF_THE_NOISE, SIGMA, doubt).important
    problem = prepare(robot(), readings(), Terms()).problem
    n = 3 * problem.data.n_rows
    assert doubt_of(problem)["position_rms_m"] == pytest.approx(np.sqrt(2.0 / n))
    # Bartlett: rho of 0.8 leaves 0.36/1.64 of the readings
    expected = np.sqrt(2.0 * 1.64 / 0.36 / n)
    assert doubt_of(problem, 0.8)["position_rms_m"] == pytest.approx(expected)


def test_noise_that_nobody_stated_says_nothing_of_what_matters() -> None:
    some = Sigma(position_m=1e-4)
    left = remainder_of(rms(1.1e-4, 1.1e-3), NOISE, HALF_THE_NOISE, some)
    assert left.undecided and left.limit["orientation_rms_rad"] is None and not left.important
    assert left.as_json()["important"] is None
    far = remainder_of(rms(9e-4, 1.1e-3), NOISE, HALF_THE_NOISE, some)
    assert far.undecided and far.as_json()["important"] is True
    told = remainder_of(rms(1.1e-4, 1.1e-3), NOISE, Tolerance(orientation_rad=1e-3), some)
    assert not told.undecided and told.as_json()["important"] is False
    nothing = remainder_of(rms(1.1e-4, 1.1e-3), NOISE, HALF_THE_NOISE, Sigma())
    assert "not stated, use --tolerance" in nothing.words


@pytest.mark.slow
def test_structure_is_a_verdict_only_where_it_matters() -> None:
    """Noise of the stated size that is smooth along the way, and a wave that is larger."""
    data = readings()
    rng = np.random.default_rng(3)
    exact = readings()
    white = rng.standard_normal((data.n_rows, 3))
    smooth = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], white, axis=0)
    assert data.command_pose is not None and SIGMA.position_m is not None
    wave = np.sin(15.0 * data.command_pose[:, :1]) * [0.0, 0.0, 1.0]
    few = ["stiffness", "pulley_radius"]
    verdicts = {}
    for size in (0.0, 10.0):
        shift = SIGMA.position_m * (0.3 * smooth + size * wave)
        found = diagnose(robot(), replace(exact, position=exact.position + shift), only=few)
        verdicts[size] = found.verdict
        assert found.left is not None and any("error beyond the noise" in x for x in found.lines())
        assert found.as_json()["left_over"]["important"] == (size > 1.0)
    assert verdicts[0.0] is DiagnosisVerdict.NO_EFFECT_MISSING
    assert verdicts[10.0] is DiagnosisVerdict.UNKNOWN_EFFECT
    shift = SIGMA.position_m * 10.0 * wave
    told = Tolerance(position_m=1e-3, orientation_rad=0.01, tension_N=1.0)
    moved = replace(exact, position=exact.position + shift)
    found = diagnose(robot(), moved, only=few, tolerance=told)
    assert found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    assert "The structure that remains is too small to matter: " in found.sentence
    assert found.measure_next[-1].startswith("nothing that matters is missing;")


def test_what_chance_puts_second_is_named_beside_what_it_puts_first() -> None:
    """Softer cables whose noise happens to look like a bent law, by odds of a hundred to one."""
    robot = load_robot(COGIRO)
    alike = ("stiffness", "winch_side_length", "frame_compliance", "platform_mass",
             "exit_friction", "nonlinear_elasticity", "hysteresis")  # fmt: skip
    data = measured(robot, [term(robot, "stiffness", factor=1.105)], seed=37)
    (found,) = diagnose(robot, data, only=alike).missing
    assert "stiffness" in {found.effect, *found.indistinguishable}
    assert found.probability > 0.99
