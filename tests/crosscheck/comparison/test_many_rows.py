"""Very many rows: the memory that they need, and what is asked of some of them alone."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import seecr
from crosscheck import Sigma, compare
from crosscheck.comparison import noise
from crosscheck.measurements.data import Measurements
from seecr.statics.tables import PORTION

pytestmark = pytest.mark.slow

# Of a row 1.8 kB stay: its command and readings, the problem that is solved and its solution,
# residuals and their noise. With what is there while these are made it is 3.0 kB. It was 7.6 kB
# when all of the solution was evaluated for the tensions alone.
BYTES = 3600


def data_of(n: int, off: float = 0.0) -> Measurements:
    """Positions and quaternions with noise, of random commands in four runs."""
    robot, rng = seecr.load_robot("demobot_cogiro"), np.random.default_rng(n)
    pose = np.tile(robot.reference_pose, (n, 1))
    pose[:, :3] += rng.uniform(-0.1, 0.1, (n, 3))
    rest = seecr.solve(robot, pose).pose
    return Measurements(
        Path("many.csv"), robot.n_cables, np.sort(np.arange(n) % 4).astype(np.str_),
        command_pose=pose, position=rest[:, :3] + rng.normal(off, 1e-4, (n, 3)),
        quat_wxyz=rest[:, 3:], sigma=Sigma(position_m=1e-4, orientation_rad=1e-4),
    )  # fmt: skip


def test_memory_of_a_row() -> None:
    def peak(n: int) -> int:
        data = data_of(n)
        tracemalloc.start()
        compare("demobot_cogiro", data)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    assert (peak(3 * PORTION) - peak(2 * PORTION)) / PORTION < BYTES


def test_correlated_noise_is_sought_in_stretches_of_many_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With rho = 0.6 from row to row, which no stretch takes across its ends."""
    data, rng = data_of(2000), np.random.default_rng(0)
    drawn = rng.normal(size=(2000, 3))
    for k in range(1, 2000):
        drawn[k] = 0.6 * drawn[k - 1] + 0.8 * drawn[k]
    sigma = Sigma(position_m=3e-4)
    data = replace(data, position=data.position + 3e-4 * drawn, quat_wxyz=None, sigma=sigma)
    every = compare("demobot_cogiro", data)
    monkeypatch.setattr(noise, "_MOST_ASKED", 1000)
    some = compare("demobot_cogiro", data)
    for found in (every, some):
        assert found.coloured is not None
        assert found.coloured.rho["position"] == pytest.approx(0.54, abs=0.08)
    (note,) = set(some.notes) - set(every.notes)
    assert "was asked of about 1000 of 2000 rows: of stretches of 50 rows" in note


def test_an_offset_of_many_rows_is_no_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise, "_MOST_ASKED", 500)
    found = compare("demobot_cogiro", data_of(2000, off=1e-4))
    assert found.coloured is None and not found.is_noise
