"""Plain logs of poses, and bodies from three or more markers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crosscheck.importing.logs import Logged, Stream, unit_quaternions
from crosscheck.measurements.plausible import is_nines
from seecr.columns.commands import began, times
from seecr.columns.csv import Table, read_table, show
from seecr.columns.headers import columns_said, renamed
from seecr.columns.known import (
    ANGLES,
    POSITION,
    QUATERNION,
    Columns,
    know_columns,
    other_rotations,
    unused_note,
)
from seecr.counted import counted, some
from seecr.errors import InputError, InputFileError
from seecr.pose import Array, quat_from_rxyz
from seecr.units import of_columns

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
        path: the file; its columns are those of measurements, whose prefix ``meas_`` may be missing
            or another word, and quaternions are taken before angles.
        unit: of lengths, if the names have none.

    Raises:
        InputFileError: no table, no times, no positions, an unknown unit, or decreasing times.
        InputError: ``unit`` is unknown, or the names already have units.
    """
    lengths = of_columns("m")
    if unit is not None and unit not in lengths:
        raise InputError(f"--unit: expected one of {', '.join(lengths)}, got {unit!r}")
    table = read_table(path)
    if len(table.names) == 1:
        text = "expected a row of names, and cells separated by commas, semicolons or tabs"
        raise table.error(f"{text}, got {show(table.names[0])}; export it like this")
    with renamed({**_ours(table, unit), **columns_said()}):
        columns = know_columns(table, 0)
    _check_parts(columns)
    turned = other_rotations(columns.unused)
    others = [name for name in columns.unused if name not in turned]
    columns.notes[:] = [*table.notes, *unused_note(others, turned)]
    position = columns.readings("meas", POSITION)
    _refuse_nines(columns, position)
    t_s = times(columns, np.arange(columns.n_rows).astype(str))  # their order is checked here
    assert t_s is not None
    stands = np.append(False, np.diff(t_s) <= 0.0)
    text = "expected times that increase after {:.9g} s, got {:.9g} s; are two recordings in one "
    columns.refuse(
        stands, "t",
        lambda k: f"{text.format(t_s[k - 1], t_s[k])}file? Import them one at a time",
    )  # fmt: skip
    bodies, first = {path.stem: (position, _turns(columns))}, columns.known["t"].index
    return Logged(
        path, t_s, table.line, bodies, {}, notes=tuple(columns.notes), began=began(table, first)
    )


def _ours(table: Table, unit: str | None) -> dict[str, str]:
    """The names of a log's columns with ours for measurements.

    Raises:
        InputError: ``unit`` is given though the names of positions have their own.
        InputFileError: neither has one.
    """
    found = dict[str, str]()
    for name in table.names:
        if match := _TIMES.fullmatch(name):
            found[name] = f"t_{match[2] or match[3] or 's'}"
        elif match := _LABEL.fullmatch(name):
            suffix = match[2] or match[3] or match[4] or ""
            part = match[1].lower().removeprefix("t")
            own = suffix or (unit if part in POSITION and unit else "")
            found[name] = f"meas_{part}_{own}" if own else f"meas_{part}"
            if part in POSITION and unit and suffix:
                text = f"--unit {unit}: the columns of {table.path.name} state their own"
                raise InputError(f"{text}; leave it out")
            if part in POSITION and not own and name not in columns_said():
                text = (
                    f"expected a unit in the name of column {name} ({', '.join(of_columns('m'))})"
                )
                raise table.error(f"{text}, got none; add it or --unit", column=name)
    turned = any(ours.startswith("meas_q") for ours in found.values())
    return {
        theirs: ours for theirs, ours in found.items() if not (turned and ours.startswith("meas_r"))
    }


def _check_parts(columns: Columns) -> None:
    """Refuse a log without times or positions, or with a part of an orientation."""
    table, present = columns.table, columns.present
    lacking = [axis for axis in POSITION if not present("meas", (axis,))]
    names, near = some(table.names, 8), columns.near_misses()
    if "t" not in columns.known or lacking:
        what = "times such as t_s" if "t" not in columns.known else "a pose such as x_mm y_mm z_mm"
        lost = f"no {', '.join(lacking)} among " if lacking and "t" in columns.known else ""
        raise table.error(
            f"expected columns of {what}, got {lost}{names}{near}; rename them, or say --columns "
            "THEIRS=meas_x_m,THEIRS=t_s,..."
        )
    for parts in (QUATERNION, ANGLES):
        given = present("meas", parts)
        if 0 < len(given) < len(parts):
            lost = ", ".join(part for part in parts if part not in given)
            raise table.error(f"expected all of {', '.join(parts)} or none, got no {lost}")


def _refuse_nines(columns: Columns, position: Array) -> None:
    """Refuse what programs write where nothing is seen: the same nines in all three coordinates."""
    table, column = columns.table, columns.known["meas_x"]
    given = position / column.unit.to_si(1.0)
    alike = np.ptp(given, axis=1) <= 1e-9 * np.abs(given[:, 0])
    rows = [int(row) for row in np.flatnonzero(alike) if is_nines(float(given[row, 0]))]
    if len(rows) >= _ROWS:
        text = (
            f"expected a position, got {given[rows[0], 0]:.10g} for all of it, as in "
            f"{counted(len(rows), 'row')}; leave the cells empty where the body was not seen"
        )
        raise table.error(text, row=rows[0], column=column.name)


def _turns(columns: Columns) -> Array | None:
    """Quaternions (n, 4); R = Rx(rx) Ry(ry) Rz(rz), as for all our columns."""
    if columns.present("meas", QUATERNION):
        return unit_quaternions(
            columns.readings("meas", QUATERNION),
            lambda text, row: columns.table.error(text, row=row, column="qw"),
        )
    if columns.present("meas", ANGLES):
        return quat_from_rxyz(columns.readings("meas", ANGLES))
    return None


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
