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
from seecr.compiled.jit import jit_allocating
from seecr.compiled.lengthening import change_by_rest


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
