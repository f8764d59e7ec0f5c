"""Poses and rotations as plain arrays; leading axes are batch axes.

A pose is ``(..., 7)``: position x y z [m] in the base frame, then a unit quaternion, scalar
first, that takes platform coordinates to base coordinates (``quat_wxyz`` of
``R_world_platform``). A small change of a pose is ``(..., 6)``: translation [m], then rotation
vector [rad], both in the base frame, with rotations multiplied from the left:
``R_new = exp(rotvec) R_old``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LARGEST = 1e30
"""Largest number accepted: squares of larger ones overflow, and no measured value is so large."""

SMALLEST = 1.0 / LARGEST
"""Shortest length accepted [m]: strains of shorter cables would be larger than that."""

NORM_TOLERANCE = 1e-3
"""How far a unit quaternion's norm may be from one: six digits leave 1e-6, more is wrong."""

# Below this angle the series of sin(x)/x is exact to double precision.
_SMALL_ANGLE = 1e-4


def all_finite(values: ArrayLike) -> bool:
    """Whether all are finite numbers, and none is beyond :data:`LARGEST`."""
    return bool(np.all(np.abs(np.asarray(values, float)) <= LARGEST))


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product a b of quaternions (..., 4), scalar first."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    # component by component, which takes half the time of vector operations
    product = [
        aw * bw - (ax * bx + ay * by + az * bz),
        aw * bx + bw * ax + (ay * bz - az * by),
        aw * by + bw * ay + (az * bx - ax * bz),
        aw * bz + bw * az + (ax * by - ay * bx),
    ]
    return _stacked(product)


def _stacked(components: Sequence[Array]) -> Array:
    """Components (...) as vectors (..., k); NumPy's own takes twice as long on small arrays."""
    out = np.empty((*np.shape(components[0]), len(components)))
    for k, component in enumerate(components):
        out[..., k] = component
    return out


def _norm(vectors: Array) -> Array:
    """Lengths (..., 1) of vectors (..., k), to the last bit NumPy's, which looks at more cases."""
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1, keepdims=True)))


def quat_conjugate(quat_wxyz: Array) -> Array:
    """Inverse rotation of unit quaternions (..., 4)."""
    return np.asarray(np.asarray(quat_wxyz, float) * np.array([1.0, -1.0, -1.0, -1.0]))


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors (..., 3); NumPy's own takes twice as long on small arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return _stacked([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def quat_rotate(quat_wxyz: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by unit quaternions (..., 4)."""
    q, v = np.asarray(quat_wxyz, float), np.asarray(vectors, float)
    twice = 2.0 * cross(q[..., 1:], v)
    return v + q[..., :1] * twice + cross(q[..., 1:], twice)


def quat_to_matrix(quat_wxyz: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(quat_wxyz, float)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quat_from_rotvec(rotvec: Array) -> Array:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) [rad], exact also near zero."""
    v = np.asarray(rotvec, float)
    angle = _norm(v)
    # np.sinc(x) = sin(pi x)/(pi x): gives sin(angle/2)/angle without a division by zero.
    half = 0.5 * np.sinc(angle / (2.0 * np.pi))
    return np.concatenate([np.cos(angle / 2.0), half * v], axis=-1)


def rotvec_from_quat(quat_wxyz: Array) -> Array:
    """Rotation vectors (..., 3) [rad], of length at most pi, of unit quaternions (..., 4)."""
    q = np.asarray(quat_wxyz, float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = _norm(q[..., 1:])
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    safe = np.where(sine < _SMALL_ANGLE, 1.0, sine)
    # Series of 2 asin(s)/s about zero; the next term is below 1e-17 here.
    factor = np.where(sine < _SMALL_ANGLE, 2.0 + sine**2 / 3.0, angle / safe)
    return np.asarray(factor * q[..., 1:])


def quat_from_rxyz(angles_rad: Array) -> Array:
    """Unit quaternions of angles (..., 3) [rad] with R = Rx(rx) Ry(ry) Rz(rz)."""
    angles = np.asarray(angles_rad, float)
    parts = []
    for axis in range(3):
        rotvec = np.zeros_like(angles)
        rotvec[..., axis] = angles[..., axis]
        parts.append(quat_from_rotvec(rotvec))
    return quat_multiply(quat_multiply(parts[0], parts[1]), parts[2])


def rxyz_from_quat(quat_wxyz: Array) -> Array:
    """Angles (..., 3) [rad] with R = Rx(rx) Ry(ry) Rz(rz); ry within +-pi/2."""
    R = quat_to_matrix(quat_wxyz)
    ry = np.arcsin(np.clip(R[..., 0, 2], -1.0, 1.0))
    rx = np.arctan2(-R[..., 1, 2], R[..., 2, 2])
    rz = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
    return np.stack([rx, ry, rz], axis=-1)


def pose_difference(pose_a: Array, pose_b: Array) -> Array:
    """The change from pose b to pose a, (..., 6): t_a - t_b [m], then log(R_a R_b^T) [rad]."""
    a, b = np.asarray(pose_a, float), np.asarray(pose_b, float)
    turn = quat_multiply(a[..., 3:], quat_conjugate(b[..., 3:]))
    return np.concatenate([a[..., :3] - b[..., :3], rotvec_from_quat(turn)], axis=-1)


def pose_add(pose: Array, change: Array) -> Array:
    """Apply a change (..., 6) to poses (..., 7); inverse of :func:`pose_difference`."""
    pose, change = np.asarray(pose, float), np.asarray(change, float)
    quat = quat_multiply(quat_from_rotvec(change[..., 3:]), pose[..., 3:])
    quat = quat / _norm(quat)
    return np.concatenate([pose[..., :3] + change[..., :3], quat], axis=-1)


def transform_points(poses: Array, points: Array) -> Array:
    """Base-frame coordinates (..., k, 3) of platform points (k, 3) at poses (..., 7)."""
    poses = np.asarray(poses, float)
    turned = np.asarray(points, float) @ np.swapaxes(quat_to_matrix(poses[..., 3:]), -1, -2)
    return poses[..., None, :3] + turned


# What fits call most of these, compiled, for rows (n, k).
#
# They agree with the functions above to the last digits. Either argument may be one row for all;
# rows of rows (..., k) are as good, if both have them.


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
