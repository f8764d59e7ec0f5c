"""What a change of the tables does at fixed poses: compiled, and of the changed cables alone.

A parameter mostly changes a few cables. The others pull the same before and after, so only
those whose rows differ are evaluated: both times, and subtracted.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from seecr.compiled import law as cable_law
from seecr.compiled.law import TENSION
from seecr.compiled.platform import N_LOAD, N_READY, N_WORK, UP, evaluate, place_joints, prepare
from seecr.pose import Array
from seecr.statics import Evaluation, Tables, in_parts

_jit = njit(cache=True, nogil=True, error_model="numpy")


def difference(plus: Tables, minus: Tables, at: Evaluation) -> tuple[Array, Array]:
    """Gradient (n, d) [N] and tensions (n, m) [N] of ``plus`` less those of ``minus``.

    Args:
        plus, minus: tables of the same poses.
        at: where the platform is; nothing is solved.
    """
    n, m = plus.cables.shape[:2]
    gradient, tension = np.zeros((n, plus.n_dof)), np.zeros((n, m))

    def run(part: slice) -> None:
        _difference(
            plus.cables[part], minus.cables[part], plus.load[part], minus.load[part],
            plus.poses[part], plus.screws[part], at.deviation[part], at.values[part],
            plus.length, at.guess[part], gradient[part], tension[part],
        )  # fmt: skip

    in_parts(run, n)
    return _solved(gradient, tension, gradient)


def by_cable(plus: Tables, minus: Tables, at: Evaluation) -> tuple[Array, Array]:
    """The same cable by cable: gradient (n, d, m) [N] and each cable's own tension (n, m).

    For tables in which every cable was changed, to have the derivatives by what each cable has
    of its own at once. The load is taken to be the same in both.
    """
    n, m = plus.cables.shape[:2]
    gradient, tension = np.zeros((n, m, plus.n_dof)), np.zeros((n, m))

    def run(part: slice) -> None:
        _by_cable(
            plus.cables[part], minus.cables[part], plus.load[part], plus.poses[part],
            plus.screws[part], at.deviation[part], at.values[part], plus.length, at.guess[part],
            gradient[part], tension[part],
        )  # fmt: skip

    in_parts(run, n)
    return _solved(np.swapaxes(gradient, 1, 2), tension, gradient.reshape(n, -1))


def _solved(gradient: Array, tension: Array, failed: Array) -> tuple[Array, Array]:
    """Nothing changes where a cable's own equations could not be solved beside the pose."""
    lost = np.isnan(failed).any(axis=1)
    gradient[lost], tension[lost] = 0.0, 0.0
    return gradient, tension


@_jit
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


@_jit
def _difference(
    plus, minus, plus_load, minus_load, poses, screws, deviation, values, length, guess,
    gradient, tension,
):  # fmt: skip
    n, m, width = plus.shape
    d = gradient.shape[1]
    ready, current = np.zeros((m + 1, N_READY)), np.zeros((screws.shape[1], 7))
    out = (np.zeros(d), np.zeros((m, cable_law.N_STATE)))
    spare = (np.zeros((d, d)), np.zeros((m, d)), np.empty((N_WORK, 6)), np.zeros((m, 3)))
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
        place[:] = deviation[r]
        if screws.shape[1] > 0:
            place_joints(screws[r], values[r], length, poses[r], place, current)
        for sign in (1.0, -1.0):
            whole, source = (plus, plus_load) if sign > 0.0 else (minus, minus_load)
            load[:] = source[r]
            if not loaded:
                # cancels: all but the vertical, which the cables need
                load[:UP] = 0.0
            for k in range(count):
                some[k] = whole[r, which[k]]
                starts[k] = guess[r, which[k]]
            if not _pull(
                some[:count], ready, load, poses[r], place, current, length, starts, out, spare
            ):
                gradient[r] = np.nan
                continue
            for k in range(d):
                gradient[r, k] += sign * out[0][k]
            for k in range(count):
                tension[r, which[k]] += sign * out[1][k, TENSION]


@_jit
def _by_cable(
    plus, minus, load, poses, screws, deviation, values, length, guess, gradient, tension
):
    n, m = plus.shape[:2]
    d = gradient.shape[2]
    ready, current = np.zeros((2, N_READY)), np.zeros((screws.shape[1], 7))
    out = (np.zeros(d), np.zeros((1, cable_law.N_STATE)))
    spare = (np.zeros((d, d)), np.zeros((1, d)), np.empty((N_WORK, 6)), np.zeros((1, 3)))
    place, none = np.empty(7), np.zeros(N_LOAD)
    for r in range(n):
        place[:] = deviation[r]
        if screws.shape[1] > 0:
            place_joints(screws[r], values[r], length, poses[r], place, current)
        none[UP:] = load[r, UP:]
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
