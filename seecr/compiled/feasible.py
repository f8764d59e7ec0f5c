"""Whether any tensions within limits balance a load, with at most two more cables than freedoms.

The tensions that balance are tau = tau_p + N nu, with N the null space of W; each limit is a
half-plane of nu. The point of all half-planes nearest to the origin is sought by adding them one by
one: if the nearest so far is beyond a new one, the next is on that one's border, or there is none
(Seidel, Discrete and Computational Geometry 6, 1991, whose argument holds for any strictly convex
aim). Unlike :mod:`seecr.compiled.margin`, it does not say by how much.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.margin import null_space

MOST = 2
"""Most cables beyond the degrees of freedom."""


@jit_inner
def _on_border(number, normals, offsets):
    """The point of a half-plane's border nearest to the origin that is in all those before."""
    a, b = normals[number, 0], normals[number, 1]
    square = a * a + b * b
    if square == 0.0:
        return math.nan, math.nan
    x, y = -offsets[number] * a / square, -offsets[number] * b / square
    low, high = -np.inf, np.inf
    for j in range(number):
        slope = normals[j, 1] * a - normals[j, 0] * b
        value = normals[j, 0] * x + normals[j, 1] * y + offsets[j]
        if slope > 0.0:
            low = max(low, -value / slope)
        elif slope < 0.0:
            high = min(high, -value / slope)
        elif value < 0.0:
            return math.nan, math.nan
    if low > high:
        return math.nan, math.nan
    part = min(max(0.0, low), high)
    return x - part * b, y + part * a


@jit_inner
def _have_a_point(count, normals, offsets, rounding):
    """Whether half-planes normal . nu + offset >= 0 have a point in common, to rounding."""
    x, y = 0.0, 0.0
    for i in range(count):
        if normals[i, 0] * x + normals[i, 1] * y + offsets[i] < -rounding:
            x, y = _on_border(i, normals, offsets)
            if math.isnan(x):
                return False
    return True


@jit_allocating
def feasible_of(matrices, loads, low, high, room, rounding, out):
    """Fill ``out`` (n,) with 1.0 where tensions balance, 0.0 where none do, nan if W is singular.

    Args:
        matrices: (n, d, m), m - d at most MOST. loads: (n, d). low, high: (n, m) [N].
        room: (n,) [N] by which limits may be exceeded. rounding: (n,) [N], less than that.
    """
    d, m = matrices.shape[1:]
    work, particular, null = np.empty((m, d + 1)), np.empty(m), np.empty((m, m - d))
    normals, offsets = np.zeros((2 * m, MOST)), np.empty(2 * m)
    for r in range(matrices.shape[0]):
        out[r] = math.nan
        if not null_space(matrices[r], loads[r], work, particular, null):
            continue
        count = 0
        for i in range(m):
            for k in range(m - d):
                normals[count, k] = null[i, k]
            offsets[count] = particular[i] - low[r, i] + room[r]
            count += 1
            if high[r, i] != np.inf:
                for k in range(m - d):
                    normals[count, k] = -null[i, k]
                offsets[count] = high[r, i] - particular[i] + room[r]
                count += 1
        out[r] = 1.0 if _have_a_point(count, normals, offsets, rounding[r]) else 0.0
