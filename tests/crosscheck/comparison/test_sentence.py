"""What a comparison concludes is no kinder than its tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro

from crosscheck.comparison.associations import Association
from crosscheck.comparison.noise import underestimation
from crosscheck.comparison.quantities import QuantityKind
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import error_size_words, misfit_sentence, noise_sentence
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.measurements.data import Sigma
from seecr.pose import quat_from_rotvec, quat_multiply, rotvec_from_quat

ROBOT = soft_cogiro()
LOOSE = Whiteness(900.0, 100, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0)
FOLLOWS = Association(
    QuantityKind.PLACE, "commanded x", "readings", 0.33, 1e-6, "x", "m", bins=()
)  # fmt: skip


def test_errors_that_depend_on_something_do_not_look_random() -> None:
    """Of inverted rotations it said so beside tables that explained a third of them."""
    said = misfit_sentence(LOOSE, {"position": 2.5}, "stated", [FOLLOWS])
    assert said == (
        "The model misses something: the errors are 3 times the noise; commanded x explains 33 % "
        "of their variance."
    )
    chance = replace(FOLLOWS, p=0.5)
    assert misfit_sentence(LOOSE, {"position": 2.5}, "stated", [chance]) == (
        "The residuals look random, but the errors are 3 times the noise: either it is stated too "
        "small, or many small effects are missing."
    )
    constant = replace(FOLLOWS, kind=QuantityKind.EVERYWHERE)
    assert misfit_sentence(LOOSE, {"position": 2.5}, "stated", [constant]).endswith(
        "33 % of their mean square is a constant offset."
    )


def test_gross_errors_are_not_many_small_effects() -> None:
    gross = replace(LOOSE, scale=2410.0)
    said = misfit_sentence(gross, {"position": 1.03, "orientation": 3410.0}, "stated", [])
    assert said == (
        "The model misses something, or the noise is stated 3.41e+03 times too small: the errors "
        "of orientation are 3.41e+03 times the noise (those of position are noise), and depend on "
        "nothing that was tested."
    )


def test_kinds_of_readings_are_told_apart_if_only_some_are_off() -> None:
    assert error_size_words(3.0, {"position": 4.0, "orientation": 2.0}) == (
        "the errors are 3 times the noise"
    )
    assert error_size_words(1.2, {"position": 1.3}) == "the errors are 1.2 times the noise"
    assert error_size_words(9.0, {"position": 4.0, "orientation": 1.0, "tension": 15.0}) == (
        "the errors of position and tension are 4 and 15 times the noise (those of orientation are "
        "noise)"
    )


def test_noise_that_depends_on_something_says_so() -> None:
    white = replace(LOOSE, p=0.5, scale=1.01)
    assert noise_sentence(white, "stated", []) == (
        "Model and data agree: the residuals are noise (1.01 times the stated noise)."
    )
    assert noise_sentence(white, "stated", [FOLLOWS]).endswith(
        "the residuals are noise (1.01 times the stated noise), but commanded x explains 33 % of "
        "their variance."
    )


def test_the_comparison_tells_how_many_times_the_noise_each_kind_is() -> None:
    data = measured(ROBOT)
    assert data.quat_wxyz is not None
    rng = np.random.default_rng(3)
    loud = quat_from_rotvec(30.0 * 3.5e-4 * rng.standard_normal((data.n_rows, 3)))
    found = compare(ROBOT, replace(data, quat_wxyz=quat_multiply(loud, data.quat_wxyz)))
    assert found.times_noise["position"] == pytest.approx(1.0, abs=0.15)
    assert found.times_noise["orientation"] == pytest.approx(30.0, rel=0.15)
    assert (
        found.sentence.startswith("The model misses something, or the noise is stated ")
        and "(those of position are noise), and depend on nothing that was tested" in found.sentence
    )
    assert found.as_json()["residual"]["times_noise"] == found.times_noise


def test_what_varies_smoothly_with_the_tilt_is_no_noise_that_was_estimatedunderestimation() -> None:
    """Angles in another order were "3.46 times the assumed noise", and agreed."""
    rng = np.random.default_rng(0)
    data = measured(ROBOT).rows(np.arange(60))
    pose = np.tile(ROBOT.reference_pose, (60, 1))
    pose[:, :3] += rng.uniform(-1.0, 1.0, (60, 3)) * np.array([0.15, 0.1, 0.08])
    pose[:, 3:] = quat_from_rotvec(np.radians(5.0) * rng.uniform(-1.0, 1.0, (60, 3)))
    plain = compare(ROBOT, replace(data, command_pose=pose, run=np.full(60, "a")))
    rest = plain.state.prediction.pose
    x, y, z = rotvec_from_quat(pose[:, 3:]).T
    bent = 0.6 * np.stack([-y * z, x * z, -x * y], axis=1)
    turn = quat_from_rotvec(bent + SIGMA.orientation_rad * rng.standard_normal((60, 3)))
    found = compare(ROBOT, replace(
        data, command_pose=pose, run=np.full(60, "a"), sigma=Sigma(),
        position=rest[:, :3] + SIGMA.position_m * rng.standard_normal((60, 3)),
        quat_wxyz=quat_multiply(turn, rest[:, 3:]),
    ))  # fmt: skip
    assert found.refusal is None and found.times_noise["orientation"] > 2.0
    assert not found.is_noise
    assert "(those of position are noise)" in found.sentence


def test_estimates_from_differences_areunderestimation_if_neighbours_are_alike() -> None:
    rho, rows = 0.8, 200_000
    noise = np.random.default_rng(1).standard_normal(rows)
    for k in range(1, rows):
        noise[k] = rho * noise[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
    part = np.std(np.diff(noise, n=3)) / np.sqrt(20.0)
    assert 1.0 / part == pytest.approx(underestimation(False, rho), rel=0.02)
    assert underestimation(False, 0.0) == underestimation(True, 0.8) == 1.0
