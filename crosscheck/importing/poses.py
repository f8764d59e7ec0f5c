"""Plain logs of poses, and bodies from three or more markers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crosscheck.importing.logs import Logged, Stream, unit_quaternions
from crosscheck.measurements.plausible import is_nines
from seecr.columns.commands import began, times_of_day
from seecr.columns.csv import Table, read_table, show
from seecr.columns.headers import foreign
from seecr.counted import counted, some
from seecr.errors import InputError, InputFileError
from seecr.pose import Array, quat_from_rxyz
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
    names = foreign(table)
    found = _columns(table, names)
    t_s, first = _times(table, names)
    lacking = [axis for axis in "xyz" if axis not in found]
    if lacking:
        raise table.error(
            f"expected columns of a pose such as x_mm y_mm z_mm, got no {', '.join(lacking)} among "
            f"{some(table.names, 8)}; rename them, or say --columns THEIRS=meas_x_mm,..."
        )
    if unit is not None and all(found[axis][1] for axis in "xyz"):
        raise InputError(f"--unit {unit}: the columns of {path.name} state their own; leave it out")
    _refuse_nines(table, [found[axis][0] for axis in "xyz"])
    position = np.stack([_length(table, *found[axis], unit) for axis in "xyz"], axis=1)
    bodies = {path.stem: (position, _turns(table, found))}
    return Logged(
        path, t_s, table.line, bodies, {}, notes=_unread(table, names, found), began=first
    )


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


def _unread(
    table: Table, names: Sequence[str], found: Mapping[str, tuple[int, str]]
) -> tuple[str, ...]:
    """A note on columns that are not read, if there are any."""
    read = {column for column, _unit in found.values()}
    others = [
        name
        for c, name in enumerate(table.names)
        if name and c not in read and not _TIMES.fullmatch(names[c])
    ]
    if not others:
        return ()
    turned = any(name[0] in "qr" for name in found)
    hint = "" if turned else "; rotations are read from qw qx qy qz or rx_deg ry_deg rz_deg"
    return (f"columns not read: {some(others, 6)}{hint}",)


def _columns(table: Table, names: Sequence[str]) -> dict[str, tuple[int, str]]:
    """For each quantity, the column and the unit in its name, as the user calls it."""
    out: dict[str, tuple[int, str]] = {}
    for c, name in enumerate(names):
        match = _LABEL.fullmatch(name)
        if match:
            quantity = match.group(1).lower().removeprefix("t")
            if quantity in out:
                first = table.names[out[quantity][0]]
                text = f"expected one column for {quantity}, got {first} and {name}; rename one"
                raise table.error(text)
            out[quantity] = (c, match.group(2) or match.group(3) or match.group(4) or "")
    return out


def _times(table: Table, names: Sequence[str]) -> tuple[Array, datetime | None]:
    if len(table.names) == 1:
        text = "expected a row of names, and cells separated by commas, semicolons or tabs"
        raise table.error(f"{text}, got {show(table.names[0])}; export it like this")
    found = [(c, m) for c, name in enumerate(names) if (m := _TIMES.fullmatch(name))]
    if len(found) != 1:
        got = ", ".join(table.names[c] for c, _m in found)
        todo = (
            f"got {got}; rename the others"
            if got
            else "got none; add or rename it, or say --columns THEIRS=t_s"
        )
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
    columns = []
    for name in angles:
        column, suffix = found[name]
        unit = _unit(table, column, "rad", suffix)
        columns.append(unit.to_si(table.numbers(column, blank_is_nan=True)))
    return quat_from_rxyz(np.stack(columns, axis=1))


# A rigid body from three or more markers, frame by frame.

# Points whose width is less than this part of their length do not determine a rotation.
THIN = 0.02
# Frames that fit worse than so many times the usual misfit, or part of the size, count as lost.
_SWAPPED, _BENT = 10.0, 0.05


def body_of_markers(
    export: Logged, names: list[str], shape: Array | None = None
) -> tuple[Stream, str]:
    """The body that carries markers.

    Args:
        export: holds them.
        names: of the markers, three or more.
        shape: (k, 3) [m] their positions in the body's frame; by default those of the first frame
            in which all are seen, relative to their mean.

    Returns:
        the body and a sentence on how well it fits.

    Raises:
        InputFileError: too few markers, markers in one line, or without constant distances.
    """
    points = np.stack([export.marker(name) for name in names], axis=1)
    seen = np.asarray(np.isfinite(points).all(axis=2))
    whole = np.flatnonzero(seen.all(axis=1))
    if len(names) < 3 or len(whole) == 0:
        got = counted(len(names), "name") if len(names) < 3 else "no frame in which all are seen"
        text = f"expected three markers or more that are seen at once, got {got}; name others"
        raise InputFileError.at(export.path, text)
    if shape is None:
        shape = points[whole[0]] - points[whole[0]].mean(axis=0)
    across = np.linalg.svd(shape - shape.mean(axis=0), compute_uv=False)
    if across[1] < THIN * across[0]:
        raise InputFileError.at(
            export.path,
            f"the markers {', '.join(names)} lie on one line, so the rotation about it is not "
            "seen; expected three that do not; name another",
        )
    position, quat, misfit = _fitted(points, seen, shape)
    usual = float(np.nanmedian(misfit))
    if usual > _BENT * across[0]:
        raise InputFileError.at(
            export.path,
            f"the markers {', '.join(names)} do not keep their distances: a rigid body only fits "
            f"to {1e3 * usual:.3g} mm; expected markers of one body; name others",
        )
    swapped = misfit > max(_SWAPPED * usual, 1e-9)
    position[swapped], quat[swapped] = np.nan, np.nan
    lost = int(np.isnan(position[:, 0]).sum())
    said = f"rigid body of {', '.join(names)}, which fit to {1e3 * usual:.2g} mm"
    said += f"; {lost} of {counted(len(points), 'frame')} lost" if lost else ""
    return Stream(export.path, export.t_s, export.line, position, quat), said


def _fitted(points: Array, seen: NDArray[np.bool_], shape: Array) -> tuple[Array, Array, Array]:
    """Origin (n, 3), quaternion (n, 4) and rms misfit (n,) [m]; NaN with fewer than three."""
    n = len(points)
    position, quat = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
    misfit = np.full(n, np.nan)
    for which in np.unique(seen[seen.sum(axis=1) >= 3], axis=0):
        rows = np.flatnonzero((seen == which).all(axis=1))
        here, there = shape[which], points[np.ix_(rows, np.flatnonzero(which))]
        middle, centre = here.mean(axis=0), there.mean(axis=1)
        turn = aligning(here - middle, there - centre[:, None])
        position[rows] = centre - turn @ middle
        quat[rows] = Rotation.from_matrix(turn).as_quat(scalar_first=True)
        left = there - centre[:, None] - (here - middle) @ turn.transpose(0, 2, 1)
        misfit[rows] = np.sqrt(np.mean(np.sum(left**2, axis=2), axis=1))
    return position, quat, misfit


def aligning(here: Array, there: Array) -> Array:
    """Rotations (n, 3, 3) that bring points (k, 3) nearest to others (n, k, 3), both about 0.

    They are those of SciPy's ``align_vectors``, for all frames at once in a hundredth of the time
    (Kabsch 1976, with the sign of Umeyama 1991 against reflections).
    """
    u, _s, vt = np.linalg.svd(np.einsum("nki,kj->nij", there, here))
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    return np.asarray(u @ vt)


def read_shape(path: Path) -> dict[str, Array]:
    """Positions of markers on the platform: a CSV with the columns name, x_mm, y_mm, z_mm.

    Raises:
        InputFileError: there is no such table.
    """
    table = read_table(path)
    units = of_columns("m")
    axes = {}
    for c, name in enumerate(table.names):
        axis, _, suffix = name.partition("_")
        if axis in ("x", "y", "z") and suffix in units:
            axes[axis] = units[suffix].to_si(table.numbers(c, blank_is_nan=False))
    if "name" not in table.names or len(axes) < 3:
        expected = "expected the columns name, x_mm, y_mm, z_mm"
        raise table.error(f"{expected}, got {', '.join(table.names)}")
    names = table.cells[table.names.index("name")]
    places = np.stack([axes[axis] for axis in "xyz"], axis=1)
    return dict(zip(names, places, strict=True))
