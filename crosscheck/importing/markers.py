"""A rigid body from three or more markers, frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crosscheck.importing.logged import Logged, Stream
from seecr.columns.csv import read_table
from seecr.counted import counted
from seecr.errors import InputFileError
from seecr.pose import Array
from seecr.units import of_columns

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
