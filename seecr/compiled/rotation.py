"""Quaternions as scalars, in forms that keep the digits of small rotations."""

from __future__ import annotations

import math

from seecr.compiled.jit import jit, jit_inner


@jit
def rotated_less(w, x, y, z, a, b, c):
    cx, cy, cz = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        2.0 * (w * cx + y * cz - z * cy),
        2.0 * (w * cy + z * cx - x * cz),
        2.0 * (w * cz + x * cy - y * cx),
    )


@jit_inner
def quaternion_product(a, b, c, d, w, x, y, z):
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


@jit
def turned(x, y, z, a, b, c, d):
    """exp(rotation vector) times a quaternion, normalised."""
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    s = 0.5 if half < 1e-8 else math.sin(half) / angle
    a, b, c, d = quaternion_product(math.cos(half), s * x, s * y, s * z, a, b, c, d)
    inverse = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inverse, b * inverse, c * inverse, d * inverse
