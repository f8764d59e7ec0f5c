"""Which rows of a log of commands are commands of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.importing.join import held_commands
from crosscheck.measurements.data import Measurements
from seecr.commands import Loads

ROWS = 4
PULL = np.array([[0.0] * 6, [0.0] * 6, [5.0, 0, 0, 0, 0, 0], [0.0] * 6])
ASIDE = np.array([[0.0] * 3, [0.0] * 3, [0.1, 0.0, 0.0], [0.0] * 3])


@pytest.mark.parametrize(
    ("loads", "rows"),
    [
        (None, [0]),
        (Loads.of(ROWS, wrench=PULL), [0, 2, 3]),
        (Loads.of(ROWS, mass=np.full(ROWS, 2.0), centre=ASIDE), [0, 2, 3]),
        (Loads.of(ROWS, mass=np.array([0.0, 0.0, 2.0, 0.0])), [0, 2, 3]),
        (Loads.of(ROWS, centre=ASIDE), [0]),  # where nothing hangs
    ],
)
@pytest.mark.parametrize("timed", [False, True])
def test_another_load_is_another_command(
    tmp_path: Path, loads: Loads | None, rows: list[int], timed: bool
) -> None:
    """Only masses were compared: rows that differ in force or centre were one command."""
    log = Measurements(
        path=tmp_path, n_cables=2, run=np.full(ROWS, "a"), loads=loads,
        command_pose=np.tile([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0], (ROWS, 1)),
        t_s=np.arange(float(ROWS)) if timed else None,
    )  # fmt: skip
    assert held_commands(log, 0.5, 0.0, float(ROWS)).row.tolist() == rows


@pytest.mark.parametrize("begin", [0.0, 1234.5, 1.7e9])
def test_a_command_held_just_long_enough_counts_though_times_are_rounded(begin: float) -> None:
    rows = 40
    pose = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (rows, 1))
    pose[:, 0] = np.arange(rows)
    log = Measurements(
        path=Path("log.csv"), n_cables=2, run=np.full(rows, "a"), command_pose=pose,
        t_s=begin + 0.1 * np.arange(rows),
    )  # fmt: skip
    end = float(log.t_s[-1]) + 1.0
    assert held_commands(log, 0.1, 0.0, end).row.tolist() == list(range(rows))
    assert held_commands(log, 0.11, 0.0, end).row.tolist() == [rows - 1]
