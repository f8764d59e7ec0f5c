"""Rows that depend on the rows before them: a compiled walk along their path.

Hysteresis, friction and backlash start anew with each run: the platform rests at its reference
pose, moves straight to the first row and from row to row. Creep alone goes by the clock through
everything; between runs the robot waits at its reference pose.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit

from seecr import statics
from seecr.compiled import descent as kernel
from seecr.compiled.law import (
    CREEP,
    CREEP_RATE,
    EA,
    FRICTION,
    HYSTERESIS,
    HYSTERESIS_BEFORE,
    HYSTERESIS_NOW,
    REST,
    SLACK,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.path import Path
from seecr.setup import Setup


def walk(setup: Setup, tables: statics.Tables, path: Path, limit: int) -> statics.Evaluation:
    """Solve the waypoints in order, each from the one before, and carry the cables' state."""
    n, m = tables.cables.shape[:2]
    out = statics.Evaluation.empty(n, m, tables.n_dof)
    out.energy = np.full(n, np.nan)
    with_clock = bool(np.any(setup.creep))
    starts = np.flatnonzero(path.fresh)
    # runs are independent, but for creep, which goes through all of them
    edges = [0, n] if with_clock else [*starts.tolist(), n]
    parts = [slice(a, b) for a, b in pairwise(edges)]

    def run(part: slice) -> None:
        _walk(
            tables.cables[part], tables.load[part], tables.poses[part], tables.screws[part],
            tables.length, tables.scale[part], 0.5 * tables.length, tables.reach[part], limit,
            path.fresh[part], path.elapsed[part], setup.creep, setup.creep_time,
            out.outcome[part], out.count[part], out.residual[part], out.gradient[part],
            out.hessian[part], out.states[part], out.slopes[part], out.deviation[part],
            out.values[part], out.guess[part],
        )  # fmt: skip

    statics.run_parts(run, parts)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _shares(span):  # type: ignore[no-untyped-def]
    """What a load linear in time leaves of itself after ``span`` time constants.

    Of its value before and now: the convolution of a ramp with exp(-t); the rest, exp(-span),
    is left of the creep there was.
    """
    if span < 1e-3:
        before = span / 2 - span**2 / 3 + span**3 / 8
        return before, span / 2 - span**2 / 6 + span**3 / 24
    mean = -np.expm1(-span) / span
    return mean - np.exp(-span), 1.0 - mean


@njit(cache=True, nogil=True, error_model="numpy")
def _walk(  # type: ignore[no-untyped-def]
    cables, load, poses, screws, length, scale, radius, reach, limit, fresh, elapsed, creep,
    creep_time, outcome, count, residual, gradient, hessian, states, slopes, deviation, values,
    guess,
):  # fmt: skip
    n, m = cables.shape[0], cables.shape[1]
    softened = np.empty_like(cables[0])
    start, first = np.zeros(7), np.zeros(gradient.shape[1])
    crept, amplitude = np.zeros(m), np.empty(m)
    friction = np.empty(m)
    space = kernel.make_space(m, gradient.shape[1], screws.shape[1])
    for k in range(n):
        if fresh[k]:
            start[:] = 0.0
            start[3] = 1.0
            first[:] = 0.0
        else:
            # as far from its command as it was before
            start[:] = deviation[k - 1]
            first[:] = values[k - 1]
        for i in range(m):
            row = cables[k, i]
            amplitude[i], friction[i] = row[HYSTERESIS], row[FRICTION]
            before, now = _shares(elapsed[k] / creep_time[i])
            share = creep[i] / row[EA]
            row[CREEP] = crept[i] * (1.0 - before - now)
            if fresh[k]:
                # waits at the reference pose, history cleared
                row[CREEP_RATE] = share * (before + now)
                row[HYSTERESIS], row[FRICTION] = 0.0, 0.0
                continue
            row[CREEP] += share * before * states[k - 1, i, TENSION]
            row[CREEP_RATE] = share * now
            row[STRETCH_BEFORE] = max(states[k - 1, i, STRAIN], 0.0) * cables[k - 1, i, REST]
            row[HYSTERESIS_BEFORE] = states[k - 1, i, HYSTERESIS_NOW]
            if row[WINCH_SIDE] > 0.0:
                paid = row[REST] - cables[k - 1, i, REST]
                row[STUCK] = states[k - 1, i, WINCH_TENSION] - paid * row[EA] / row[WINCH_SIDE]
        outcome[k], count[k], residual[k] = kernel.solve_in_stages(
            cables[k], load[k], poses[k], screws[k], start, first, length, scale[k], radius,
            reach[k], limit, guess[k], gradient[k], hessian[k], states[k], slopes[k],
            deviation[k], values[k], softened, fresh[k], space,
        )  # fmt: skip
        for i in range(m):
            row = cables[k, i]
            crept[i] = row[CREEP] + row[CREEP_RATE] * states[k, i, TENSION]
            if fresh[k]:
                row[HYSTERESIS], row[FRICTION] = amplitude[i], friction[i]
                row[STRETCH_BEFORE] = max(states[k, i, STRAIN], 0.0) * row[REST]
                row[HYSTERESIS_BEFORE] = 0.0
                row[STUCK] = states[k, i, WINCH_TENSION]
                states[k, i, HYSTERESIS_NOW] = 0.0
            elif states[k, i, SLACK] == 1.0:
                states[k, i, HYSTERESIS_NOW] = 0.0
