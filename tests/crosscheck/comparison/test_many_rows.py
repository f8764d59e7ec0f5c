"""Very many rows: the memory that they need, and what is asked of some of them alone."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import seecr
from crosscheck import Sigma, compare, load_measurements
from crosscheck.comparison import noise
from crosscheck.measurements.data import Measurements
from seecr.statics.tables import PORTION

pytestmark = pytest.mark.slow

# Bytes of a row at most: 10^6 rows are to fit into 2 GB, of which 0.3 are the programs. A
# comparison takes 1.06 kB: commands and readings, the problem that is solved and its solution,
# residuals and their noise. It was 3.0 kB. A file of 14 columns takes 0.80 kB while it is read,
# and took 2.5 kB.
COMPARED, READ = 1500, 1000


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


def bytes_of_a_row(task: Callable[[int], Callable[[], object]]) -> float:
    """What a task of n rows takes more for each row, at its peak, of memory that Python knows."""

    def peak(n: int) -> int:
        run = task(n)
        tracemalloc.start()
        run()
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    return (peak(3 * PORTION) - peak(2 * PORTION)) / PORTION


def test_memory_of_a_row() -> None:
    def comparison(n: int) -> Callable[[], object]:
        data = data_of(n)
        return lambda: compare("demobot_cogiro", data)

    assert bytes_of_a_row(comparison) < COMPARED


def test_memory_of_a_row_that_is_read(tmp_path: Path) -> None:
    parts = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
    names = ",".join(f"{of}_{part}" for of in ("cmd", "meas") for part in parts)
    path = tmp_path / "many.csv"

    def reading(n: int) -> Callable[[], object]:
        data = data_of(n)
        table = np.hstack([data.command_pose, data.position, data.quat_wxyz])
        np.savetxt(path, table, "%.9g", ",", header=names, comments="")
        return lambda: load_measurements(path, "demobot_cogiro")

    assert bytes_of_a_row(reading) < READ


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
