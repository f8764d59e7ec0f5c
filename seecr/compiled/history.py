"""Rows that depend on the rows before: waypoints in their order, with the cables' history."""

from __future__ import annotations

from typing import Any

import numpy as np

from seecr.compiled.algebra import copy_rows, copy_vector
from seecr.compiled.cable import N_WORK
from seecr.compiled.cable_law import strain_of_tension
from seecr.compiled.columns import (
    CONVERGED,
    CREEP,
    CREEP_PART,
    CREEP_RATE,
    CREEP_TIME,
    EA,
    FRICTION,
    HYSTERESIS,
    HYSTERESIS_BEFORE,
    HYSTERESIS_NOW,
    N_COLUMNS,
    N_STATE,
    REST,
    SINGULAR,
    STALLED,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    UP,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.compiled.jit import jit, jit_inner
from seecr.compiled.joint_kinematics import N_CURRENT
from seecr.compiled.newton import advance, solve_in_stages
from seecr.compiled.platform import N_READY
from seecr.compiled.rates import (
    add_load,
    add_pull,
    change_space,
    differ,
    place_platform,
    put_gradient,
)

# The history that a cable carries from row to row.
#
# Hysteresis and friction start anew with each run. Only creep follows the clock across runs.

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
    """Fill the columns OF_THE_PAST of a cable with its history (N_KEPT,), ``elapsed`` [s] after it.

    At the start of a run the platform waits at the reference pose with its history cleared: there
    the cable has neither hysteresis nor friction.
    """
    before, now = _shares(elapsed / row[CREEP_TIME])
    share = row[CREEP_PART] / row[EA] if row[CREEP_PART] > 0.0 else 0.0
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
    """Store the history (N_KEPT,) that the next row needs of a cable as it was solved.

    The hysteretic part of a slack cable's tension is filled in its ``state``.
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


# Most evaluations of a row's wrench, until each tension changes as its slope says, up to this part
# and this rounding.
_CORRECTIONS, _BENT, _ROUNDING = 3, 1e-5, 1e-10


def solve_rows(
    cables, load, poses, screws, starts, start_values, length, scale, radius, reach, limit, staged,
    in_order, fresh, onward, enough, elapsed, outcome, count, residual, gradient, hessian, states,
    slopes, deviation, values, guess,
) -> None:  # fmt: skip
    """Solve poses, each from its own start, or waypoints in order; all outputs are filled.

    Independent poses are all ``fresh``. A waypoint that is not starts from the one before; its
    start is filled. If that is not solved, its run ends, since the path to later rows is then
    unknown: these count as stalled. (N,) each: ``fresh`` waypoints start a run, ``onward`` ones go
    on from the one before as that went on from its own, ``elapsed`` [s] since the one before,
    ``enough`` residual/scale at which to stop. ``in_order``: whether cables have a history.
    """
    m, n, joints = cables.shape[1], gradient.shape[1], screws.shape[1]
    descent = (
        np.zeros(n), np.zeros((n, n)), np.zeros(7), np.zeros(n), np.zeros(n), np.zeros((n, n)),
        np.zeros((m, N_STATE)), np.zeros((m, n)), np.zeros((m, 3)), np.zeros((joints, N_CURRENT)),
        np.zeros((N_WORK + m, 6)), np.zeros((m + 1, N_READY)), np.zeros((m, N_COLUMNS)),
    )  # fmt: skip
    stages = np.zeros((m, N_COLUMNS)), np.zeros(7), np.zeros(n)
    _solve_rows(
        cables, load, poses, screws, starts, start_values, length, scale, radius, reach, limit,
        staged, in_order, fresh, onward, enough, elapsed, outcome, count, residual, gradient,
        hessian, states, slopes, deviation, values, guess, descent, stages, np.zeros((m, N_KEPT)),
        np.zeros((m, 2)),
    )  # fmt: skip


# One function for poses and waypoints: the descent is large, and would be compiled into each. For
# the same reason NumPy makes its scratch arrays.


@jit
def _solve_rows(
    cables, load, poses, screws, starts, start_values, length, scale, radius, reach, limit, staged,
    in_order, fresh, onward, enough, elapsed, outcome, count, residual, gradient, hessian, states,
    slopes, deviation, values, guess, descent, stages, kept, here,
):  # fmt: skip
    lost = False
    for k in range(poses.shape[0]):
        if lost and not fresh[k]:
            outcome[k] = STALLED
            continue
        if not fresh[k]:
            # the start deviates from its command as much as the last equilibrium did; on a straight
            # way by as much more as that did than the one before it
            copy_vector(deviation[k - 1], starts[k])
            copy_vector(values[k - 1], start_values[k])
            if onward[k]:
                _go_on(deviation[k - 2], starts[k])
                _go_on(values[k - 2], start_values[k])
                _normalise(starts[k])
        if in_order:
            for i in range(cables.shape[1]):
                row = cables[k, i]
                here[i, 0], here[i, 1] = row[HYSTERESIS], row[FRICTION]
                take_past(row, kept[i], elapsed[k], fresh[k])
        outcome[k], count[k], residual[k] = solve_in_stages(
            cables[k], load[k], poses[k], screws[k], starts[k], start_values[k], length, scale[k],
            radius, reach[k], limit, guess[k], gradient[k], hessian[k], states[k], slopes[k],
            deviation[k], values[k], staged and fresh[k], enough[k], descent, stages,
        )  # fmt: skip
        if not in_order:
            continue
        lost = outcome[k] != CONVERGED and outcome[k] != SINGULAR
        for i in range(cables.shape[1]):
            row = cables[k, i]
            keep_past(row, states[k, i], fresh[k], kept[i])
            if fresh[k]:
                row[HYSTERESIS], row[FRICTION] = here[i, 0], here[i, 1]
                begin(row, kept[i])


@jit_inner
def _go_on(before, now):
    """The values that follow after two."""
    for a in range(now.shape[0]):
        now[a] = 2.0 * now[a] - before[a]


@jit_inner
def _normalise(deviation):
    """Bring the quaternion of a deviation (7,) back to unit length."""
    size = 0.0
    for a in range(3, 7):
        size += deviation[a] ** 2
    for a in range(3, 7):
        deviation[a] /= np.sqrt(size)


@jit_inner
def _pull_side(
    table, load, part, pose, screws, deviation, values, length, guess, elapsed, fresh, side, space
):
    """Tensions and gradient of one side, at a displacement ``part`` (d,) [m] from the equilibrium.

    ``side`` is rows with their history, the history kept, tensions and gradient; all but the second
    are filled.
    """
    rows, kept, pulls, gradient = side
    advance(deviation, values, part, length, screws, pose, space[12], space[13], space[1])
    place_platform(screws, space[13], length, pose, space[12], space)
    space[11][:] = 0.0
    for i in range(table.shape[0]):
        copy_vector(table[i], rows[i])
        take_past(rows[i], kept[i], elapsed, fresh)
        pulls[i] = add_pull(1.0, rows[i], pose, load[UP:], 1.0 / length, guess[i], space)
    add_load(1.0, load, pose, 1.0 / length, space)
    put_gradient(space, gradient)


@jit_inner
def _keep_side(
    table, load, part, more, slopes, pose, screws, deviation, values, length, guess, fresh, side,
    space,
):  # fmt: skip
    """Store the history that the next row needs of one side's cables, at that side's equilibrium.

    It is ``part`` (d,) [m] from the equilibrium, of which ``more`` since the tensions were
    computed. Returns whether a tension changed otherwise than its slope says: then a cable turned
    round between, and that side's equilibrium is not quite there.
    """
    rows, kept, pulls, _gradient = side
    placed, bent = False, False
    for i in range(table.shape[0]):
        if not has_stretch_memory(table[i]):
            for a in range(more.shape[0]):
                pulls[i] += slopes[i, a] * more[a]
            keep_tension(rows[i], pulls[i], kept[i])
            continue
        if not placed:
            advance(deviation, values, part, length, screws, pose, space[12], space[13], space[1])
            place_platform(screws, space[13], length, pose, space[12], space)
            placed = True
        expected, size = pulls[i], 0.0
        for a in range(more.shape[0]):
            expected += slopes[i, a] * more[a]
            size += abs(slopes[i, a] * more[a])
        pulls[i] = add_pull(1.0, rows[i], pose, load[UP:], 1.0 / length, guess[i], space)
        bent = bent or abs(pulls[i] - expected) > _BENT * size + _ROUNDING * abs(pulls[i])
        keep_past(rows[i], space[9], fresh, kept[i])
    return bent


@jit_inner
def _stands_still(poses, load, k):
    """Whether the command and the load of a row are those of the row before."""
    return k > 0 and not (differ(poses[k], poses[k - 1]) or differ(load[k], load[k - 1]))


def space_of_way(screws: Any, m: int, d: int) -> tuple[Any, ...]:
    """Scratch arrays of change_on_the_way: of the sides ahead and behind, their displacements and
    what is added to these, and for the wrench.
    """
    sides = [
        (np.empty((m, N_COLUMNS)), np.zeros((m, N_KEPT)), np.zeros(m), np.zeros(d))
        for _ in range(2)
    ]  # fmt: skip
    past = np.zeros((m, N_KEPT)), np.zeros((m, N_KEPT))
    return *sides, past, tuple(np.zeros((4, d))), change_space(screws)


@jit
def change_on_the_way(
    plus, minus, plus_load, minus_load, poses, screws, deviation, values, slopes, length, guess,
    inverse, fresh, elapsed, solved, step, tension, space_of_all,
):  # fmt: skip
    """Difference of a path's equilibria between slightly different tables; nothing is solved.

    It is carried forward through the rows. At each row the two sides start from their cables'
    history; the difference of their wrenches moves the platform by the implicit function theorem;
    and each side stores its cables' history where it then is. The wrench is evaluated at the
    equilibrium; if the platform stands still, at the displacement of the row before, where no cable
    reverses on either side and the stiffness holds. Where a cable turned round between there and
    where that side then is, it is evaluated again there.

    Filled are ``step`` (N, d) [m] in the loop's coordinates and ``tension`` (N, m) [N], of plus
    minus minus. Rows that are not solved end their run and get zero changes.
    """
    n, m, d = plus.shape[0], plus.shape[1], step.shape[1]
    ahead, behind, (past_ahead, past_behind), (half, back, more, less), space = space_of_all
    lost = False
    for k in range(n):
        still = not fresh[k] and not lost and _stands_still(poses, plus_load, k)
        lost = (lost and not fresh[k]) or not solved[k]
        step[k] = 0.0
        tension[k] = 0.0
        if lost:
            continue
        for a in range(d):
            half[a] = 0.5 * step[k - 1, a] if still else 0.0
            back[a] = -half[a]
        copy_rows(ahead[1], past_ahead)
        copy_rows(behind[1], past_behind)
        for again in range(_CORRECTIONS):
            if again:
                copy_rows(past_ahead, ahead[1])
                copy_rows(past_behind, behind[1])
            _pull_side(
                plus[k], plus_load[k], half, poses[k], screws[k], deviation[k], values[k], length,
                guess[k], elapsed[k], fresh[k], ahead, space,
            )  # fmt: skip
            _pull_side(
                minus[k], minus_load[k], back, poses[k], screws[k], deviation[k], values[k],
                length, guess[k], elapsed[k], fresh[k], behind, space,
            )  # fmt: skip
            for a in range(d):
                more[a] = 0.0
                for b in range(d):
                    more[a] -= 0.5 * inverse[k, a, b] * (ahead[3][b] - behind[3][b])
                half[a] += more[a]
                back[a], less[a] = -half[a], -more[a]
                step[k, a] = 2.0 * half[a]
            bent = _keep_side(
                plus[k], plus_load[k], half, more, slopes[k], poses[k], screws[k], deviation[k],
                values[k], length, guess[k], fresh[k], ahead, space,
            )  # fmt: skip
            other = _keep_side(
                minus[k], minus_load[k], back, less, slopes[k], poses[k], screws[k], deviation[k],
                values[k], length, guess[k], fresh[k], behind, space,
            )  # fmt: skip
            if not (bent or other):
                break
        for i in range(m):
            tension[k, i] = ahead[2][i] - behind[2][i]
            lost = lost or not np.isfinite(tension[k, i])
        if lost:
            # a cable's own equations failed: nothing is known from here on
            step[k] = 0.0
            tension[k] = 0.0
