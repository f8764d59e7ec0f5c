"""The history that a cable carries from row to row.

Hysteresis and friction start anew with each run. Only creep follows the clock across runs.
"""

from __future__ import annotations

import numpy as np

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
from seecr.compiled.jit import jit_inner
from seecr.compiled.law import strain_of_tension

# A cable's history: creep strain, stretch [m], hysteretic part of the tension [N], tensions on
# either side of the exit point [N], rest length [m].
N_KEPT = 6
_CREPT, _STRETCHED, _HYSTERETIC, _PULLED, _BEHIND, _PAID = range(N_KEPT)


@jit_inner
def _shares(span):
    """Creep response to a load that is linear in time, after ``span`` time constants.

    Returned are its weights on the load before and now: the convolution of a ramp with exp(-t). The
    rest, exp(-span), is the weight of the earlier creep.
    """
    if span < 1e-3:
        before = span / 2 - span**2 / 3 + span**3 / 8
        return before, span / 2 - span**2 / 6 + span**3 / 24
    mean = -np.expm1(-span) / span
    return mean - np.exp(-span), 1.0 - mean


@jit_inner
def take_past(row, kept, elapsed, fresh):
    """Fill the columns OF_THE_PAST of a cable with its history.

    At the start of a run the platform waits at the reference pose with its history cleared: there
    the cable has neither hysteresis nor friction.

    Args:
        row: the cable (N_COLUMNS,). kept: (N_KEPT,).
        elapsed: [s] since the row before. fresh: whether a run starts.
    """
    before, now = _shares(elapsed / row[CREEP_TIME])
    share = row[CREEP_PART] / row[EA]
    row[CREEP] = kept[_CREPT] * (1.0 - before - now)
    if fresh:
        row[CREEP_RATE] = share * (before + now)
        row[HYSTERESIS], row[FRICTION] = 0.0, 0.0
        return
    row[CREEP] += share * before * kept[_PULLED]
    row[CREEP_RATE] = share * now
    row[STRETCH_BEFORE], row[HYSTERESIS_BEFORE] = kept[_STRETCHED], kept[_HYSTERETIC]
    if row[WINCH_SIDE] > 0.0:
        paid = row[REST] - kept[_PAID]
        row[STUCK] = kept[_BEHIND] - paid * row[EA] / row[WINCH_SIDE]


@jit_inner
def keep_past(row, state, fresh, kept):
    """Store the history that the next row needs of a solved cable.

    Args:
        row: the cable as it was solved. state: (N_STATE,) from its law; the hysteretic part of a
            slack cable's tension is filled in.
        kept: (N_KEPT,), filled.
    """
    kept[_CREPT] = row[CREEP] + row[CREEP_RATE] * state[TENSION]
    strain = state[STRAIN]
    if state[TENSION] == 0.0:
        # a slack cable keeps the stretch and the hysteresis at which its tension became zero
        strain, _slope, hysteretic = strain_of_tension(row, 0.0)
        if not fresh and strain * row[REST] >= kept[_STRETCHED]:
            strain, hysteretic = kept[_STRETCHED] / row[REST], row[HYSTERESIS_BEFORE]
        state[HYSTERESIS_NOW] = hysteretic
    kept[_STRETCHED] = max(strain, 0.0) * row[REST]
    if fresh:
        state[HYSTERESIS_NOW] = 0.0
    kept[_HYSTERETIC] = state[HYSTERESIS_NOW]
    kept[_PULLED], kept[_BEHIND], kept[_PAID] = state[TENSION], state[WINCH_TENSION], row[REST]


@jit_inner
def has_stretch_memory(row):
    """Whether the next row depends on more than the tension: on hysteresis or friction."""
    return row[HYSTERESIS] != 0.0 or row[FRICTION] != 0.0


@jit_inner
def keep_tension(row, tension, kept):
    """Store the history of a solved cable without stretch memory."""
    kept[_CREPT] = row[CREEP] + row[CREEP_RATE] * tension
    kept[_PULLED], kept[_BEHIND], kept[_PAID] = tension, tension, row[REST]


@jit_inner
def begin(row, kept):
    """Initialise the history at the start of a run, after the cable was solved there."""
    row[STRETCH_BEFORE], row[HYSTERESIS_BEFORE] = kept[_STRETCHED], 0.0
    row[STUCK] = kept[_BEHIND]
