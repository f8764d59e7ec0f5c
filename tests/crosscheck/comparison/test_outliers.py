"""Outliers of a model that lacks something are named, and do not hide what it lacks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from numpy.typing import NDArray

from crosscheck.comparison.residuals import compare
from crosscheck.comparison.result import Comparison
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot
from seecr.pose import quat_from_rotvec, quat_multiply
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
