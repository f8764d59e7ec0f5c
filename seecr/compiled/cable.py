"""One cable in space: the force on its anchor point, and its stiffness there.

A cable is a row of a table (:mod:`seecr.compiled.columns`). It runs from its exit point A, over a
swivelling pulley of radius r if there is one, to its anchor point B.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import next_within, solve_3x3
from seecr.compiled.cable_law import (
    along,
    length_in_plane,
    lift_slope,
    lowered,
    pulley_geometry,
    soften,
    straight_law,
    strain_of_tension,
    winch_tension,
)
from seecr.compiled.catenary import catenary_energy, guess_by_brackets, solve_catenary
from seecr.compiled.columns import (
    ENERGY,
    GAP,
    HYSTERESIS_NOW,
    LIFT,
    N_COLUMNS,
    N_STATE,
    RADIUS,
    REST,
    SLACK,
    STRAIN,
    TENSION,
    WEIGHT,
    WINCH_TENSION,
)
from seecr.compiled.jit import (
    COMPILES,
    by_address,
    carray,
    jit,
    jit_inner,
    jit_pasted,
)

# Most Newton steps for the lift of an exit point, of which two or three suffice where a cable stays
# taut; errors [of the rest length] at which they end, and of a lift that was found.
_LIFTINGS, _LIFTED, _LIFTED_ENOUGH = 50, 1e-15, 1e-12

# Most Newton steps for a catenary, from a start that may be a bad one, and from the last.
_FEW, _MANY = 20, 200

# Rows of scratch for a cable and all that is done with it.
N_WORK = 34


@jit_pasted
def _pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    """Force of a cable on its anchor point, its stiffness, and the gradient of its tension.

    Args:
        row: the cable (N_COLUMNS,).
        start, move: (3,) [m] its anchor point at the commanded pose, base frame, and displacement
            from there. They are separate, since the stretch of a stiff cable would be lost in the
            rounding of absolute coordinates.
        up: (3,) unit vector against gravity.
        guess: (3,) start of the catenary, overwritten with its solution.
        work: (N_WORK, 6) scratch.
        force: (3,) [N].
        stiffness: (3, 6) of which the first three columns are filled [N/m]: minus the derivative
            of the force by ``move``; with weight over a pulley its symmetric part, see
            :func:`seecr.compiled.catenary.catenary_energy`.
        gradient: (3,) [N/m], derivative of the reported tension by ``move``. state: (N_STATE,).

    Returns:
        False if the cable's own equations could not be solved.
    """
    seen, more = work[32], row[LIFT]
    lift, hanging = 0.0, row[WEIGHT] * row[REST]
    low, high, before = -np.inf, np.inf, np.inf
    for _ in range(_LIFTINGS):
        lowered(move, lift, up, seen)
        if not _fixed_pull(row, start, seen, up, guess, work, force, stiffness, gradient, state):
            return False
        if more == 0.0:
            return True
        pull = -along(up, force) - hanging
        error = lift - more * pull
        if abs(error) <= _LIFTED * row[REST]:
            break
        # the error grows with the lift, but has kinks
        if error > 0.0:
            high = lift
        else:
            low = lift
        newton = lift - error / lift_slope(more, up, stiffness)
        following = next_within(low, high, lift, newton, before)
        if following in (low, high) or not math.isfinite(following):
            break
        before, lift = abs(following - lift), following
    if not abs(error) <= _LIFTED_ENOUGH * row[REST]:
        return False
    soften(more, up, stiffness, gradient, work[33])
    # energy of the yielding frame, and of the cable's weight that is lifted with it
    state[ENERGY] += lift * (0.5 * pull + hanging)
    return True


@jit_pasted
def _fixed_pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    """See cable_pull; for a cable whose exit point is not lifted."""
    if row[WEIGHT] > 0.0:
        return _catenary_pull(row, start, move, up, guess, work, force, stiffness, gradient, state)
    if row[RADIUS] > 0.0:
        return _pulley_pull(row, start, move, up, work, force, stiffness, gradient, state)
    return _straight_pull(row, start, move, force, stiffness, gradient, state)


@jit_pasted
def _straight_pull(row, start, move, force, stiffness, gradient, state):
    before2, growth, now2 = 0.0, 0.0, 0.0
    for k in range(3):
        d0 = start[k] - row[k]
        growth += move[k] * (2.0 * d0 + move[k])
        before2 += d0 * d0
        now2 += (d0 + move[k]) ** 2
    now = math.sqrt(now2)
    stretch = growth / (now + math.sqrt(before2)) + row[GAP]
    tension, rate = straight_law(row, stretch, state)
    for i in range(3):
        ui = (start[i] - row[i] + move[i]) / now
        force[i] = -tension * ui
        gradient[i] = rate * ui
        for j in range(3):
            uj = (start[j] - row[j] + move[j]) / now
            stiffness[i, j] = (rate - tension / now) * ui * uj
        stiffness[i, i] += tension / now
    return True


@jit_inner
def _plane(row, start, move, up, out):
    """Plane of a cable: out = horizontal direction (3,) away from A; returns across, rise."""
    rise = 0.0
    for k in range(3):
        out[k] = start[k] - row[k] + move[k]
        rise += out[k] * up[k]
    across = 0.0
    for k in range(3):
        out[k] -= rise * up[k]
        across += out[k] * out[k]
    across = math.sqrt(across)
    if across > 0.0:
        for k in range(3):
            out[k] /= across
        return across, rise
    # straight below the exit point any plane will do
    pick = 0 if abs(up[0]) < 0.9 else 1
    for k in range(3):
        out[k] = (1.0 if k == pick else 0.0) - up[pick] * up[k]
    return across, rise


@jit_inner
def _lift(row, across, rise, e, up, f, k2, g2, force, stiffness, gradient):
    """From the cable's plane to the base frame: f = force, k2 = stiffness, g2 = gradient."""
    # rotation of the plane about the vertical through A gives the stiffness -f_across/across
    # sideways
    side = -f[0] / max(across, 1e-9 * row[REST])
    for i in range(3):
        force[i] = f[0] * e[i] + f[1] * up[i]
        gradient[i] = g2[0] * e[i] + g2[1] * up[i]
        for j in range(3):
            sideways = -e[i] * e[j] - up[i] * up[j]
            if i == j:
                sideways += 1.0
            stiffness[i, j] = (
                k2[0] * e[i] * e[j]
                + k2[1] * (e[i] * up[j] + up[i] * e[j])
                + k2[2] * up[i] * up[j]
                + side * sideways
            )


