"""Commands from a file: poses or lengths, with runs, times, temperatures and known loads.

The columns are those of a file of measurements, whose readings are ignored, and ``want_*``, the
poses that lengths are for. The TOML beside it may state ``lengths = "told"`` and
``start = "first_row"``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.columns.beside import choice
from seecr.columns.known import ANGLES, QUATERNION, know_columns
from seecr.columns.loads import known_loads
from seecr.columns.poses import aimed_poses, command_lengths, command_poses
from seecr.columns.reach import check_reach
from seecr.columns.table import read_table
from seecr.columns.times import runs, temperatures, times
from seecr.commands.data import Commands
from seecr.description.robot import Robot
from seecr.files import read_toml
from seecr.pose import Array

__all__ = ["CommandFile", "read_commands"]


@dataclass(frozen=True, eq=False)
class CommandFile:
    """Commands as read from a file.

    Attributes:
        commands: its rows.
        wanted: (n, 7) poses of columns ``want_*``, NaN where a row does not state all of one; None
            without such columns or lengths.
        run: (n,) names of runs.
        notes: sentences for the reader: what was assumed or filled in.
        any_orientation: whether it states positions alone.
    """

    commands: Commands
    wanted: Array | None
    run: tuple[str, ...]
    notes: tuple[str, ...]
    any_orientation: bool = False

    @property
    def conditions(self) -> dict[str, Sequence[Any]]:
        """Columns of the rows' runs, if there are several, their times and temperatures."""
        columns: dict[str, Sequence[Any]] = {"run": self.run} if len(set(self.run)) > 1 else {}
        if self.commands.time is not None:
            columns["t_s"] = self.commands.time.tolist()
        if self.commands.temperature is not None:
            columns["temperature_C"] = self.commands.temperature.tolist()
        return columns


def read_commands(path: str | Path, robot: Robot) -> CommandFile:
    """Read a list of commands for a robot.

    Args:
        path: the CSV or Parquet file.
        robot: for its number of cables, and its reference pose where the file states none.

    Raises:
        InputFileError: with line and column of the mistake.
    """
    path = Path(path)
    columns = know_columns(read_table(path), robot.n_cables, robot.cable_names)
    run = runs(columns)
    lengths = command_lengths(columns, robot)
    if lengths is None:
        # what these commands were for has no part in where they lead
        poses, wanted = command_poses(columns, robot), None
    else:
        poses, wanted = aimed_poses(columns, robot)
    check_reach(columns, robot, poses, lengths)
    told, stands = _beside(path.with_suffix(".toml"))
    commands = Commands(
        pose=poses,
        lengths=lengths,
        run=_numbers(run),
        time=times(columns, run),
        temperature=temperatures(columns),
        told=told and lengths is not None,
        loads=known_loads(columns, robot),
        stands=np.ones(len(run), dtype=bool) if stands else None,
        line=columns.table.line,
    )
    free = lengths is None and not columns.present("cmd", QUATERNION + ANGLES)
    return CommandFile(commands, wanted, tuple(run.tolist()), tuple(columns.notes), free)


def _beside(path: Path) -> tuple[bool, bool]:
    """Whether lengths are told ones, and whether runs start at their first row."""
    if not path.exists():
        return False, False
    toml = read_toml(path, "expected a TOML beside the commands")
    return choice(toml, "lengths") == "told", choice(toml, "start") == "first_row"


def _numbers(run: NDArray[np.str_]) -> NDArray[np.int64]:
    """Runs (n,) as numbers, in the order in which they come."""
    order = {name: number for number, name in enumerate(dict.fromkeys(run.tolist()))}
    return np.array([order[name] for name in run.tolist()], dtype=np.int64)
