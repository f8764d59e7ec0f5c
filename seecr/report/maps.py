"""The files of a workspace: its arrays, and its numbers in short."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seecr.counted import counted
from seecr.files import written
from seecr.maps import Workspace
from seecr.report.words import direction_words

__all__ = ["document_of", "likely_lines", "softest_line", "write_arrays"]


def likely_lines(found: Workspace, at_least: float | None) -> Iterator[str]:
    """How much of the grid can be held with a probability of at least that."""
    if at_least is not None:
        poses = int(found.likely(at_least).sum())
        yield (
            f"with a probability of {at_least:g} or more {counted(poses, 'pose')} can be held"
            f"{found.size_words(poses)}"
        )


def softest_line(found: Workspace) -> Iterator[str]:
    """Where the elastic robot is softest of all poses that can be held, and in which direction."""
    at = _softest(found)
    if at is not None:
        place = " ".join(f"{1e3 * axis[k]:.4g}" for axis, k in zip(found.axes, at, strict=True))
        way = direction_words(found.robot, found.softest[at])
        yield f"softest of them at x y z {place} mm: {way}, {found.stiffness[at]:.4g} N/m"


def _softest(found: Workspace) -> tuple[np.intp, ...] | None:
    stiffness = np.where(found.feasible & found.rests, found.stiffness, np.nan)
    if not np.isfinite(stiffness).any():
        return None
    return np.unravel_index(np.nanargmin(stiffness), stiffness.shape)


def document_of(found: Workspace, at_least: float | None = None) -> dict[str, Any]:
    """``map.json``: how much of the grid can be held, and the worst of the elastic robot there.

    Args:
        found: the map.
        at_least: a probability with which poses are to be held, of a map that has them.
    """
    likely = None
    if at_least is not None:
        poses = int(found.likely(at_least).sum())
        likely = {"at_least": at_least, "poses": poses, "size": poses * found.cell}
    where = found.rests & found.feasible
    worst = {
        "deviation_m": np.linalg.norm(found.deviation[where], axis=-1),
        "rotation_rad": np.linalg.norm(found.rotation[where], axis=-1),
    }
    counts, at = found.slack[found.rests], _softest(found)
    softest = at and {
        "pose_m": [float(axis[k]) for axis, k in zip(found.axes, at, strict=True)],
        "smallest_eigenvalue_N_per_m": float(found.stiffness[at]),
        "direction": found.softest[at].tolist(),
    }
    return {
        "robot": found.robot.name,
        "shape": found.margin.shape,
        "orientation": found.orientation,
        "poses": found.margin.size,
        "feasible": int(found.feasible.sum()),
        "cell": found.cell,
        "size_feasible": float(found.feasible.sum() * found.cell),
        "likely": likely,
        "rests": int(found.rests.sum()),
        "slack": {str(k): int(np.sum(counts == k)) for k in np.unique(counts)},
        "worst_where_feasible": {
            name: float(values.max()) if len(values) else None for name, values in worst.items()
        },
        "softest_where_feasible": softest,
    }


def write_arrays(path: Path, found: Workspace) -> None:
    """``map.npz``: axes, and everything that holds at the poses, (nx, ny, nz) each."""
    x, y, z = found.axes
    with written(path) as (part,), part.open("wb") as file:
        likely: dict[str, Any] = {}
        if found.chance is not None:
            likely["probability"] = found.chance
        np.savez_compressed(
            file, **likely, x_m=x, y_m=y, z_m=z, orientation=found.orientation,
            margin_N=found.margin,
            feasible=found.feasible, deviation_m=found.deviation, rotation_rad=found.rotation,
            slack=found.slack, smallest_eigenvalue_N_per_m=found.stiffness,
            softest_direction=found.softest,
        )  # fmt: skip
