"""Quaternions, rotation vectors and poses, row by row: what :mod:`seecr.pose` does with NumPy.

NumPy's calls take ten times as long as the numbers of a hundred rows. An array with one row is that
for all.
"""

from __future__ import annotations

import math

from seecr.compiled.jit import jit, jit_inner
from seecr.compiled.rotation import quaternion_product, rotated_less, turned

# Below this sine of half the angle the series of 2 asin(s)/s is exact to double precision.
_SMALL = 1e-4


@jit
def multiply_rows(a, b, out):
    """Hamilton products (n, 4)."""
    for r in range(len(out)):
        i, j = r % len(a), r % len(b)
        out[r, 0], out[r, 1], out[r, 2], out[r, 3] = quaternion_product(
            a[i, 0], a[i, 1], a[i, 2], a[i, 3], b[j, 0], b[j, 1], b[j, 2], b[j, 3]
        )


@jit
def rotate_rows(quat, vectors, out):
    """Vectors (n, 3) turned by unit quaternions."""
    for r in range(len(out)):
        i, j = r % len(quat), r % len(vectors)
        a, b, c = vectors[j, 0], vectors[j, 1], vectors[j, 2]
        x, y, z = rotated_less(quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3], a, b, c)
        out[r, 0], out[r, 1], out[r, 2] = a + x, b + y, c + z


@jit_inner
def _rotation_vector(w, x, y, z):
    """Of a unit quaternion, of length at most pi."""
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    per = 2.0 + sine * sine / 3.0 if sine < _SMALL else 2.0 * math.atan2(sine, w) / sine
    return per * x, per * y, per * z


@jit
def rotation_vector_rows(quat, out):
    """Rotation vectors (n, 3) of unit quaternions (n, 4)."""
    for r in range(len(out)):
        w, x, y, z = quat[r, 0], quat[r, 1], quat[r, 2], quat[r, 3]
        out[r, 0], out[r, 1], out[r, 2] = _rotation_vector(w, x, y, z)


@jit
def difference_rows(a, b, out):
    """Changes (n, 6) from poses ``b`` to poses ``a``."""
    for r in range(len(out)):
        i, j = r % len(a), r % len(b)
        for k in range(3):
            out[r, k] = a[i, k] - b[j, k]
        w, x, y, z = quaternion_product(
            a[i, 3], a[i, 4], a[i, 5], a[i, 6], b[j, 3], -b[j, 4], -b[j, 5], -b[j, 6]
        )
        out[r, 3], out[r, 4], out[r, 5] = _rotation_vector(w, x, y, z)


@jit
def add_rows(poses, changes, out):
    """Poses (n, 7) after changes (n, 6)."""
    for r in range(len(out)):
        i, j = r % len(poses), r % len(changes)
        for k in range(3):
            out[r, k] = poses[i, k] + changes[j, k]
        out[r, 3], out[r, 4], out[r, 5], out[r, 6] = turned(
            changes[j, 3], changes[j, 4], changes[j, 5],
            poses[i, 3], poses[i, 4], poses[i, 5], poses[i, 6],
        )  # fmt: skip


@jit
def deviate_rows(deviation, poses, out):
    """Poses (n, 7) that deviate from ``poses`` by displacements and quaternions (n, 7)."""
    for r in range(len(out)):
        i, j = r % len(deviation), r % len(poses)
        for k in range(3):
            out[r, k] = poses[j, k] + deviation[i, k]
        w, x, y, z = quaternion_product(
            deviation[i, 3], deviation[i, 4], deviation[i, 5], deviation[i, 6],
            poses[j, 3], poses[j, 4], poses[j, 5], poses[j, 6],
        )  # fmt: skip
        size = math.sqrt(w * w + x * x + y * y + z * z)
        out[r, 3], out[r, 4], out[r, 5], out[r, 6] = w / size, x / size, y / size, z / size
