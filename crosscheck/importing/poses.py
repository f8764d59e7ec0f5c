"""Plain logs of poses: one header row, a column of times, positions, and orientations or none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.importing.logged import Logged
from crosscheck.importing.rows import unit_quaternions
from crosscheck.measurements.sentinels import is_nines
from seecr.columns.commands import began, times_of_day
from seecr.columns.csv import Table, read_table, show
from seecr.counted import counted, some
from seecr.errors import InputError
from seecr.pose import Array
from seecr.units import UNITS, Unit, of_columns

_TIMES = re.compile(r"(t|time|timestamp)(?:_(\w+)|\s*\[(\w+)\])?", re.IGNORECASE)
# A number of nines in so many rows stands for "not seen".
_ROWS = 4
_LABEL = re.compile(
    r"(?:(?:meas|pose|pos|position)[_ ])?(q[wxyz]|r[xyz]|t?[xyz])"
    r"(?:_(\w+)|\s*\[(\w+)\]|\s*\((\w+)\))?",
    re.IGNORECASE,
)


def read_poses(path: Path, unit: str | None = None) -> Logged:
    """Read a log with columns t, x, y, z and qw, qx, qy, qz or rx, ry, rz with their units.

    Args:
        path: the file; names may have our prefix ``meas_``, and units as ours, ``x_mm`` or
            ``x [mm]``. R = Rx(rx) Ry(ry) Rz(rz), as for all our columns.
        unit: of lengths, if the names have none.

    Raises:
        InputFileError: no table, no times, no positions, an unknown unit, or decreasing times.
        InputError: ``unit`` is unknown, or the names already have units.
    """
    lengths = of_columns("m")
    if unit is not None and unit not in lengths:
        raise InputError(f"--unit: expected one of {', '.join(lengths)}, got {unit!r}")
    table = read_table(path)
    found = _columns(table)
    t_s, first = _times(table)
    lacking = [axis for axis in "xyz" if axis not in found]
    if lacking:
        raise table.error(
            f"expected columns of a pose such as x_mm y_mm z_mm, got no {', '.join(lacking)} among "
            f"{some(table.names, 8)}; rename them"
        )
    if unit is not None and all(found[axis][1] for axis in "xyz"):
        raise InputError(f"--unit {unit}: the columns of {path.name} state their own; leave it out")
    _refuse_nines(table, [found[axis][0] for axis in "xyz"])
    position = np.stack([_length(table, *found[axis], unit) for axis in "xyz"], axis=1)
    bodies = {path.stem: (position, _turns(table, found))}
    return Logged(path, t_s, table.line, bodies, {}, notes=_unread(table, found), began=first)


def _refuse_nines(table: Table, columns: Sequence[int]) -> None:
    """Refuse what programs write where nothing is seen: the same nines in all three coordinates."""
    given = np.stack([table.numbers(column, blank_is_nan=True) for column in columns], axis=1)
    alike = (given == given[:, :1]).all(axis=1)
    rows = [int(row) for row in np.flatnonzero(alike) if is_nines(float(given[row, 0]))]
    if len(rows) >= _ROWS:
        text = (
            f"expected a position, got {given[rows[0], 0]:.10g} for all of it, as in "
            f"{counted(len(rows), 'row')}; leave the cells empty where the body was not seen"
        )
        raise table.error(text, row=rows[0], column=table.names[columns[0]])


def _unread(table: Table, found: Mapping[str, tuple[int, str]]) -> tuple[str, ...]:
    """A note on columns that are not read, if there are any."""
    read = {table.names[column] for column, _unit in found.values()}
    names = [name for name in table.names if name.strip()]
    others = [name for name in names if name not in read and not _TIMES.fullmatch(name)]
    if not others:
        return ()
    turned = (
        ""
        if any(name[0] in "qr" for name in found)
        else ("; rotations are read from qw qx qy qz or rx_deg ry_deg rz_deg")
    )
    return (f"columns not read: {some(others, 6)}{turned}",)


def _columns(table: Table) -> dict[str, tuple[int, str]]:
    """For each quantity, the column and the unit in its name."""
    out: dict[str, tuple[int, str]] = {}
    for c, name in enumerate(table.names):
        match = _LABEL.fullmatch(name)
        if match:
            quantity = match.group(1).lower().removeprefix("t")
            if quantity in out:
                first = table.names[out[quantity][0]]
                text = f"expected one column for {quantity}, got {first} and {name}; rename one"
                raise table.error(text)
            out[quantity] = (c, match.group(2) or match.group(3) or match.group(4) or "")
    return out


def _times(table: Table) -> tuple[Array, datetime | None]:
    if len(table.names) == 1:
        text = "expected a row of names, and cells separated by commas, semicolons or tabs"
        raise table.error(f"{text}, got {show(table.names[0])}; export it like this")
    found = [(c, m) for c, name in enumerate(table.names) if (m := _TIMES.fullmatch(name))]
    if len(found) != 1:
        got = ", ".join(table.names[c] for c, _m in found)
        todo = f"got {got}; rename the others" if got else "got none; add or rename it"
        raise table.error(f"expected one column of times such as t_s, {todo}")
    column, match = found[0]
    first = began(table, column)
    if first is None:
        unit = _unit(table, column, "s", match.group(2) or match.group(3) or "s")
        t_s = unit.to_si(table.numbers(column, blank_is_nan=False))
    else:
        t_s = times_of_day(table, column)
    falls = np.flatnonzero(np.diff(t_s) <= 0.0)
    if len(falls):
        k = int(falls[0]) + 1
        text = (
            f"expected times that increase after {t_s[k - 1]:.9g} s, got {t_s[k]:.9g} s; are two "
            "recordings in one file? Import them one at a time"
        )
        raise table.error(text, row=k, column=table.names[column])
    return t_s, first


def _unit(table: Table, column: int, si: str, suffix: str) -> Unit:
    known = {unit.suffix: unit for unit in UNITS if unit.si == si}
    if suffix not in known:
        got, todo = (repr(suffix), "convert it") if suffix else ("none", "add it")
        text = f"expected a unit in the name of column {table.names[column]} ({', '.join(known)})"
        more = " or --unit" if si == "m" else ""
        raise table.error(f"{text}, got {got}; {todo}{more}", column=table.names[column])
    return known[suffix]


def _length(table: Table, column: int, suffix: str, unit: str | None) -> Array:
    found = _unit(table, column, "m", suffix or unit or "")
    return found.to_si(table.numbers(column, blank_is_nan=True))


def _turns(table: Table, found: dict[str, tuple[int, str]]) -> Array | None:
    quat, angles = ("qw", "qx", "qy", "qz"), ("rx", "ry", "rz")
    for names in (quat, angles):
        lacking = [name for name in names if name not in found]
        if 0 < len(lacking) < len(names):
            text = f"expected all of {', '.join(names)} or none, got no {', '.join(lacking)}"
            raise table.error(text)
    if "qw" in found:
        values = np.stack([table.numbers(found[n][0], blank_is_nan=True) for n in quat], axis=1)
        return unit_quaternions(values, lambda text, row: table.error(text, row=row, column="qw"))
    if "rx" not in found:
        return None
    units = of_columns("rad")
    columns = []
    for name in angles:
        column, suffix = found[name]
        known = _unit(table, column, "rad", suffix) if suffix not in units else units[suffix]
        columns.append(known.to_si(table.numbers(column, blank_is_nan=True)))
    values = np.stack(columns, axis=1)
    out = np.full((len(values), 4), np.nan)
    seen = np.isfinite(values).all(axis=1)
    out[seen] = Rotation.from_euler("XYZ", values[seen]).as_quat(scalar_first=True)
    return out
