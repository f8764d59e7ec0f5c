"""How far platforms on joints are displaced, and how each joint moves them there."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.joints import N_CURRENT, joint_columns, place_joints


@jit_inner
def _fill_turn(deviation, length, apart):
    """The rotation vector of a deviation, times the length, the shorter way."""
    w, x, y, z = deviation[3], deviation[4], deviation[5], deviation[6]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    part = 2.0 * length * (math.atan2(sine, w) / sine if sine > 1e-12 else 1.0)
    apart[3], apart[4], apart[5] = part * x, part * y, part * z


@jit_allocating
def apart_batch(screws, poses, rows, away, length, apart, columns):
    """Displacements and motions of k platforms on joints.

    Args:
        screws: (n, d, 7). poses: (n, 7). rows: (k,) which of these each is displaced from.
        away: (k, d) [m] joint values minus those at the poses, hinges times the length.
        length: [m].
        apart: (k, 6) [m], filled: of the origin, and the rotation vector times the length.
        columns: (k, d, 6), filled: the platform's twist at its origin per step of each joint there,
            base axes, rotations times the length.
    """
    current, deviation = np.zeros((screws.shape[1], N_CURRENT)), np.zeros(7)
    for r in range(rows.shape[0]):
        row = rows[r]
        place_joints(screws[row], away[r], length, poses[row], deviation, current)
        for k in range(3):
            apart[r, k] = deviation[k]
        _fill_turn(deviation, length, apart[r])
        x, y, z = (
            poses[row, 0] + deviation[0],
            poses[row, 1] + deviation[1],
            poses[row, 2] + deviation[2],
        )
        joint_columns(current, x, y, z, 1.0 / length, columns[r])
