"""The files of a workspace: its arrays, and its numbers in short."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from seecr.files import written
from seecr.maps import Workspace

__all__ = ["document_of", "write_arrays"]


def document_of(found: Workspace) -> dict[str, Any]:
    """``map.json``: how much of the grid can be held, and the worst of the elastic robot there."""
    where = found.rests & found.feasible
    worst = {
        "deviation_m": np.linalg.norm(found.deviation[where], axis=-1),
        "rotation_rad": np.linalg.norm(found.rotation[where], axis=-1),
    }
    counts = found.slack[found.rests]
    return {
        "robot": found.robot.name,
        "shape": found.margin.shape,
        "orientation": found.orientation,
        "poses": found.margin.size,
        "feasible": int(found.feasible.sum()),
        "cell": found.cell,
        "size_feasible": float(found.feasible.sum() * found.cell),
        "rests": int(found.rests.sum()),
        "slack": {str(k): int(np.sum(counts == k)) for k in np.unique(counts)},
        "worst_where_feasible": {
            name: float(values.max()) if len(values) else None for name, values in worst.items()
        },
    }


def write_arrays(path: Path, found: Workspace) -> None:
    """``map.npz``: axes, and everything that holds at the poses, (nx, ny, nz) each."""
    x, y, z = found.axes
    with written(path) as (part,), part.open("wb") as file:
        np.savez_compressed(
            file, x_m=x, y_m=y, z_m=z, orientation=found.orientation, margin_N=found.margin,
            feasible=found.feasible, deviation_m=found.deviation, rotation_rad=found.rotation,
            slack=found.slack, smallest_eigenvalue_N_per_m=found.stiffness,
        )  # fmt: skip
