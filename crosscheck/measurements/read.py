"""Read measurements of a robot: a CSV (or Parquet) with the robot's commands and readings.

Every mistake in a file is reported in one sentence with file, line and column. Units are SI from
here on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.beside import SOURCES, Beside, read_beside
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.dwells import averaged_dwells
from crosscheck.measurements.notice import notice
from crosscheck.measurements.together import together
from seecr.columns.commands import began, known_loads, runs, temperatures, times
from seecr.columns.csv import read_table
from seecr.columns.known import POSITION, Columns, know_columns
from seecr.columns.poses import (
    command_lengths,
    command_poses,
    measured_orientation,
    wanted_poses,
)
from seecr.commands import Commands
from seecr.counted import counted
from seecr.errors import InputError
from seecr.files import path_of

if TYPE_CHECKING:
    from seecr.description.robot import Robot

GivenData: TypeAlias = Measurements | str | Path | Sequence[str | Path]
"""Measurements, their file, or several files of one robot."""

_NONE = "there are no commands; expected one or more"

GivenCommands: TypeAlias = Measurements | Commands | str | Path | ArrayLike
"""Commands, their file, or commanded poses (n, 7)."""


def load_measurements(
    path: str | Path | Sequence[str | Path],
    robot: GivenRobot,
    *,
    sigma: Sigma | None = None,
    sigma_path: str | Path | None = None,
) -> Measurements:
    """Read measurements, and the TOML beside them if there is one: noise and the like.

    Args:
        path: CSV or Parquet, or several of them: each has its own TOML, and runs stay separate.
        robot: the measured robot, or its MJCF.
        sigma: noise, in place of the TOML's for the kinds that it states, in all files.
        sigma_path: the TOML, if its name is not the data file's with ``.toml``.

    Raises:
        InputFileError: any mistake in either file.
        InputError: no path, or ``sigma`` is something else than a :class:`crosscheck.Sigma`.
    """
    robot = robot_of(robot)
    _check_sigma(sigma)
    paths = [path] if isinstance(path, str | Path) or not isinstance(path, Sequence) else path
    for one in paths:
        if not isinstance(one, str | Path):
            raise InputError(f"expected measurements or their files, got {type(one).__name__}")
    if not paths:
        raise InputError("expected measurements or their files, got none")
    return _stated(together([_measured(Path(one), robot, sigma_path) for one in paths]), sigma)


def _check_sigma(sigma: Sigma | None) -> None:
    """Check that it is noise, if anything, before files are read."""
    if sigma is not None and not isinstance(sigma, Sigma):
        raise InputError(
            "sigma: expected a crosscheck.Sigma, such as Sigma(position_m=1e-4), got "
            f"{type(sigma).__name__}"
        )


def _stated(data: Measurements, sigma: Sigma | None) -> Measurements:
    """The measurements with the noise that is stated for them, the same in all files."""
    if sigma is None or not sigma.stated:
        return data
    ratio = data.sigma_ratio.copy()
    ratio[:, [item.name in sigma.stated for item in fields(Sigma)]] = 1.0
    whole = replace(data.sigma, **sigma.stated)
    # what the caller states is no lower bound
    return replace(data, sigma=whole, sigma_ratio=ratio, sigma_source=SOURCES[0])


def _measured(path: Path, robot: Robot, sigma_path: str | Path | None) -> Measurements:
    columns = _open(path, robot)
    data = _load(columns, robot, sigma_path)
    if not (data.has_position or data.has_orientation or data.has_tension):
        raise columns.table.error(
            "no measurement; expected readings in at least one column such as meas_x_m, meas_qw "
            f"to meas_qz, meas_rx_rad or tension_1_N{columns.near_misses()}"
        )
    return data


def load_commands(
    path: str | Path,
    robot: GivenRobot,
    *,
    sigma: Sigma | None = None,
    sigma_path: str | Path | None = None,
) -> Measurements:
    """Like :func:`load_measurements`, for commands that have not been measured yet.

    Args:
        path: CSV or Parquet.
        robot: the robot to be commanded, or its MJCF.
        sigma: noise to expect, in place of the TOML's for the kinds that it states.
        sigma_path: the TOML, if its name is not the data file's with ``.toml``.

    Raises:
        InputFileError: any mistake in either file.
        InputError: no path, or ``sigma`` is something else than a :class:`crosscheck.Sigma`.
    """
    robot = robot_of(robot)
    _check_sigma(sigma)
    return _stated(_load(_open(path_of(path, "commands"), robot), robot, sigma_path), sigma)


def measurements_of(given: GivenData, robot: Robot) -> Measurements:
    """The measurements, read if a path is given, with the dwells of long logs averaged."""
    whole = given if isinstance(given, Measurements) else load_measurements(given, robot)
    return averaged_dwells(whole)


def commands_of(given: GivenCommands, robot: Robot) -> Measurements:
    """The commands, read if a path is given; poses (n, 7) are one run, and so are commands without.

    Raises:
        InputFileError: any mistake in the file.
        InputError: something other than commands, or none.
    """
    if isinstance(given, str | Path):
        return load_commands(given, robot)
    if isinstance(given, Measurements | Commands):
        if (given.n_rows if isinstance(given, Measurements) else len(given)) == 0:
            raise InputError(_NONE)
        return given if isinstance(given, Measurements) else _of_one_clock(given, robot)
    return _of_poses(given, robot)


def _of_poses(given: ArrayLike, robot: Robot) -> Measurements:
    """Poses (n, 7) as a file of them would be read, one run."""
    from seecr.statics.starts import commanded_poses  # takes a while to import

    pose = commanded_poses(given)
    if len(pose) == 0:
        raise InputError(_NONE)
    run = np.full(len(pose), "all")
    return Measurements(Path("poses.csv"), robot.n_cables, run, command_pose=pose)


def _of_one_clock(given: Commands, robot: Robot) -> Measurements:
    """Commands as a file of them would be read."""
    from seecr.statics.starts import answered, commanded_poses  # takes a while to import

    if given.clock is not None and len(np.unique(given.clock)) > 1:
        raise InputError("commands of several clocks; expected those of one file")
    lengths, n = answered(given).lengths, len(given)
    run = np.full(n, "all") if given.run is None else given.run
    return Measurements(
        Path("commands.csv"),
        robot.n_cables,
        run.astype(np.str_),
        command_pose=commanded_poses(given.pose) if lengths is None else None,
        command_lengths=lengths,
        told=given.told and lengths is not None,
        t_s=given.time,
        temperature_C=given.temperature,
        loads=given.loads,
        stands=np.zeros(n, dtype=bool) if given.stands is None else given.stands,
        line=np.arange(2, n + 2) if given.line is None else given.line,
    )


def _open(path: str | Path, robot: Robot) -> Columns:
    table = read_table(Path(path))
    return know_columns(table, robot.n_cables, robot.cable_names)


def _load(columns: Columns, robot: Robot, sigma_path: str | Path | None) -> Measurements:
    run = runs(columns)
    t_s, temperature = times(columns, run), temperatures(columns)
    lengths = command_lengths(columns, robot)
    pose = command_poses(columns, robot) if lengths is None else None
    position = columns.readings("meas", POSITION)
    quat, angles = measured_orientation(columns)
    cables = [str(i + 1) for i in range(robot.n_cables)]
    tensions = columns.readings("tension", cables)
    beside = _beside(columns.table.path, sigma_path)
    if beside.told and lengths is None:
        columns.notes.append('lengths = "told" has no effect here: the commands are poses.')
    data = Measurements(
        path=columns.table.path,
        n_cables=robot.n_cables,
        run=run,
        t_s=t_s,
        began=None if t_s is None else began(columns.table, columns.known["t"].index),
        command_pose=pose,
        command_lengths=lengths,
        told=beside.told and lengths is not None,
        wanted=wanted_poses(columns, robot),
        position=position,
        quat_wxyz=quat,
        angles_rad=angles,
        tensions=tensions,
        temperature_C=temperature,
        loads=known_loads(columns, robot),
        stands=np.full(columns.n_rows, beside.stands),
        free=beside.free,
        sigma=beside.sigma,
        sigma_source=beside.source,
        line=columns.table.line,
        unused_columns=columns.unused,
    )
    notes = [*columns.notes, *_way_points(data), *notice(columns, robot, data)]
    return replace(data, notes=tuple(notes))


def _beside(path: Path, toml: str | Path | None) -> Beside:
    if toml is not None:
        return read_beside(Path(toml))
    beside = path.with_suffix(".toml")
    return read_beside(beside) if beside.exists() else Beside()


def _way_points(data: Measurements) -> list[str]:
    silent = int(np.sum(~data.read))
    if not 0 < silent < data.n_rows:
        return []
    rows = counted(silent, "row")
    if silent == 1:
        return [f"{rows} has a command but no reading: a way point, which is not compared."]
    return [f"{rows} have a command but no reading: way points, which are not compared."]
