"""Long logs become a row for each dwell, whose noise is what its readings say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.dwells import averaged_dwells, mean_error
from crosscheck.measurements.read import measurements_of
from seecr.commands import Loads
from seecr.description.mjcf import load_robot, model_path
from seecr.pose import quat_from_rotvec

DWELLS, READINGS, NOISE_M, NOISE_RAD = 60, 40, 1e-4, 3e-4


def log(noise: np.ndarray, stated: Sigma | None = None) -> Measurements:
    """60 poses read 40 times each at 100 Hz; noise (60, 40, 6) in its units."""
    poses = np.zeros((DWELLS, 7))
    poses[:, 0], poses[:, 3] = np.linspace(-1.0, 1.0, DWELLS), 1.0
    told = np.repeat(poses, READINGS, axis=0)
    flat = noise.reshape(-1, 6)
    dwell, reading = np.divmod(np.arange(len(told)), READINGS)
    return Measurements(
        path=Path("log.csv"),
        n_cables=4,
        run=np.repeat(["go", "back"], len(told) // 2),
        t_s=5.0 * dwell + 0.01 * reading,
        command_pose=told,
        position=told[:, :3] + NOISE_M * flat[:, :3],
        quat_wxyz=quat_from_rotvec(NOISE_RAD * flat[:, 3:]),
        sigma=stated or Sigma(position_m=NOISE_M, orientation_rad=NOISE_RAD),
    )


@pytest.fixture
def white() -> np.ndarray:
    return np.random.default_rng(1).standard_normal((DWELLS, READINGS, 6))


def test_white_noise_averages_out(white):
    data = averaged_dwells(log(white))
    assert data.n_rows == DWELLS and data.runs == ("go", "back")
    assert data.line[:2].tolist() == [2, 42]
    assert data.t_s[1] == pytest.approx(5.0 + 0.01 * (READINGS - 1) / 2)
    expected = 1 / np.sqrt(READINGS)
    assert data.sigma_ratio[:, :2] == pytest.approx(np.full((DWELLS, 2), expected), rel=0.1)
    assert np.all(data.sigma_ratio[:, 2:] == 1.0)
    off = (data.position - data.command_pose[:, :3]) / (NOISE_M * data.sigma_ratio[:, :1])
    assert np.std(off) == pytest.approx(1.0, rel=0.15)
    turned = 2 * data.quat_wxyz[:, 1:] / (NOISE_RAD * data.sigma_ratio[:, 1:2])
    assert np.std(turned) == pytest.approx(1.0, rel=0.15)
    assert "2400 rows are 60 dwells, each averaged: 40 rows in one" in data.notes[-1]
    assert "the noise of a mean, over that stated for one reading: positions 0." in data.notes[-1]


def test_readings_that_go_together_count_for_fewer(white):
    alike = white.copy()
    for k in range(1, READINGS):
        alike[:, k] = 0.8 * alike[:, k - 1] + 0.6 * white[:, k]
    data = averaged_dwells(log(alike))
    off = (data.position - data.command_pose[:, :3]) / (NOISE_M * data.sigma_ratio[:, :1])
    assert np.std(off) == pytest.approx(1.0, rel=0.3)
    # so many in a row count as one: (1 + rho)/(1 - rho)
    assert data.sigma_ratio[:, :2] == pytest.approx(
        np.full((60, 2), 3.0 / np.sqrt(READINGS)), rel=0.1
    )


def test_the_error_of_a_mean_is_that_of_five_parts():
    steps = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0], 8)  # parts that differ, readings that do not
    assert mean_error(steps[:, None]) == pytest.approx(np.sqrt(2.5 / 5.0))
    both = np.stack([steps, 3.0 * steps[::-1]], axis=1)
    assert mean_error(both) == pytest.approx(np.sqrt(0.5 * (2.5 + 22.5) / 5.0))
    assert mean_error(np.array([[1.0], [3.0]])) == pytest.approx(1.0)  # and of two there are two


def test_stated_noise_that_no_dwell_shows_stays(white):
    """A tracker stated to 0.3 mm that scatters by 0.1 mm at rest is off by the rest of it."""
    data = averaged_dwells(log(white, Sigma(position_m=3 * NOISE_M)))
    kept = np.sqrt((9 - 1 + 1 / READINGS) / 9)
    assert data.sigma_ratio[:, 0] == pytest.approx(np.full(DWELLS, kept), rel=0.01)


def test_noise_that_nobody_stated_is_left_to_the_fit(white):
    data = averaged_dwells(log(white, Sigma()))
    assert data.n_rows == DWELLS and np.all(data.sigma_ratio == 1.0)
    assert "noise stated" not in data.notes[-1]


def test_what_was_not_read_stays_unread_and_gaps_are_no_readings(white):
    data = log(white)
    position, quat = data.position.copy(), data.quat_wxyz.copy()
    position[:READINGS], position[READINGS : 2 * READINGS - 1] = np.nan, np.nan
    quat[:READINGS] = np.nan
    means = averaged_dwells(replace(data, position=position, quat_wxyz=quat))
    assert np.isnan(means.position[0]).all() and np.isnan(means.quat_wxyz[0]).all()
    assert means.position[1] == pytest.approx(position[2 * READINGS - 1])


def test_angles_about_a_half_turn_are_averaged_as_angles(white):
    data = log(white)
    angles = np.tile([0.0, np.nan, np.pi], (data.n_rows, 1))
    angles += 1e-3 * white.reshape(-1, 6)[:, :3]
    angles[:, 2] = np.arctan2(np.sin(angles[:, 2]), np.cos(angles[:, 2]))
    means = averaged_dwells(replace(data, quat_wxyz=None, angles_rad=angles))
    assert np.abs(means.angles_rad[:, 2]) == pytest.approx(np.full(DWELLS, np.pi), abs=1e-3)
    assert means.sigma_ratio[0, 1] == pytest.approx(10 / 3 / np.sqrt(READINGS), rel=0.15)


def test_another_load_and_a_long_rest_are_other_rows(white):
    data = log(white)
    mass = np.zeros(data.n_rows)
    mass[READINGS // 2 : READINGS] = 1.0
    assert averaged_dwells(replace(data, loads=Loads.of(len(mass), mass=mass))).n_rows == 61
    slow = replace(data, t_s=data.t_s * 20.0)  # a reading every 0.2 s, eight seconds per dwell
    assert averaged_dwells(slow).n_rows == DWELLS
    hour = replace(data, command_pose=np.tile(data.command_pose[:1], (data.n_rows, 1)))
    hour = replace(hour, t_s=0.5 * np.arange(data.n_rows))
    assert averaged_dwells(hour).n_rows == 40  # of 30 s each
    apart = replace(data, t_s=2.0 * np.arange(data.n_rows))
    assert averaged_dwells(apart) is apart  # no dwell: rows seconds apart


def test_short_logs_and_ways_are_taken_row_by_row(white):
    data = log(white)
    assert averaged_dwells(data.rows(slice(1000))).n_rows == 1000
    way = data.command_pose.copy()
    way[:, 1] = np.linspace(0.0, 0.1, data.n_rows)
    moving = replace(data, command_pose=way)
    assert averaged_dwells(moving) is moving


def test_every_command_gets_averages(white):
    robot = load_robot(model_path("demobot_cogiro"))
    assert measurements_of(log(white), robot).n_rows == DWELLS
