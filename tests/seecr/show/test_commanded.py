"""Commands that are written are read as the same commands."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from seecr.columns.commands import CommandFile, read_commands
from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.show.files import SweepRows, corrected_csv, corrected_toml, toml_beside

ROBOT = load_robot("planar_vertical")
WRENCH = np.arange(18.0).reshape(3, 6) / 70.0
SOME_AT_ITS_OWN = np.array([[0.1, 0.2, -0.3], [np.nan] * 3, [0.0, 0.05, 0.0]])
"""Where payloads hang: the second at the platform's own centre of mass."""


@pytest.fixture(scope="module")
def found() -> Any:
    """What is written of a correction, whose lengths are those of the description."""
    poses = np.tile(ROBOT.reference_pose, (3, 1))
    lengths = np.tile(ROBOT.rest_lengths, (3, 1))
    return SimpleNamespace(
        wanted=poses, lengths=lengths, found=np.ones(3, bool), solution=solve(ROBOT, poses)
    )


@pytest.mark.parametrize("centre", [None, SOME_AT_ITS_OWN, np.nan_to_num(SOME_AT_ITS_OWN)])
@pytest.mark.parametrize("kind", ["sweep", "corrected"])
def test_loads_are_read_as_they_were(
    tmp_path: Path, found: Any, kind: str, centre: np.ndarray | None
) -> None:
    loads = Loads.of(3, mass=np.array([0.1, 0.2, 0.0]), centre=centre, wrench=WRENCH)
    wanted = CommandFile(Commands(found.wanted, loads=loads), None, ("a",) * 3, ())
    path = tmp_path / "written.csv"
    if kind == "sweep":
        path.write_text(SweepRows(found.solution, loads=loads).csv_text())
    else:
        path.write_text(corrected_csv(found, wanted))
        path.with_suffix(".toml").write_text(corrected_toml(wanted))
    assert "nan" not in path.read_text()
    again = read_commands(path, ROBOT).commands.loads
    assert again is not None
    for name in ("mass", "centre", "wrench"):
        np.testing.assert_array_equal(getattr(again, name), getattr(loads, name))


@pytest.mark.parametrize("stands", [None, np.ones(3, bool)])
@pytest.mark.parametrize("told", [False, True])
def test_what_lengths_mean_and_where_runs_begin_are_read_as_they_were(
    tmp_path: Path, found: Any, told: bool, stands: np.ndarray | None
) -> None:
    commands = Commands(found.wanted, found.lengths, told=told, stands=stands)
    path = tmp_path / "written.csv"
    path.write_text(SweepRows(found.solution, found.lengths).csv_text())
    text = toml_beside(told, commands)
    path.with_suffix(".toml").write_text(text)
    again = read_commands(path, ROBOT).commands
    assert again.told == told
    np.testing.assert_array_equal(again.starts_here, commands.starts_here)
    assert bool(text) == (told or stands is not None)
