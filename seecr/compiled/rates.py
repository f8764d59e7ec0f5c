"""What each cable pulls with at a pose, and how that changes as its ends or its length do.

A cable's force depends on where its anchor point is as seen from its exit point, and on its rest
length. So one evaluation of each cable serves all parameters that move a point or pay out cable.
Nothing is solved; columns OF_THE_PAST are fixed.
"""

from __future__ import annotations

import math

from seecr.compiled.algebra import copy_vector
from seecr.compiled.cable import cable_pull
from seecr.compiled.change import make_change_space, moved_arm, place_platform
from seecr.compiled.columns import (
    ANCHOR,
    ARM,
    BY_REST,
    FORCE,
    SLOPE,
    STIFFNESS,
    TENSION_BY_REST,
    UP,
)
from seecr.compiled.jit import jit, jit_allocating
from seecr.compiled.lengthening import change_by_rest
from seecr.compiled.rotation import rotated_less


@jit_allocating
def rates_of_each_cable(cables, load, poses, screws, deviation, values, length, guess, out):
    """Fill ``out`` (n, m, N_RATES); NaN where a cable's equations could not be solved."""
    n, m = cables.shape[:2]
    space = make_change_space(screws.shape[1])
    place, start, move, keep = space[0], space[3], space[4], space[5]
    force, stiffness, slope, state, work = space[6:11]
    for r in range(n):
        pose, up = poses[r], load[r, UP:]
        place_platform(screws[r], values[r], length, pose, deviation[r], space)
        for i in range(m):
            row, found = cables[r, i], out[r, i]
            a, b, c, dx, dy, dz = moved_arm(row[ANCHOR : ANCHOR + 3], pose, place)
            start[0], start[1], start[2] = pose[0] + a, pose[1] + b, pose[2] + c
            move[0], move[1], move[2] = place[0] + dx, place[1] + dy, place[2] + dz
            copy_vector(guess[r, i], keep)
            if not cable_pull(row, start, move, up, keep, work, force, stiffness, slope, state):
                found[:] = math.nan
                continue
            found[ARM], found[ARM + 1], found[ARM + 2] = a + dx, b + dy, c + dz
            for k in range(3):
                found[FORCE + k], found[SLOPE + k] = force[k], slope[k]
                for j in range(3):
                    found[STIFFNESS + 3 * k + j] = stiffness[k, j]
            found[TENSION_BY_REST] = change_by_rest(row, up, keep, space)
            for k in range(3):
                found[BY_REST + k] = move[k]


@jit
def wrench_by_ends_batch(rates, poses, exits, anchors, longer, wrench, tension):
    """Change of the wrench (n, 6, m) by each cable, and of its own tension (n, m).

    Exit points move by (m, 3) in base axes, anchor points by (m, 3) in those of the platform, and
    cables become longer by (n, m).
    """
    n, m = tension.shape
    for r in range(n):
        w, x, y, z = poses[r, 3], poses[r, 4], poses[r, 5], poses[r, 6]
        for i in range(m):
            of = rates[r, i]
            a, b, c = anchors[i, 0], anchors[i, 1], anchors[i, 2]
            da, db, dc = rotated_less(w, x, y, z, a, b, c)
            a, b, c = a + da, b + db, c + dc  # in base axes
            p, q, s = a - exits[i, 0], b - exits[i, 1], c - exits[i, 2]
            more = longer[r, i]
            tension[r, i] = of[TENSION_BY_REST] * more + (
                of[SLOPE] * p + of[SLOPE + 1] * q + of[SLOPE + 2] * s
            )
            for k in range(3):
                row = STIFFNESS + 3 * k
                wrench[r, k, i] = of[BY_REST + k] * more - (
                    of[row] * p + of[row + 1] * q + of[row + 2] * s
                )
            u, v, t = wrench[r, 0, i], wrench[r, 1, i], wrench[r, 2, i]
            d, e, f = of[ARM], of[ARM + 1], of[ARM + 2]
            g, h, j = of[FORCE], of[FORCE + 1], of[FORCE + 2]
            wrench[r, 3, i] = e * t - f * v + b * j - c * h
            wrench[r, 4, i] = f * u - d * t + c * g - a * j
            wrench[r, 5, i] = d * v - e * u + a * h - b * g
