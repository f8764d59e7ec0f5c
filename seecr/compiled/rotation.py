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
    # by pairs: of a rotation and its inverse exactly none is left
    return (
        a * w - (b * x + c * y + d * z),
        a * x + w * b + (c * z - d * y),
        a * y + w * c + (d * x - b * z),
        a * z + w * d + (b * y - c * x),
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
