"""Read measurements of a robot: a CSV (or Parquet) with the robot's commands and readings.

The format is the contract's; everything that is wrong with a file is said in one sentence with
file, line and column. Units are SI from here on.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.errors import InputFileError
from crosscheck.measurements.columns import ANGLES, POSITION, QUATERNION, near_misses, parse_header
from crosscheck.measurements.commands import command_lengths, command_pose
from crosscheck.measurements.data import Measurements, Names, write_measurements
from crosscheck.measurements.sigma import Sigma, load_sigma
from crosscheck.measurements.source import Source
from crosscheck.measurements.table import read_table, show
from seecr.pose import Array, quat_from_rxyz

if TYPE_CHECKING:
    from seecr.robot import Robot

__all__ = [
    "Measurements",
    "Sigma",
    "load_commands",
    "load_measurements",
    "load_sigma",
    "write_measurements",
]

_ABSOLUTE_ZERO_C = -273.15


def load_measurements(
    path: str | Path, robot: Robot, *, sigma_path: str | Path | None = None
) -> Measurements:
    """Read measurements, and the noise from the TOML beside them where there is one.

    Args:
        path: CSV or Parquet.
        robot: whose measurements these are (number of cables, joints, reference pose).
        sigma_path: the TOML, where it is not the data file's name with ``.toml``.

    Raises:
        InputFileError: anything wrong with either file.
    """
    source = _open(path, robot)
    data = _load(source, sigma_path)
    if not (data.has_position or data.has_orientation or data.has_tension):
        raise source.table.error(
            "no measurement; expected readings in at least one column such as meas_x_m, meas_qw "
            f"to meas_qz, meas_rx_rad or tension_1_N{near_misses(source.header)}"
        )
    return data


def load_commands(
    path: str | Path, robot: Robot, *, sigma_path: str | Path | None = None
) -> Measurements:
    """Like :func:`load_measurements`, for poses that nobody has measured yet."""
    return _load(_open(path, robot), sigma_path)


def _open(path: str | Path, robot: Robot) -> Source:
    table = read_table(Path(path))
    return Source(table, parse_header(table, robot.n_cables), robot)


def _load(source: Source, sigma_path: str | Path | None) -> Measurements:
    run = _runs(source)
    t_s, temperature = _times(source, run), _temperature(source)
    lengths = command_lengths(source)
    pose = command_pose(source) if lengths is None else None
    position = source.readings("meas", POSITION)
    quat, angles = _orientation(source)
    cables = [str(i + 1) for i in range(source.robot.n_cables)]
    tensions = source.readings("tension", cables)
    _note_silent_rows(source, [position, quat, angles, tensions])
    return Measurements(
        path=source.table.path,
        n_cables=source.robot.n_cables,
        run=run,
        t_s=t_s,
        command_pose=pose,
        command_lengths=lengths,
        position=position,
        quat_wxyz=quat,
        angles_rad=angles,
        tensions=tensions,
        temperature_C=temperature,
        sigma=_sigma_beside(source.table.path, sigma_path),
        line=source.table.line,
        unused_columns=source.header.unused,
        notes=(*source.header.notes, *source.notes),
    )


def _sigma_beside(path: Path, sigma_path: str | Path | None) -> Sigma:
    if sigma_path is not None:
        return load_sigma(sigma_path)
    beside = path.with_suffix(".toml")
    return load_sigma(beside) if beside.exists() else Sigma()


def _runs(source: Source) -> Names:
    if not source.has("run"):
        source.notes.append('No column run: all rows count as one run called "all".')
        return np.full(source.n_rows, "all")
    names = source.table.cells(source.header.columns["run"].index)
    last_row: dict[str, int] = {}
    for row, name in enumerate(names):
        if not name:
            text = "expected the name of a run in every row, got an empty cell"
            raise source.table.error(text, row=row, column="run")
        if last_row.get(name, row - 1) != row - 1:
            raise _run_came_back(source, name, last_row[name], row)
        last_row[name] = row
    return np.array(names, dtype=np.str_)


def _run_came_back(source: Source, name: str, last: int, row: int) -> InputFileError:
    word = "line" if source.table.header_line is not None else "row"
    text = (
        f"rows out of time order: run {show(name)} ended at {word} {source.table.line[last]} and "
        "comes back here; expected the rows of a run together, in time order; sort the rows or "
        "rename the run"
    )
    return source.table.error(text, row=row, column="run")


def _times(source: Source, run: Names) -> Array | None:
    if not source.has("t"):
        return None
    t_s = source.column("t")
    falls = np.concatenate([[False], (np.diff(t_s) < 0) & (run[1:] == run[:-1])])
    source.refuse(
        falls,
        "t",
        lambda row: (
            f"rows out of time order: expected {t_s[row - 1]:.9g} s or later within run "
            f"{show(str(run[row]))}, got {t_s[row]:.9g} s; sort the rows by time"
        ),
    )
    return t_s


def _temperature(source: Source) -> Array | None:
    if not source.has("temperature"):
        return None
    # It acts on the cables in every row, so a gap cannot be passed over like a lost reading.
    celsius = source.column("temperature")
    source.refuse(
        celsius < _ABSOLUTE_ZERO_C,
        "temperature",
        lambda row: f"expected a temperature above {_ABSOLUTE_ZERO_C} C, got {celsius[row]:g} C",
    )
    return celsius


def _orientation(source: Source) -> tuple[Array | None, Array]:
    """Quaternions (n, 4) or None, and angles (n, 3) [rad] where these are all there is."""
    angles = source.readings("meas", ANGLES)
    if source.header.present("meas", QUATERNION):
        quat = source.quaternions("meas", blank_is_nan=True)
        if np.all(np.isnan(quat)):
            source.notes.append("Columns meas_qw to meas_qz are empty: not measured.")
            return None, angles
        return quat, angles
    blank = np.isnan(angles)
    if np.all(blank) or np.any(blank != blank[:, :1]):
        return None, angles
    # Every row has all three angles or none, so nothing is lost by going to quaternions.
    return quat_from_rxyz(angles), np.full_like(angles, np.nan)


def _note_silent_rows(source: Source, readings: list[Array | None]) -> None:
    given = [np.isfinite(values) for values in readings if values is not None]
    silent = int(np.sum(~np.any(np.concatenate(given, axis=1), axis=1)))
    if 0 < silent < source.n_rows:
        rows = "1 row has" if silent == 1 else f"{silent} rows have"
        source.notes.append(
            f"{rows} a command but no reading; kept as a place where the robot went."
        )
