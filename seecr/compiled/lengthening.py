"""A cable's rest length: how pull and tension change with it, and the one that gives a tension.

The derivatives are those of the cable's own equations at a fixed pose, by the implicit function
theorem: with E(x, l0) = 0 for its unknowns x, dx/dl0 = -(dE/dx)^-1 dE/dl0. Columns OF_THE_PAST are
fixed.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import copy_vector, solve_3x3
from seecr.compiled.cable import cable_pull
from seecr.compiled.change import (
    add_load,
    make_change_space,
    moved_arm,
    place_platform,
    put_gradient,
    take_force,
)
from seecr.compiled.columns import (
    ANCHOR,
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    FRICTION,
    HYSTERESIS,
    LIFT,
    REST,
    SLACK,
    STRAIN,
    STUCK,
    TENSION,
    UP,
    WEIGHT,
    WINCH_SIDE,
)
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.law import (
    dahl,
    series_length,
    strain_of_tension,
    tension_of_strain,
    winch_tension,
)
from seecr.compiled.yielding import along

# Most rounds for a length that changes its own hysteresis, of which the first are secant steps: it
# may change it nearly as much as it was changed, if the cable sticks.
_ROUNDS, _SECANTS = 30, 20


@jit_inner
def _hysteresis_by_rest(row, strain):
    """Derivative [N/m] of the tension by the rest length at a fixed strain: of Dahl's part."""
    if row[HYSTERESIS] == 0.0:
        return 0.0
    return dahl(row, strain)[1] * strain / row[REST]


@jit_inner
def _straight_change(row, state, gradient, force):
    """dT/dl0 [N/m] of a straight cable; fills ``force`` (3,) [N/m], derivative of its force."""
    force[0] = force[1] = force[2] = 0.0
    if state[SLACK] != 0.0:
        return 0.0
    strain = state[STRAIN]
    _length, rate, tension, slope, _z = series_length(row, strain)
    soft = row[REST] * row[CREEP_RATE] + row[COMPLIANCE]
    soft += row[WINCH_SIDE] / row[EA] * winch_tension(row, tension)[1]
    more = _hysteresis_by_rest(row, strain)
    longer = 1.0 + strain + row[CREEP] + row[CREEP_RATE] * tension + soft * more
    by_rest = more - slope * longer / rate
    # the gradient is along the cable, as long as dT/dL
    for k in range(3):
        force[k] = -by_rest * gradient[k] * (rate / slope)
    return by_rest


@jit_inner
def _catenary_change(row, up, unknown, work, force):
    """The same of a hanging cable, with what :func:`cable_pull` left in its scratch."""
    e, jacobian, error, by_rest = work[0], work[4:7], work[7], work[10]
    h, v, w = unknown[0], unknown[1], row[WEIGHT]
    top = v + w * unknown[2]
    tension = math.sqrt(h * h + top * top)
    strain, slope, _z = strain_of_tension(row, tension)
    grown = 1.0 + tension / row[EA]
    other = row[CREEP] + row[CREEP_RATE] * tension + strain - tension / row[EA]
    other -= row[REST] * _hysteresis_by_rest(row, strain) / slope
    error[0], error[1], error[2] = 0.0, 0.0, 1.0 + other / grown
    solve_3x3(jacobian, error, by_rest)
    for k in range(3):
        force[k] = by_rest[1] * up[k] - by_rest[0] * e[k]
    return (h * by_rest[0] + top * (by_rest[1] + w * by_rest[2])) / tension


@jit_inner
def change_by_rest(row, up, guess, space):
    """dT/dl0 [N/m] of any cable, with what :func:`cable_pull` left in ``guess`` and scratch.

    Fills space[4], the cable's move, with the derivative [N/m] of its force.
    """
    move, gradient, state, work = space[4], space[8], space[9], space[10]
    yields = row[LIFT] != 0.0
    column, share, turned = work[33], 0.0, 0.0
    if yields:
        # as for an exit point that is not lifted: K z of its stiffness is in ``column``
        slope = 1.0 + row[LIFT] * along(up, column)
        share, turned = row[LIFT] / slope, along(up, gradient) * slope
        for k in range(3):
            gradient[k] += share * turned * column[k]
    if row[WEIGHT] > 0.0:
        tension = _catenary_change(row, up, guess, work, move)
    else:
        tension = _straight_change(row, state, gradient, move)
    if yields:
        lift = -share * (along(up, move) + row[WEIGHT])
        for k in range(3):
            move[k] += column[k] * lift
        tension -= turned * lift
    return tension


