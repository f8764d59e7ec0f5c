"""Sentences about a workspace, and the file of its arrays."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from seecr.counted import counted
from seecr.files import written
from seecr.pose import Array
from seecr.prediction.model import DataReach
from seecr.report.words import SAGS, direction_words
from seecr.units import millimetres, significant
from seecr.workspace.grid import STATUSES, Workspace

__all__ = [
    "beyond_line", "edge_line", "likely_lines", "sag_lines_of", "softest_line", "write_arrays",
]  # fmt: skip

# An array is compressed if that saves more than a third of this many values around its middle.
_SAMPLE, _WORTH = 16384, 0.67


def likely_lines(found: Workspace, at_least: float | None) -> Iterator[str]:
    """How much of the grid can be held with at least a given probability."""
    if at_least is not None:
        likely = found.likely(at_least)
        size = found.size_words(likely)
        yield (
            f"with a probability of {at_least:g} or more {counted(int(likely.sum()), 'pose')} can "
            f"be held{f', {size}' if size else ''}"
        )


def beyond_line(found: Workspace, reach: DataReach | None) -> Iterator[str]:
    """How much of the workspace is far from the data that the model was fitted to."""
    if reach is None:
        return
    places = found.places[found.feasible]
    away = reach.outside(places, found.robot.length)
    if np.any(away > 0.0):
        yield (
            "beyond the data that the model was fitted to: "
            f"{counted(int(np.sum(away > 0.0)), 'pose')} of those that can be held "
            f"{'is' if np.sum(away > 0.0) == 1 else 'are'} "
            f"up to {millimetres(away.max(), 3)} outside"
        )


def softest_line(found: Workspace) -> Iterator[str]:
    """The softest pose of those that can be held, and the direction in which it is soft."""
    at = found.softest_at
    if at is not None:
        direction = direction_words(found.robot, found.softest[at])
        soft = significant(found.stiffness[at], 4)
        yield f"softest of these at {found.place(at)}: {direction}, {soft} N/m"


def sag_lines_of(found: Workspace, effects: Collection[str]) -> Iterator[str]:
    """What "slack" means on an elastic map of a model with these effects, if cables have weight."""
    if found.elastic and "cable_weight" in effects:
        yield SAGS


def edge_line(
    found: Workspace, edge: Array, tolerance: float, at_least: float | None = None
) -> str:
    """The number of poses on the edge, and how accurately they are known; or why there is none.

    Args:
        found: the workspace.
        edge: (k, 7) poses.
        tolerance: [m].
        at_least: the probability to which that edge belongs, if any.
    """
    if len(edge) == 0 and at_least is not None:
        every = bool(found.likely(at_least).all())
        which = "all poses of the grid are" if every else "no pose of the grid is"
        return f"no edge was found: {which} held with that probability"
    if len(edge) == 0:
        return "no edge was found: all poses of the grid can be held"
    return f"edge, to within {tolerance:g} m: {counted(len(edge), 'point')}"


def write_arrays(path: Path, found: Workspace, edge: Array | None = None) -> None:
    """``map.npz``: axes, results at the poses, (nx, ny, nz) each, and the edge's poses (k, 7).

    Of a grid with directions of its own the axes are ``u_m``, ``v_m`` and ``w_m``, and positions
    are ``u, v, w @ directions``.

    With an elastic map ``status_names[status]`` says at which poses it has an answer, or why not.
    """
    axes = {f"{name}_m": axis for name, axis in zip(found.axis_names, found.axes, strict=True)}
    with written(path) as (part,), part.open("wb") as file:
        more: dict[str, ArrayLike] = {}
        if found.chance is not None:
            more["probability"] = found.chance
        if edge is not None:
            more["edge"] = edge
        if found.status is not None:
            more["status"] = found.status
            more["status_names"] = [one.name.lower() for one in STATUSES]
        if found.directions is not None:
            more["directions"] = found.directions
        _write_npz(
            file, **more, **axes, orientation=found.orientation,
            margin_N=found.margin,
            feasible=found.feasible, deviation_m=found.deviation, rotation_rad=found.rotation,
            slack=found.slack, smallest_eigenvalue_N_per_m=found.stiffness,
            softest_direction=found.softest,
        )  # fmt: skip


def _write_npz(file: BinaryIO, **arrays: ArrayLike) -> None:
    """What :func:`numpy.load` reads, compressed where that saves much.

    Hardly any digits of a deviation can be saved, and trying took as long as a million margins.
    """
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            array = np.ascontiguousarray(values)
            middle = array.size // 2
            some = array.ravel()[max(0, middle - _SAMPLE) : middle + _SAMPLE].tobytes()
            saves = len(zlib.compress(some, 1)) < _WORTH * len(some)
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED if saves else zipfile.ZIP_STORED
            with archive.open(entry, "w", force_zip64=True) as part:
                np.lib.format.write_array(part, array, allow_pickle=False)
