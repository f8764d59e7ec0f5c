"""Outliers of a model that lacks something are named, and do not hide what it lacks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, soft_cogiro, term
from numpy.typing import NDArray

from crosscheck.comparison.noise import Coloured
from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot
from seecr.files import plain
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.prediction.experiment import predict

ROBOT = soft_cogiro()


def with_outliers(data: Measurements, part: float, seed: int = 0) -> tuple[
    Measurements, NDArray[np.bool_]
]:  # fmt: skip
    """Positions of some rows are centimetres off."""
    rng = np.random.default_rng(seed)
    rows = rng.random(data.n_rows) < part
    off = rng.standard_normal((data.n_rows, 3))
    off *= (0.02 + 0.02 * rng.random((data.n_rows, 1))) / np.linalg.norm(off, axis=1)[:, None]
    return replace(data, position=data.position + off * rows[:, None]), rows


@pytest.fixture(scope="module")
def lacking() -> Measurements:
    """A drum that is too large: errors of millimetres."""
    return measured(ROBOT, [term(ROBOT, "drum_gain", gain_3=0.01)], points=12)


@pytest.mark.parametrize("part", [0.03, 0.1])
@pytest.mark.parametrize("stated", [True, False])
def test_outliers_are_found_beside_what_the_model_lacks(
    lacking: Measurements, part: float, stated: bool
) -> None:
    data, rows = with_outliers(lacking, part)
    if not stated:
        data = replace(data, sigma=Sigma())
    found, clean = compare(ROBOT, data), compare(ROBOT, replace(lacking, sigma=data.sigma))
    assert found.outliers.tolist() == rows.tolist()
    assert found.sentence.startswith("The model misses something: ")
    assert f"{rows.sum()} outliers (lines " in found.sentence
    first, again = found.associations[0], clean.associations[0]
    assert first.significant and first.share == pytest.approx(again.share, abs=0.15)
    # the tables are of all rows, and tell the errors without outliers beside
    raw = found.state.raw[:, :3]
    assert found.rms["position_rms_m"] == pytest.approx(np.sqrt((raw**2).mean()))
    assert found.rms_without["position_rms_m"] == pytest.approx(np.sqrt((raw[~rows] ** 2).mean()))
    assert sum("possible outliers, included in all errors" in note for note in found.notes) == 1
    told = found.as_json()["outliers"]
    assert told["lines"].tolist() == data.line[rows].tolist()
    assert told["rms_without"] == found.rms_without


def test_noise_is_estimated_without_them() -> None:
    data, rows = with_outliers(replace(measured(ROBOT, points=24), sigma=Sigma()), 0.1)
    found = compare(ROBOT, data)
    assert found.outliers.tolist() == rows.tolist()
    assert found.problem.sigma.position_m == pytest.approx(SIGMA.position_m, rel=0.15)
    assert found.is_noise and f"{rows.sum()} outliers" in found.sentence


def found_in(data: Measurements) -> Comparison:
    return compare(ROBOT, data)


def test_rows_that_only_the_missing_effect_moves_far_are_no_outliers(lacking: Measurements) -> None:
    found = found_in(lacking)
    assert not found.outliers.any() and "outlier" not in found.sentence
    assert not any("outlier" in note for note in found.notes)
    assert found.rms_without == found.rms


def test_rows_far_off_side_by_side_are_structure() -> None:
    data = measured(ROBOT, points=12)
    position = data.position.copy()
    position[20:27] += 0.02
    found = found_in(replace(data, position=position))
    assert not found.outliers.any() and not found.is_noise


def test_of_few_readings_those_are_named_that_are_far_off_all_others() -> None:
    data = measured(ROBOT, points=8).rows(np.arange(9))
    position = data.position.copy()
    position[4] += 0.02
    found = found_in(replace(data, position=position, quat_wxyz=None))
    assert np.flatnonzero(found.outliers).tolist() == [4]


@pytest.mark.parametrize("rows", [300, 500])
def test_one_row_far_off_beside_a_large_misfit_is_named_alone(rows: int) -> None:
    """Of 1500 rows 32 were named, 31 of them good, or none: weights had followed the misfit."""
    robot = load_robot("demobot_cogiro")
    rng, sigma = np.random.default_rng(1), Sigma(position_m=1e-4, orientation_rad=2e-4)
    pose = np.tile(robot.reference_pose, (rows, 1))
    pose[:, :3] += rng.uniform(-0.15, 0.15, (rows, 3))
    there = predict(robot, pose, [term(robot, "pulley_radius", radius_m=0.02)]).readings
    position = there.position + 1e-4 * rng.standard_normal((rows, 3))
    position[7] += 0.05
    turn = quat_from_rotvec(2e-4 * rng.standard_normal((rows, 3)))
    data = Measurements(
        Path("a.csv"), 8, np.array([f"r{4 * k // rows}" for k in range(rows)]), command_pose=pose,
        position=position, quat_wxyz=quat_multiply(turn, there.quat_wxyz), sigma=sigma,
    )  # fmt: skip
    assert np.flatnonzero(compare(robot, data).outliers).tolist() == [7]


# Noise that goes together is noise; what only looks like it is not

ROBOT_COLOURED = load_robot(COGIRO)

POINTS = 12


def data_of(change: Array) -> Measurements:
    data = measured(ROBOT_COLOURED, points=POINTS, seed=5)
    return replace(data, position=data.position + change)


def compared(change: Array) -> Comparison:
    return compare(ROBOT_COLOURED, data_of(change))


def rows() -> int:
    return measured(ROBOT_COLOURED, points=POINTS, seed=5).n_rows


def drifting(rho: float, size: float) -> Array:
    """AR(1) noise along all rows; that of the readings is added to it."""
    rng = np.random.default_rng(3)
    out = rng.normal(size=(rows(), 3))
    for k in range(1, len(out)):
        out[k] = rho * out[k - 1] + np.sqrt(1 - rho**2) * out[k]
    return size * out


def test_noise_that_goes_together_is_noise_and_is_told() -> None:
    found = compared(drifting(0.9, 0.8 * SIGMA.position_m))
    assert found.whiteness is not None and found.whiteness.structured
    assert found.is_noise
    assert found.coloured is not None and found.coloured.rho["position"] > 0.2
    assert "with a correlation of" in found.sentence
    assert plain(found.as_json())["coloured_noise"]["rho"]["position"] > 0.2


def test_the_same_several_times_larger_than_stated_is_not() -> None:
    found = compared(drifting(0.9, 4.0 * SIGMA.position_m))
    assert not found.is_noise and found.coloured is None


@pytest.mark.slow
def test_a_few_rows_far_off_are_noise_unless_they_lie_side_by_side() -> None:
    apart, together = np.zeros((rows(), 3)), np.zeros((rows(), 3))
    apart[5::23] += 40 * SIGMA.position_m
    together[40 : 40 + len(apart[5::23])] += 40 * SIGMA.position_m
    found = compared(apart)
    assert found.is_noise and found.outliers[5::23].all()
    assert found.sentence.endswith("left out of this.")
    assert not compared(together).is_noise


def test_white_noise_needs_no_colour() -> None:
    found = compared(np.zeros((rows(), 3)))
    assert found.is_noise and found.coloured is None


def test_noise_in_words_tells_what_is_more_than_its_size() -> None:
    noise = Coloured({"position": 1.25, "tension": 0.5}, {"position": 0.051, "tension": 0.05}, 1)
    assert noise.words == (
        "position 1.25 times the assumed noise, with a correlation of 0.05 from row to row, "
        "tension 0.50 times the assumed noise; 1 outlier"
    )
    assert replace(noise, outliers=0).words.endswith("tension 0.50 times the assumed noise")


def test_smooth_noise_of_unstated_size_may_as_well_be_something_missing() -> None:
    """Cables that sag were "noise, 2.59 times the assumed", where diagnose saw structure."""
    data = data_of(drifting(0.9, 4.0 * SIGMA.position_m))
    found = compare(ROBOT_COLOURED, replace(data, sigma=replace(data.sigma, position_m=None)))
    assert found.coloured is not None and found.coloured.scale["position"] > 1.5
    assert found.is_open and not found.is_noise
    assert found.sentence.startswith("The residuals may be noise (position ")
    assert found.sentence.endswith("that varies as smoothly: state the noise.")
    assert plain(found.as_json())["is_open"] is True
    white = compare(ROBOT_COLOURED, replace(data_of(np.zeros((rows(), 3))), sigma=Sigma()))
    assert white.is_noise and not white.is_open


def test_hardly_any_readings_are_no_noise_of_a_kind() -> None:
    """Noise 1.48 times the stated one is told of 60 readings; 57 do not show what kind it is."""
    larger = drifting(0.0, 1.2 * SIGMA.position_m)
    for count, shown in ((19, False), (20, True)):
        data = data_of(larger).rows(slice(50, 50 + count))
        data = replace(data, quat_wxyz=None, tensions=np.full_like(data.tensions, np.nan))
        found = compare(ROBOT_COLOURED, data)
        assert found.whiteness is not None and not found.whiteness.is_noise
        assert found.problem.n_readings == 3 * count
        assert (found.coloured is not None) == shown
