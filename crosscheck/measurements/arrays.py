"""Measurements from arrays and data frames, by what reads them from files.

Both make a table of columns, so that all checks and notes are those of a file; rows count from 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.data import GivenSigma, Measurements, Sigma
from crosscheck.measurements.read import stated, table_measurements
from seecr.arguments import numbers
from seecr.columns.csv import Table
from seecr.columns.headers import renamed
from seecr.errors import InputError, InputFileError

__all__ = ["Measurements", "from_arrays", "from_frame"]

_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


def from_arrays(
    robot: GivenRobot,
    *,
    commands: ArrayLike | None = None,
    lengths: ArrayLike | None = None,
    told: bool = False,
    positions: ArrayLike | None = None,
    quaternions: ArrayLike | None = None,
    tensions: ArrayLike | None = None,
    runs: Sequence[object] | None = None,
    times: ArrayLike | None = None,
    temperatures: ArrayLike | None = None,
    payloads: ArrayLike | None = None,
    sigma: GivenSigma = None,
) -> Measurements:
    """Measurements of n resting poses of a robot with m cables, as a file of them would be read.

    Args:
        robot: a robot, or its MJCF.
        commands: (n, 7) poses x y z qw qx qy qz, or positions (n, 3), turned as the reference pose.
        lengths: (n, m) [m] commanded rest lengths, in place of poses. told: whether they count from
            the reference pose, as the plain model does; else they are absolute.
        positions: (n, 3) [m]. quaternions: (n, 4), scalar first. tensions: (n, m) [N]. NaN is "not
            read".
        runs: (n,) names or numbers of runs, in time order. times: (n,) [s].
        temperatures: (n,) [deg C]. payloads: (n,) [kg].
        sigma: noise: metres, ``"0.1mm"`` or a :class:`crosscheck.Sigma`.

    Raises:
        InputError: with a line for each mistake, and its row, from 0, and column.

    Example:
        >>> import numpy as np
        >>> there = np.array([[0.3, 0.25, 0.1], [0.4, 0.25, 0.1]])
        >>> data = Measurements.from_arrays("demobot_parallel", commands=there, positions=there)
        >>> len(data)
        2
    """
    robot = robot_of(robot)
    cables = range(1, robot.n_cables + 1)
    given = [
        ("commands", commands, [f"cmd_{part}" for part in _POSE]),
        ("lengths", lengths, [f"length_{i}_m" for i in cables]),
        ("positions", positions, [f"meas_{part}" for part in _POSE[:3]]),
        ("quaternions", quaternions, [f"meas_{part}" for part in _POSE[3:]]),
        ("tensions", tensions, [f"tension_{i}_N" for i in cables]),
        ("times", times, ["t_s"]),
        ("temperatures", temperatures, ["temperature_C"]),
        ("payloads", payloads, ["payload_kg"]),
    ]
    columns: dict[str, Sequence[Any]] = {}
    if runs is not None:
        columns["run"] = list(runs)
    faults = []
    for name, values, names in given:
        if values is not None:
            try:
                columns |= _columns(name, values, names)
            except InputError as fault:
                faults.append(str(fault))
    sizes = {name: len(values) for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        faults.append(f"expected as many rows in all arrays, got {sizes}")
    if faults:
        raise InputError("\n".join(faults))
    data = _read(robot, columns, "arrays", sigma)
    return replace(data, told=told and data.command_lengths is not None)


def _columns(name: str, values: ArrayLike, names: list[str]) -> dict[str, Sequence[Any]]:
    array = numbers(values, name)
    array = array[:, None] if array.ndim == 1 and len(names) == 1 else np.atleast_2d(array)
    widths = (3, 7) if name == "commands" else (len(names),)
    if array.ndim != 2 or array.shape[1] not in widths:
        wanted = " or ".join(f"(n, {width})" for width in widths)
        raise InputError(f"{name}: expected {wanted}, got {np.shape(values)}")
    return {names[k]: array[:, k].tolist() for k in range(array.shape[1])}


def from_frame(
    robot: GivenRobot,
    frame: Any,
    *,
    columns: Mapping[str, str] | None = None,
    sigma: GivenSigma = None,
) -> Measurements:
    """Measurements of a data frame, of pandas, Polars or PyArrow, with the columns of a file.

    Args:
        robot: a robot, or its MJCF.
        frame: its columns are named as in a CSV; null and NaN are "not read".
        columns: foreign headers with ours, such as ``{"px": "meas_x_m"}``.
        sigma: noise: metres, ``"0.1mm"`` or a :class:`crosscheck.Sigma`.

    Raises:
        InputError: no data frame, or with a line for each mistake, its row, from 0, and column.
    """
    names = getattr(frame, "column_names", None) or getattr(frame, "columns", None)
    if names is None or not hasattr(frame, "__getitem__") or isinstance(frame, np.ndarray):
        raise InputError(
            "expected a data frame of pandas, Polars or PyArrow, or a mapping of columns, got "
            f"{type(frame).__name__}; arrays go into Measurements.from_arrays"
        )
    listed = [(str(name), frame[name]) for name in names]
    values = {name: _values(column) for name, column in listed}
    if len(values) < len(listed):
        raise InputError("expected each column once, got two of a name; rename one")
    with renamed(columns):
        return _read(robot_of(robot), values, "frame", sigma)


def _values(column: Any) -> list[Any]:
    """The values of a column: PyArrow and Polars have them as lists, pandas and NumPy too."""
    for name in ("to_pylist", "to_list", "tolist"):
        if hasattr(column, name):
            return list(getattr(column, name)())
    return list(column)


def _read(
    robot: Any, columns: Mapping[str, Iterable[Any]], name: str, sigma: GivenSigma
) -> Measurements:
    cells = [[_text(value) for value in column] for column in columns.values()]
    n = len(cells[0]) if cells else 0
    if n == 0:
        raise InputError(f"{name}: expected one row per resting pose, got none")
    table = Table(Path(name), tuple(columns), np.arange(n), None, cells)
    try:
        return stated(table_measurements(table, robot), Sigma.of(sigma))
    except InputFileError as error:
        raise InputError(str(error)) from None


def _text(value: Any) -> str:
    """A value as the cell of a file."""
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return value.isoformat() if isinstance(value, date) else str(value).strip()


Measurements.from_arrays = staticmethod(from_arrays)
Measurements.from_frame = staticmethod(from_frame)
