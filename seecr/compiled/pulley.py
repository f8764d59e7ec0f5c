"""Straight cables over swivelling pulleys: their length, and where they leave the pulley."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.columns import EXIT, N_COLUMNS, RADIUS
from seecr.compiled.jit import jit, jit_allocating, jit_inner


@jit
def pulley_geometry(across, rise, radius):
    """Length and direction of a straight cable over its swivelling pulley.

    In the pulley's own vertical plane, seen from the exit point A, the anchor point is ``across``
    [m] away horizontally and ``rise`` [m] above (negative: below). The cable enters at A from
    below, runs over the top, and leaves along the tangent at the angle psi, measured at the centre
    from the horizontal direction upwards.

    Returns:
        total length (arc and free part), free length, and the direction from the pulley to the
        anchor point, (sin psi, -cos psi).
    """
    dx, dz = across - radius, rise
    distance = math.sqrt(dx * dx + dz * dz)
    free = math.sqrt(max(distance * distance - radius * radius, 0.0))
    # angle(d) + acos(r/D), from its sine and cosine
    psi = math.atan2(dz, dx) + math.atan2(free, radius)
    return free + radius * (math.pi - psi), free, math.sin(psi), -math.cos(psi)


@jit
def geometric_length(row, anchor, up):
    """Length [m] of a straight cable from A over the pulley to the anchor point (3,)."""
    dx, dy, dz = anchor[0] - row[0], anchor[1] - row[1], anchor[2] - row[2]
    if row[RADIUS] == 0.0:
        return math.sqrt(dx * dx + dy * dy + dz * dz)
    rise = dx * up[0] + dy * up[1] + dz * up[2]
    across = math.sqrt(max(dx * dx + dy * dy + dz * dz - rise * rise, 0.0))
    return pulley_geometry(across, rise, row[RADIUS])[0]


@jit_inner
def length_in_plane(row, across, rise):
    """Straight length over the pulley, from the plane's coordinates [m]."""
    if row[RADIUS] == 0.0:
        return math.sqrt(across * across + rise * rise)
    return pulley_geometry(across, rise, row[RADIUS])[0]


@jit_allocating
def lengths_at(poses, anchors, exits, radii, up, out):
    """Straight lengths (n, m) [m] of cables over the pulleys, at poses (n, 7)."""
    row, anchor = np.zeros(N_COLUMNS), np.empty(3)
    for i in range(exits.shape[0]):
        row[EXIT], row[EXIT + 1], row[EXIT + 2] = exits[i, 0], exits[i, 1], exits[i, 2]
        row[RADIUS] = radii[i]
        a, b, c = anchors[i, 0], anchors[i, 1], anchors[i, 2]
        for n in range(poses.shape[0]):
            w, x, y, z = poses[n, 3], poses[n, 4], poses[n, 5], poses[n, 6]
            # b + 2 q x (q x b + w b)
            tx, ty, tz = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
            anchor[0] = poses[n, 0] + a + 2.0 * (y * tz - z * ty)
            anchor[1] = poses[n, 1] + b + 2.0 * (z * tx - x * tz)
            anchor[2] = poses[n, 2] + c + 2.0 * (x * ty - y * tx)
            out[n, i] = geometric_length(row, anchor, up)
