"""The distance between two poses, by code that neither SEECR's nor MuJoCo's side uses.

Both sides compute rotations with :mod:`seecr.pose`; an error there could cancel in a difference
computed with it. Here SciPy makes rotation matrices of the quaternions.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from seecr.pose import Array


def gap(pose_a: Array, pose_b: Array) -> tuple[Array, Array]:
    """Distance [m] and angle [rad] between poses (..., 7), both (...,); NaN where a pose is NaN."""
    a, b = np.broadcast_arrays(np.asarray(pose_a, float), np.asarray(pose_b, float))
    distance = np.sqrt(np.sum((a[..., :3] - b[..., :3]) ** 2, axis=-1))
    angle = np.full(distance.shape, np.nan)
    known = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    if known.any():
        angle[known] = _angle(_matrix(a[known]), _matrix(b[known]))
    return distance, angle


def _matrix(poses: Array) -> Array:
    """Rotation matrices (k, 3, 3) of poses (k, 7)."""
    w, x, y, z = poses[:, 3:].T
    return np.asarray(Rotation.from_quat(np.stack([x, y, z, w], axis=1)).as_matrix())


def _angle(a: Array, b: Array) -> Array:
    """Angle (k,) [rad] of the rotations from matrices a to b, both (k, 3, 3).

    The chord ``|a - b|`` is 2 sqrt(2) sin(angle/2), which keeps the digits of small angles; the
    trace, 1 + 2 cos(angle), determines large ones.
    """
    half_sine = np.sqrt(np.sum((a - b) ** 2, axis=(1, 2)) / 8.0)
    half_cosine = np.sqrt(np.maximum(1.0 + np.einsum("kij,kij->k", a, b), 0.0)) / 2.0
    return np.asarray(2.0 * np.arctan2(half_sine, half_cosine))
