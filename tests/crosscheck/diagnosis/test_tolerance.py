"""What is left counts as missing where it matters, and is told in any case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_diagnoses import SIGMA, readings, robot
from scipy.signal import lfilter

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import HALF_THE_NOISE, Tolerance, doubt_of, remainder_of
from crosscheck.errors import CrosscheckError
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.measurements.data import Sigma
from crosscheck.preparation.prepare import prepare
from seecr.effects import Terms

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