@jit_pasted
def _pulley_pull(row, start, move, up, work, force, stiffness, gradient, state):
    e, f, k2, g2 = work[0], work[1], work[2], work[3]
    across, rise = _plane(row, start, move, up, e)
    length, free, tx, tz = pulley_geometry(across, rise, row[RADIUS])
    tension, rate = straight_law(row, length - row[REST], state)
    f[0], f[1] = -tension * tx, -tension * tz
    g2[0], g2[1] = rate * tx, rate * tz
    # a motion across the tangent turns it by 1/free
    turn = tension / max(free, 1e-9 * row[REST])
    k2[0] = rate * tx * tx + turn * tz * tz
    k2[1] = (rate - turn) * tx * tz
    k2[2] = rate * tz * tz + turn * tx * tx
    _lift(row, across, rise, e, up, f, k2, g2, force, stiffness, gradient)
    return True


@jit_pasted
def _catenary(row, across, rise, guess, error, jacobian, work):
    """A catenary from its guess, else a first one, else brackets; patiently only in the end."""
    for attempt in range(4):  # one call: each would be compiled into all that needs cables
        if attempt == 2:
            guess_by_brackets(row, across, rise, guess)
        elif attempt > 0:
            guess[2] = 0.0  # a first guess is made
        most = _FEW if attempt < 2 else _MANY
        if solve_catenary(row, across, rise, most, guess, error, jacobian, work):
            return True
    return False


@jit_pasted
def _catenary_pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    e, f, k2, g2 = work[0], work[1], work[2], work[3]
    across, rise = _plane(row, start, move, up, e)
    flat = max(across, 1e-9 * row[REST])
    jacobian = work[4:7]
    error, scratch = work[7], work[8:10]
    if not _catenary(row, flat, -rise, guess, error, jacobian, scratch):
        return False
    h, v, length = guess[0], guess[1], guess[2]
    top = v + row[WEIGHT] * length
    tension = math.sqrt(h * h + top * top)
    f[0], f[1] = -h, v
    # columns of the inverse Jacobian: derivatives of the unknowns by across and by -rise
    by_across, by_drop = work[10], work[11]
    error[0], error[1], error[2] = 1.0, 0.0, 0.0
    solve_3x3(jacobian, error, by_across)
    error[0], error[1] = 0.0, 1.0
    solve_3x3(jacobian, error, by_drop)
    k2[0] = by_across[0]
    k2[1] = 0.5 * (-by_drop[0] - by_across[1])
    k2[2] = by_drop[1]
    w = row[WEIGHT]
    for k in range(2):
        column = by_across if k == 0 else by_drop
        change = (h * column[0] + top * (column[1] + w * column[2])) / tension
        g2[k] = change if k == 0 else -change
    _lift(row, flat, rise, e, up, f, k2, g2, force, stiffness, gradient)
    state[TENSION] = tension
    state[ENERGY] = catenary_energy(row, guess, -rise, along(up, move))
    state[WINCH_TENSION] = winch_tension(row, tension)[0]
    stretch = length_in_plane(row, across, rise) - row[REST]
    state[STRAIN], _slope, state[HYSTERESIS_NOW] = strain_of_tension(row, tension)
    state[SLACK] = 1.0 if stretch < 0.0 else 0.0
    return True


# A cable's law is large. To compile it into each function that needs cables, and into all that call
# these, took 20 s of a first diagnosis.


def _pull_there(row, start, move, up, guess, work, force, stiffness, gradient, state):
    return _pull(
        carray(row, N_COLUMNS), carray(start, 3), carray(move, 3), carray(up, 3), carray(guess, 3),
        carray(work, (N_WORK, 6)), carray(force, 3), carray(stiffness, (3, 6)),
        carray(gradient, 3), carray(state, N_STATE),
    )  # fmt: skip


@jit
def cable_pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    """What :func:`_pull` does, for arrays without gaps of at least the shapes given there."""
    return _called(
        row.ctypes, start.ctypes, move.ctypes, up.ctypes, guess.ctypes, work.ctypes, force.ctypes,
        stiffness.ctypes, gradient.ctypes, state.ctypes,
    )  # fmt: skip


if COMPILES:
    _called = by_address("seecr_cable_pull", _pull_there)  # type: ignore[no-untyped-call]
else:
    cable_pull = _pull
