"""The functions of :mod:`seecr.pose` that fits call most, compiled, for rows (n, k).

They agree with those of that module to the last digits. Either argument may be one row for all;
rows of rows (..., k) are as good, if both have them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np

from seecr.pose import Array

__all__ = [
    "changes_between",
    "deviated",
    "moved_by",
    "products",
    "rotated",
    "rotation_vectors",
]


@cache
def _compiled() -> ModuleType:
    """Loaded when it is first used: effects, which use it, are listed without Numba."""
    from seecr.compiled import algebra

    return algebra


def products(a: Array, b: Array) -> Array:
    """Hamilton products (n, 4) of quaternions, scalar first; either may be one row (4,)."""
    return _filled(_compiled().multiply_rows, a, b, 4)


def rotated(quat_wxyz: Array, vectors: Array) -> Array:
    """Vectors (n, 3) turned by unit quaternions (n, 4); either may be one row."""
    return _filled(_compiled().rotate_rows, quat_wxyz, vectors, 3)


def rotation_vectors(quat_wxyz: Array) -> Array:
    """Rotation vectors (n, 3) [rad], of length at most pi, of unit quaternions (n, 4)."""
    quat = _rows(quat_wxyz)
    out = np.empty((len(quat), 3))
    _compiled().rotation_vector_rows(quat, out)
    return out.reshape(*np.shape(quat_wxyz)[:-1], 3)


def changes_between(poses_a: Array, poses_b: Array) -> Array:
    """Changes (n, 6) from poses b to poses a, as :func:`seecr.pose.pose_difference`."""
    return _filled(_compiled().difference_rows, poses_a, poses_b, 6)


def moved_by(poses: Array, changes: Array) -> Array:
    """Poses (n, 7) after changes (n, 6), as :func:`seecr.pose.pose_add`."""
    return _filled(_compiled().add_rows, poses, changes, 7)


def deviated(poses: Array, deviation: Array) -> Array:
    """Poses (n, 7) at displacements and rotations, as quaternions, (n, 7) from others."""
    return _filled(_compiled().deviate_rows, deviation, poses, 7)


def _filled(fill: Callable[[Array, Array, Array], None], a: Array, b: Array, width: int) -> Array:
    first, second = _rows(a), _rows(b)
    n, other = len(first), len(second)
    if n != other and 1 not in (n, other):
        raise ValueError(f"expected as many rows as {n}, or one, got {other}")
    rows = n if other == 1 else other
    longer = a if n == rows and np.ndim(a) >= np.ndim(b) else b
    out = np.empty((rows, width))
    fill(first, second, out)
    return out.reshape(*np.shape(longer)[:-1], width)


def _rows(values: Array) -> Array:
    """As compiled functions take them: contiguous and writable, so that there is one of each."""
    rows = np.ascontiguousarray(values, dtype=float)
    if not rows.flags.writeable:
        rows = rows.copy()
    return rows if rows.ndim == 2 else rows.reshape(-1, rows.shape[-1])
