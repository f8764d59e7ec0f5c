"""Read measurements of a robot: a CSV (or Parquet) with the robot's commands and readings.

Everything that is wrong with a file is said in one sentence with file, line and column. Units are
SI from here on.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.files import Toml, read_toml
from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.columns import POSITION, Columns, know_columns
from crosscheck.measurements.data import Measurements, Names, Sigma
from crosscheck.measurements.poses import command_lengths, command_poses, measured_orientation
from crosscheck.measurements.table import read_table, show
from seecr.errors import InputFileError
from seecr.pose import Array

if TYPE_CHECKING:
    from seecr.robot import Robot

_ABSOLUTE_ZERO_C = -273.15
_SIGMAS = tuple(field.name for field in fields(Sigma))


def load_measurements(
    path: str | Path, robot: GivenRobot, *, sigma_path: str | Path | None = None
) -> Measurements:
    """Read measurements, and the noise from the TOML beside them where there is one.

    Args:
        path: CSV or Parquet.
        robot: whose measurements these are, or its MJCF.
        sigma_path: the TOML, where it is not the data file's name with ``.toml``.

    Raises:
        InputFileError: anything wrong with either file.
    """
    robot = robot_of(robot)
    columns = _open(path, robot)
    data = _load(columns, robot, sigma_path)
    if not (data.has_position or data.has_orientation or data.has_tension):
        raise columns.table.error(
            "no measurement; expected readings in at least one column such as meas_x_m, meas_qw "
            f"to meas_qz, meas_rx_rad or tension_1_N{columns.near_misses()}"
        )
    return data


def load_commands(
    path: str | Path, robot: GivenRobot, *, sigma_path: str | Path | None = None
) -> Measurements:
    """Like :func:`load_measurements`, for poses that nobody has measured yet.

    Args:
        path: CSV or Parquet.
        robot: that is to be commanded so, or its MJCF.
        sigma_path: the TOML, where it is not the data file's name with ``.toml``.

    Raises:
        InputFileError: anything wrong with either file.
    """
    robot = robot_of(robot)
    return _load(_open(path, robot), robot, sigma_path)


def measurements_of(given: Measurements | str | Path, robot: Robot) -> Measurements:
    """The measurements, read if need be."""
    return load_measurements(given, robot) if isinstance(given, str | Path) else given


def commands_of(given: Measurements | str | Path, robot: Robot) -> Measurements:
    """The commands, read if need be."""
    return load_commands(given, robot) if isinstance(given, str | Path) else given


def _open(path: str | Path, robot: Robot) -> Columns:
    table = read_table(Path(path))
    return know_columns(table, robot.n_cables)


def _load(columns: Columns, robot: Robot, sigma_path: str | Path | None) -> Measurements:
    run = _runs(columns)
    t_s, temperature = _times(columns, run), _temperature(columns)
    lengths = command_lengths(columns, robot)
    pose = command_poses(columns, robot) if lengths is None else None
    position = columns.readings("meas", POSITION)
    quat, angles = measured_orientation(columns)
    cables = [str(i + 1) for i in range(robot.n_cables)]
    tensions = columns.readings("tension", cables)
    _note_silent_rows(columns, [position, quat, angles, tensions])
    return Measurements(
        path=columns.table.path,
        n_cables=robot.n_cables,
        run=run,
        t_s=t_s,
        command_pose=pose,
        command_lengths=lengths,
        position=position,
        quat_wxyz=quat,
        angles_rad=angles,
        tensions=tensions,
        temperature_C=temperature,
        sigma=_sigma_beside(columns.table.path, sigma_path),
        line=columns.table.line,
        unused_columns=columns.unused,
        notes=tuple(columns.notes),
    )


def _sigma_beside(path: Path, sigma_path: str | Path | None) -> Sigma:
    if sigma_path is not None:
        return load_sigma(sigma_path)
    beside = path.with_suffix(".toml")
    return load_sigma(beside) if beside.exists() else Sigma()


def _runs(columns: Columns) -> Names:
    if "run" not in columns.known:
        columns.notes.append('No column run: all rows count as one run called "all".')
        return np.full(columns.n_rows, "all")
    names = columns.table.cells[columns.known["run"].index]
    last_row: dict[str, int] = {}
    for row, name in enumerate(names):
        if not name:
            text = "expected the name of a run in every row, got an empty cell"
            raise columns.table.error(text, row=row, column="run")
        if last_row.get(name, row - 1) != row - 1:
            raise _run_came_back(columns, name, last_row[name], row)
        last_row[name] = row
    return np.array(names, dtype=np.str_)


def _run_came_back(columns: Columns, name: str, last: int, row: int) -> InputFileError:
    word = "line" if columns.table.header_line is not None else "row"
    text = (
        f"rows out of time order: run {show(name)} ended at {word} {columns.table.line[last]} and "
        "comes back here; expected the rows of a run together, in time order; sort the rows or "
        "rename the run"
    )
    return columns.table.error(text, row=row, column="run")


def _times(columns: Columns, run: Names) -> Array | None:
    if "t" not in columns.known:
        return None
    t_s = columns.numbers("t")
    falls = np.concatenate([[False], (np.diff(t_s) < 0) & (run[1:] == run[:-1])])
    columns.refuse(
        falls,
        "t",
        lambda row: (
            f"rows out of time order: expected {t_s[row - 1]:.9g} s or later within run "
            f"{show(str(run[row]))}, got {t_s[row]:.9g} s; sort the rows by time"
        ),
    )
    return t_s


def _temperature(columns: Columns) -> Array | None:
    if "temperature" not in columns.known:
        return None
    # It acts on the cables in every row, so a gap cannot be passed over like a lost reading.
    celsius = columns.numbers("temperature")
    columns.refuse(
        celsius < _ABSOLUTE_ZERO_C,
        "temperature",
        lambda row: f"expected a temperature above {_ABSOLUTE_ZERO_C} C, got {celsius[row]:g} C",
    )
    return celsius


def _note_silent_rows(columns: Columns, readings: list[Array | None]) -> None:
    given = [np.isfinite(values) for values in readings if values is not None]
    silent = int(np.sum(~np.any(np.concatenate(given, axis=1), axis=1)))
    if 0 < silent < columns.n_rows:
        rows = "1 row has" if silent == 1 else f"{silent} rows have"
        columns.notes.append(
            f"{rows} a command but no reading; kept as a place where the robot went."
        )


def load_sigma(path: str | Path) -> Sigma:
    """Read ``[sigma]`` of a TOML file.

    Raises:
        InputFileError: missing or broken TOML, an unknown key, a value that is no positive
            finite number.
    """
    toml = read_toml(Path(path), "expected a TOML file with a table [sigma]")
    _check_tables(toml)
    table = toml.content.get("sigma", {})
    if not isinstance(table, dict):
        raise toml.error("sigma must be a table, [sigma]", "sigma")
    return Sigma(**{key: _value(toml, key, value) for key, value in table.items()})


def _check_tables(toml: Toml) -> None:
    """Other tables are the user's own; a misspelt [sigma] must not be passed over."""
    for name in toml.content:
        if name in _SIGMAS:
            raise toml.error(f"{name} stands outside [sigma]; put it under that", name)
        if name != "sigma" and difflib.get_close_matches(name.lower(), ["sigma"], cutoff=0.7):
            raise toml.error(f"unknown table [{name}]; expected [sigma]", name)


def _value(toml: Toml, key: str, value: object) -> float:
    if key not in _SIGMAS:
        # Nearest first, so that the likely one is read first.
        likeness = {k: difflib.SequenceMatcher(None, key, k).ratio() for k in _SIGMAS}
        known = ", ".join(sorted(_SIGMAS, key=lambda k: -likeness[k]))
        raise toml.error(f"unknown key {key} in [sigma]; known are {known}", key)
    number = float(value) if isinstance(value, int | float) and value is not True else 0.0
    if not (math.isfinite(number) and number > 0):
        unit = key.rpartition("_")[2]
        text = f"{key} must be a positive number [{unit}], got {value!r}"
        raise toml.error(f"{text}; leave it out if it is not known", key)
    return number
