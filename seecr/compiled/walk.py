"""Rows that depend on the rows before them: waypoints solved in order, the cables' state carried.

Hysteresis and friction start anew with each run. Creep alone goes by the clock.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.algebra import copy_vector
from seecr.compiled.columns import (
    CREEP,
    CREEP_PART,
    CREEP_RATE,
    CREEP_TIME,
    EA,
    FRICTION,
    HYSTERESIS,
    HYSTERESIS_BEFORE,
    HYSTERESIS_NOW,
    REST,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.compiled.descent import make_space, solve_in_stages
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.law import strain_of_tension
from seecr.compiled.outcomes import CONVERGED, SINGULAR, STALLED


@jit_inner
def _shares(span):
    """What a load linear in time leaves of itself after ``span`` time constants.

    Of its value before and now: the convolution of a ramp with exp(-t); the rest, exp(-span),
    is left of the creep there was.
    """
    if span < 1e-3:
        before = span / 2 - span**2 / 3 + span**3 / 8
        return before, span / 2 - span**2 / 6 + span**3 / 24
    mean = -np.expm1(-span) / span
    return mean - np.exp(-span), 1.0 - mean


@jit_allocating
def walk_in_order(
    cables, load, poses, screws, length, scale, radius, reach, limit, fresh, elapsed, outcome,
    count, residual, gradient, hessian, states, slopes, deviation, values, guess,
):  # fmt: skip
    """Solve waypoints in order, each from the one before; all outputs are filled.

    One that is not solved ends its run: where the way to a row is not known, nothing is. The
    others of the run count as stalled; searching for each of them took up to ``limit`` steps.

    Args:
        cables: (N, m, N_COLUMNS); the columns OF_THE_PAST are filled.
        fresh: (N,) waypoints that start a run. elapsed: (N,) [s] since the one before.
        The others are those of solve_batch.
    """
    n, m = cables.shape[0], cables.shape[1]
    softened = np.empty_like(cables[0])
    start, first = np.zeros(7), np.zeros(gradient.shape[1])
    crept, stretched = np.zeros(m), np.zeros(m)
    amplitude, friction = np.empty(m), np.empty(m)
    space = make_space(m, gradient.shape[1], screws.shape[1])
    lost = False
    for k in range(n):
        if lost and not fresh[k]:
            outcome[k] = STALLED
            continue
        if fresh[k]:
            start[:] = 0.0
            start[3] = 1.0
            first[:] = 0.0
        else:
            # as far from its command as it was before
            copy_vector(deviation[k - 1], start)
            copy_vector(values[k - 1], first)
        for i in range(m):
            row = cables[k, i]
            amplitude[i], friction[i] = row[HYSTERESIS], row[FRICTION]
            before, now = _shares(elapsed[k] / row[CREEP_TIME])
            share = row[CREEP_PART] / row[EA]
            row[CREEP] = crept[i] * (1.0 - before - now)
            if fresh[k]:
                # waits at the reference pose, history cleared
                row[CREEP_RATE] = share * (before + now)
                row[HYSTERESIS], row[FRICTION] = 0.0, 0.0
                continue
            row[CREEP] += share * before * states[k - 1, i, TENSION]
            row[CREEP_RATE] = share * now
            row[STRETCH_BEFORE], row[HYSTERESIS_BEFORE] = (
                stretched[i],
                states[k - 1, i, HYSTERESIS_NOW],
            )
            if row[WINCH_SIDE] > 0.0:
                paid = row[REST] - cables[k - 1, i, REST]
                row[STUCK] = states[k - 1, i, WINCH_TENSION] - paid * row[EA] / row[WINCH_SIDE]
        outcome[k], count[k], residual[k] = solve_in_stages(
            cables[k], load[k], poses[k], screws[k], start, first, length, scale[k], radius,
            reach[k], limit, guess[k], gradient[k], hessian[k], states[k], slopes[k],
            deviation[k], values[k], softened, fresh[k], space,
        )  # fmt: skip
        lost = outcome[k] != CONVERGED and outcome[k] != SINGULAR
        for i in range(m):
            row = cables[k, i]
            crept[i] = row[CREEP] + row[CREEP_RATE] * states[k, i, TENSION]
            strain = states[k, i, STRAIN]
            if states[k, i, TENSION] == 0.0:
                # a slack cable keeps the stretch and the friction at which its tension ended
                strain, _slope, friction_now = strain_of_tension(row, 0.0)
                if not fresh[k] and strain * row[REST] >= stretched[i]:
                    strain, friction_now = stretched[i] / row[REST], row[HYSTERESIS_BEFORE]
                states[k, i, HYSTERESIS_NOW] = friction_now
            stretched[i] = max(strain, 0.0) * row[REST]
            if fresh[k]:
                row[HYSTERESIS], row[FRICTION] = amplitude[i], friction[i]
                row[STRETCH_BEFORE], row[HYSTERESIS_BEFORE] = stretched[i], 0.0
                row[STUCK] = states[k, i, WINCH_TENSION]
                states[k, i, HYSTERESIS_NOW] = 0.0