@jit_allocating
def pull_and_change(
    cables, load, poses, screws, deviation, values, length, guess, gradient, pulls, by_length,
    tension,
):  # fmt: skip
    """Gradient (n, d) and tensions (n, m) [N], and their derivatives by each cable's rest length.

    The derivatives [N/m] are ``by_length`` (n, m, d) of the gradient and ``tension`` (n, m) of each
    cable's own tension. NaN where a cable's equations could not be solved. All four are filled;
    ``guess`` (n, m, 3) is overwritten with the catenaries found.
    """
    n, m = cables.shape[:2]
    space, per, total = make_change_space(screws.shape[1]), 1.0 / length, np.empty(6)
    place, start, move, one = space[0], space[3], space[4], space[11]
    force, stiffness, slope, state, work = space[6:11]
    for r in range(n):
        pose, up = poses[r], load[r, UP:]
        place_platform(screws[r], values[r], length, pose, deviation[r], space)
        total[:] = 0.0
        for i in range(m):
            row = cables[r, i]
            a, b, c, dx, dy, dz = moved_arm(row[ANCHOR : ANCHOR + 3], pose, place)
            start[0], start[1], start[2] = pose[0] + a, pose[1] + b, pose[2] + c
            move[0], move[1], move[2] = place[0] + dx, place[1] + dy, place[2] + dz
            own = guess[r, i]
            if cable_pull(row, start, move, up, own, work, force, stiffness, slope, state):
                tension[r, i] = change_by_rest(row, up, own, space)
                pulls[r, i] = state[TENSION]
            else:
                tension[r, i] = pulls[r, i] = move[0] = force[0] = math.nan
            take_force(a + dx, b + dy, c + dz, force[0], force[1], force[2], per, total)
            one[:] = 0.0
            take_force(a + dx, b + dy, c + dz, move[0], move[1], move[2], per, one)
            put_gradient(space, by_length[r, i])
        copy_vector(total, one)
        add_load(1.0, load[r], pose, per, space)
        put_gradient(space, gradient[r])


@jit_allocating
def rest_lengths_for(cables, spans, tensions, follows, out):
    """Rest lengths (n, m) [m] at which straight cables of given spans have given tensions.

    For every law, with its history, l0 (1 + eps + creep) + compliance T + winch_side/EA T_winch is
    the span: to rounding, or to some nanometres where a cable with hysteresis sticks.

    Args:
        follows: whether the tension behind a cable that sticks is ``STUCK`` only at the rest length
            in the table, and changes with what is paid out; otherwise it is that at any length.
    """
    row = cables[0, 0].copy()
    for r in range(cables.shape[0]):
        for i in range(cables.shape[1]):
            copy_vector(cables[r, i], row)
            before, off_before = row[REST], 0.0
            for k in range(_ROUNDS):
                out[r, i] = _rest_for(row, cables[r, i], spans[r, i], tensions[r, i], follows)
                off = out[r, i] - row[REST]
                if row[HYSTERESIS] == 0.0 or abs(off) <= 1e-16 * out[r, i]:
                    break
                step = off
                if 0 < k < _SECANTS:
                    slope = (off - off_before) / (row[REST] - before)
                    step = -off / slope if slope < 0.0 else off
                before, off_before = row[REST], off
                row[REST] += step


@jit_allocating
def stretched_lengths(cables, tensions, out):
    """Lengths (n, m) [m] of cables with these tensions (n, m) [N], and of all in series with them.

    Of straight cables they are the spans; :func:`rest_lengths_for` is the inverse.
    """
    for r in range(cables.shape[0]):
        for i in range(cables.shape[1]):
            row, tension = cables[r, i], tensions[r, i]
            behind = winch_tension(row, tension)[0]
            out[r, i] = row[REST] * (1.0 + _strain(row, tension))
            out[r, i] += row[COMPLIANCE] * tension + row[WINCH_SIDE] / row[EA] * behind


@jit_allocating
def tensions_at_strain(cables, strain, out):
    """Tensions (n, m) [N] that strain each cable itself by ``strain``, without what has crept."""
    for r in range(cables.shape[0]):
        for i in range(cables.shape[1]):
            out[r, i] = tension_of_strain(cables[r, i], strain)[0]


@jit_inner
def _strain(row, tension):
    """Of the cable itself, with what has crept."""
    return strain_of_tension(row, tension)[0] + row[CREEP] + row[CREEP_RATE] * tension


@jit_inner
def _rest_for(row, known, span, tension, follows):
    """Rest length [m] at which a straight cable of a given span has a given tension.

    While a cable sticks, paying out changes the tension behind it and hardly that in front. So a
    wanted tension nearly always takes a length at which the cable slips, one way or the other
    (Euler-Eytelwein).

    Args:
        row: the cable at the present iterate, on which its hysteresis depends.
        known: the cable as it is in the table, with the rest length at which ``STUCK`` holds.
        span: [m]. tension: [N]. follows: as for :func:`rest_lengths_for`.
    """
    strain, soft = _strain(row, tension), row[WINCH_SIDE] / row[EA]
    left = span - row[COMPLIANCE] * tension
    if not follows or row[FRICTION] == 0.0 or soft == 0.0:
        return (left - soft * winch_tension(row, tension)[0]) / (1.0 + strain)
    grip = math.exp(row[FRICTION])
    wound_in, paid_out = left - soft * tension * grip, left - soft * tension / grip
    stuck = left - known[REST] - soft * known[STUCK]
    if stuck * (1.0 + strain) <= wound_in * strain:
        return wound_in / (1.0 + strain)
    if stuck * (1.0 + strain) >= paid_out * strain:
        return paid_out / (1.0 + strain)
    return stuck / strain
