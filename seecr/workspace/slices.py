"""How a map is cut into slices and where its colours end: the same in pictures and recordings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array
from seecr.workspace.grid import Workspace

__all__ = ["across_of", "colour_end", "evenly_picked"]

# Smaller motions [mm, deg] count as zero: colours up to there would show rounding.
_STILL = 1e-6


def across_of(found: Workspace) -> int:
    """The axis that slices are normal to: the last one, or the one with a single value."""
    lengths = [len(axis) for axis in found.axes]
    return 2 if min(lengths) > 1 else int(np.argmin(lengths))


def evenly_picked(count: int, most: int) -> NDArray[np.intp]:
    """At most so many of the numbers from 0 to count - 1, evenly spread, with both ends."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def colour_end(found: Workspace, values: Array) -> float:
    """Upper end of the colours of a deviation (nx, ny, nz), from poses that can be held.

    Poses outside the workspace fall a hundred times as far, and would make all others one colour.
    """
    for some in (values[found.feasible], values):
        known = some[np.isfinite(some)]
        if len(known) and (top := float(np.quantile(known, 0.95))) > _STILL:
            return top
    return 1.0
