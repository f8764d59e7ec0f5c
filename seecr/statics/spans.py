"""From exit points to anchor points at the poses of tables, and cables that have no way between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import ANCHOR, EXIT, RADIUS, UP
from seecr.pose import Array, quat_to_matrix
from seecr.statics.tables import Tables

# A distance below this part of the robot's length is none but for rounding.
_NONE = 1e-12


def ways(tables: Tables) -> Array:
    """(n, m, 3) [m] from exit points to anchor points, base frame."""
    turn = quat_to_matrix(tables.poses[:, 3:])
    anchors = tables.cables[..., ANCHOR : ANCHOR + 3] @ np.swapaxes(turn, 1, 2)
    return np.asarray(tables.poses[:, None, :3] + anchors - tables.cables[..., EXIT : EXIT + 3])


def spanless(tables: Tables) -> NDArray[np.bool_]:
    """(n, m) whether an anchor point is at its exit point, or within its pulley.

    No cable is free there: it has no direction in which it could pull.
    """
    way, radius = ways(tables), tables.cables[..., RADIUS]
    rise = (way * tables.load[:, None, UP : UP + 3]).sum(axis=2)
    far = (way**2).sum(axis=2)
    across = np.sqrt(np.maximum(far - rise**2, 0.0))
    # (across - radius)^2 + rise^2 <= radius^2, without its loss of digits
    return np.asarray(far <= 2.0 * radius * across + (_NONE * tables.length) ** 2)
