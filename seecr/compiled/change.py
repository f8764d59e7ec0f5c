"""What a change of the tables does at fixed poses, evaluated for the changed cables alone.

A parameter mostly changes a few cables. The others pull the same before and after, so only
those whose rows differ are evaluated: both times, and subtracted.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.algebra import copy_vector
from seecr.compiled.columns import N_LOAD, N_STATE, TENSION, UP
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.joints import place_joints
from seecr.compiled.platform import N_READY, N_WORK, evaluate, prepare


@jit_inner
def _pull(cables, ready, load, pose, deviation, current, length, guess, out, spare):
    """Gradient and states of a few cables, into ``out``; False where a law has no solution."""
    hessian, slopes, work, keep = spare
    gradient, states = out
    k = cables.shape[0]
    prepare(cables, load, pose, ready[: k + 1])
    for i in range(k):
        for j in range(3):
            keep[i, j] = guess[i, j]
    energy = evaluate(
        cables, ready[: k + 1], load, deviation, current, length, keep[:k], gradient, hessian,
        states[:k], slopes[:k], work,
    )  # fmt: skip
    return energy != np.inf


@jit_allocating
def change_at_rest(
    plus, minus, plus_load, minus_load, poses, screws, deviation, values, length, guess,
    gradient, tension,
):  # fmt: skip
    """Gradient (n, d) and tensions (n, m) of ``plus`` less ``minus``; NaN where unsolved."""
    n, m, width = plus.shape
    d = gradient.shape[1]
    ready, current = np.zeros((m + 1, N_READY)), np.zeros((screws.shape[1], 7))
    out = (np.zeros(d), np.zeros((m, N_STATE)))
    spare = (np.zeros((d, d)), np.zeros((m, d)), np.empty((N_WORK + m, 6)), np.zeros((m, 3)))
    some, starts = np.empty((m, width)), np.empty((m, 3))
    which, place, load = np.empty(m, np.int64), np.empty(7), np.zeros(N_LOAD)
    for r in range(n):
        count = 0
        for i in range(m):
            for c in range(width):
                if plus[r, i, c] != minus[r, i, c]:
                    which[count] = i
                    count += 1
                    break
        loaded = False
        for c in range(N_LOAD):
            loaded = loaded or plus_load[r, c] != minus_load[r, c]
        if count == 0 and not loaded:
            continue
        copy_vector(deviation[r], place)
        if screws.shape[1] > 0:
            place_joints(screws[r], values[r], length, poses[r], place, current)
        for sign in (1.0, -1.0):
            whole, source = (plus, plus_load) if sign > 0.0 else (minus, minus_load)
            # a load that stays cancels: all but the vertical, which the cables need
            for c in range(N_LOAD):
                load[c] = source[r, c] if loaded or c >= UP else 0.0
            for k in range(count):
                copy_vector(whole[r, which[k]], some[k])
                copy_vector(guess[r, which[k]], starts[k])
            if not _pull(
                some[:count], ready, load, poses[r], place, current, length, starts, out, spare
            ):
                gradient[r] = np.nan
                continue
            for k in range(d):
                gradient[r, k] += sign * out[0][k]
            for k in range(count):
                tension[r, which[k]] += sign * out[1][k, TENSION]


@jit_allocating
def change_of_each_cable(
    plus, minus, load, poses, screws, deviation, values, length, guess, gradient, tension
):
    """The same cable by cable: gradient (n, m, d), each cable's own tension (n, m)."""
    n, m = plus.shape[:2]
    d = gradient.shape[2]
    ready, current = np.zeros((2, N_READY)), np.zeros((screws.shape[1], 7))
    out = (np.zeros(d), np.zeros((1, N_STATE)))
    spare = (np.zeros((d, d)), np.zeros((1, d)), np.empty((N_WORK + m, 6)), np.zeros((1, 3)))
    place, none = np.empty(7), np.zeros(N_LOAD)
    for r in range(n):
        copy_vector(deviation[r], place)
        if screws.shape[1] > 0:
            place_joints(screws[r], values[r], length, poses[r], place, current)
        for c in range(UP, N_LOAD):
            none[c] = load[r, c]
        for i in range(m):
            for sign in (1.0, -1.0):
                one = plus[r, i : i + 1] if sign > 0.0 else minus[r, i : i + 1]
                if not _pull(
                    one, ready, none, poses[r], place, current, length, guess[r, i : i + 1], out,
                    spare,
                ):  # fmt: skip
                    gradient[r, i] = np.nan
                    continue
                for k in range(d):
                    gradient[r, i, k] += sign * out[0][k]
                tension[r, i] += sign * out[1][0, TENSION]
