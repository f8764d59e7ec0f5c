"""What each cable pulls with at a pose, and how that changes as its ends or its length do.

A cable's force depends on where its anchor point is as seen from its exit point, and on its rest
length. So one evaluation of each cable serves all parameters that move a point or pay out cable.
Nothing is solved; columns OF_THE_PAST are fixed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from seecr.compiled.algebra import copy_vector, rotated_less, solve_3x3
from seecr.compiled.cable import N_WORK, cable_pull
from seecr.compiled.cable_law import (
    along,
    dahl,
    series_length,
    strain_of_tension,
    tension_of_strain,
    winch_tension,
)
from seecr.compiled.columns import (
    ANCHOR,
    ARM,
    BY_REST,
    CENTRE_OF_MASS,
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE,
    FORCE_OF_WEIGHT,
    FRICTION,
    HYSTERESIS,
    LIFT,
    N_STATE,
    PUSHES,
    REST,
    SLACK,
    SLOPE,
    STIFFNESS,
    STRAIN,
    STUCK,
    TENSION,
    TENSION_BY_REST,
    UP,
    WEIGHT,
    WINCH_SIDE,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner, jit_merged
from seecr.compiled.joint_kinematics import (
    N_CURRENT,
    joint_columns,
    onto_joints_gradient,
    place_joints,
)

# Effect of a change of the tables at fixed poses, evaluated only for the cables that changed.
#
# A parameter usually changes a few cables. The others pull the same before and after, so only
# those whose rows differ are evaluated, before and after, and subtracted. Their forces are those
# of seecr.compiled.cable.cable_pull. Nothing is solved, so no stiffness is assembled.


def change_space(screws: Any) -> tuple[Any, ...]:
    """Scratch arrays of a batch. NumPy makes them: what creates arrays takes longer to compile."""
    joints = screws.shape[1]
    return (
        np.empty(7), np.zeros((joints, N_CURRENT)), np.empty((joints, 6)), np.empty(3), np.empty(3),
        np.empty(3), np.empty(3), np.empty((3, 6)), np.empty(3), np.empty(N_STATE),
        np.empty((N_WORK, 6)), np.empty(6), np.empty(7), np.zeros(6),
        np.empty(6),
    )  # fmt: skip


@jit_inner
def differ(a, b):
    found = False
    for c in range(a.shape[0]):
        found = found or a[c] != b[c]
    return found


@jit_inner
def place_platform(screws, values, length, pose, deviation, space):
    """Fill the scratch arrays with the platform's deviation and its joints."""
    place, current, columns = space[0], space[1], space[2]
    copy_vector(deviation, place)
    if screws.shape[0] > 0:
        place_joints(screws, values, length, pose, place, current)
        x, y, z = pose[0] + place[0], pose[1] + place[1], pose[2] + place[2]
        joint_columns(current, x, y, z, 1.0 / length, columns)


@jit_inner
def moved_arm(point, pose, place):
    """Arm (3,) of a platform point at the commanded pose, and its change up to the current pose."""
    a, b, c = point[0], point[1], point[2]
    dx, dy, dz = rotated_less(pose[3], pose[4], pose[5], pose[6], a, b, c)
    a, b, c = a + dx, b + dy, c + dz
    dx, dy, dz = rotated_less(place[3], place[4], place[5], place[6], a, b, c)
    return a, b, c, dx, dy, dz


@jit_inner
def take_force(ax, ay, az, fx, fy, fz, per, gradient):
    """Subtract a force on a platform point with a given arm from the gradient (6,)."""
    gradient[0] -= fx
    gradient[1] -= fy
    gradient[2] -= fz
    gradient[3] -= (ay * fz - az * fy) * per
    gradient[4] -= (az * fx - ax * fz) * per
    gradient[5] -= (ax * fy - ay * fx) * per


@jit_merged
def add_pull(sign, row, pose, up, per, guess, space):
    """Add a cable's part times ``sign`` to the gradient (6,); returns that of its tension."""
    place, start, move, keep = space[0], space[3], space[4], space[5]
    force, stiffness, slope, state, work, gradient = space[6:12]
    a, b, c, dx, dy, dz = moved_arm(row[ANCHOR : ANCHOR + 3], pose, place)
    start[0], start[1], start[2] = pose[0] + a, pose[1] + b, pose[2] + c
    move[0], move[1], move[2] = place[0] + dx, place[1] + dy, place[2] + dz
    copy_vector(guess, keep)
    if not cable_pull(row, start, move, up, keep, work, force, stiffness, slope, state):
        gradient[0] = np.nan
        return np.nan
    fx, fy, fz = sign * force[0], sign * force[1], sign * force[2]
    take_force(a + dx, b + dy, c + dz, fx, fy, fz, per, gradient)
    return sign * state[TENSION]


@jit_inner
def add_load(sign, load, pose, per, space):
    """Add the contribution of the weight and the external wrench, times ``sign``."""
    place, gradient = space[0], space[11]
    a, b, c, dx, dy, dz = moved_arm(load[CENTRE_OF_MASS : CENTRE_OF_MASS + 3], pose, place)
    fx, fy, fz = load[FORCE_OF_WEIGHT], load[FORCE_OF_WEIGHT + 1], load[FORCE_OF_WEIGHT + 2]
    take_force(a + dx, b + dy, c + dz, sign * fx, sign * fy, sign * fz, per, gradient)
    for k in range(3):
        gradient[k] -= sign * load[EXTERNAL_FORCE + k]
        gradient[3 + k] -= sign * load[EXTERNAL_MOMENT + k] * per


@jit_inner
def put_gradient(space, out):
    """Write the accumulated gradient to ``out`` (d,), projected onto the joints if any."""
    columns, gradient = space[2], space[11]
    if columns.shape[0] == 0:
        copy_vector(gradient, out)
    else:
        onto_joints_gradient(gradient, columns, out)


@jit
def change_at_rest(
    plus, minus, plus_load, minus_load, poses, screws, deviation, values, length, guess,
    gradient, tension, space,
):  # fmt: skip
    """Gradient (n, d) and tensions (n, m) of ``plus`` minus ``minus``; NaN where unsolved.

    All outputs are filled; for ``space`` see change_space.
    """
    n, m = plus.shape[:2]
    per = 1.0 / length
    for r in range(n):
        space[11][:] = 0.0
        place_platform(screws[r], values[r], length, poses[r], deviation[r], space)
        up, down = plus_load[r, UP:], minus_load[r, UP:]
        turned = differ(up, down)
        for i in range(m):
            tension[r, i] = 0.0
            if turned or differ(plus[r, i], minus[r, i]):
                ahead = add_pull(1.0, plus[r, i], poses[r], up, per, guess[r, i], space)
                behind = add_pull(-1.0, minus[r, i], poses[r], down, per, guess[r, i], space)
                tension[r, i] = ahead + behind
        if differ(plus_load[r], minus_load[r]):
            add_load(1.0, plus_load[r], poses[r], per, space)
            add_load(-1.0, minus_load[r], poses[r], per, space)
        put_gradient(space, gradient[r])


@jit
def change_of_each_cable(
    plus, minus, load, poses, screws, deviation, values, length, guess, gradient, tension, space
):
    """The same cable by cable: gradient (n, m, d), each cable's own tension (n, m).

    The load is taken to be the same in both.
    """
    n, m = plus.shape[:2]
    per = 1.0 / length
    for r in range(n):
        place_platform(screws[r], values[r], length, poses[r], deviation[r], space)
        up = load[r, UP:]
        for i in range(m):
            space[11][:] = 0.0
            ahead = add_pull(1.0, plus[r, i], poses[r], up, per, guess[r, i], space)
            behind = add_pull(-1.0, minus[r, i], poses[r], up, per, guess[r, i], space)
            tension[r, i] = ahead + behind
            put_gradient(space, gradient[r, i])


# A cable's rest length: how pull and tension change with it, and the one that gives a tension.
#
# The derivatives are those of the cable's own equations at a fixed pose, by the implicit function
# theorem: with E(x, l0) = 0 for its unknowns x, dx/dl0 = -(dE/dx)^-1 dE/dl0. Columns OF_THE_PAST
# are fixed.

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
    if state[SLACK] != 0.0 or row[PUSHES] != 0.0:  # no winch changes what pushes
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


@jit
def pull_and_change(
    cables, load, poses, screws, deviation, values, length, guess, gradient, pulls, by_length,
    tension, space,
):  # fmt: skip
    """Gradient (n, d) and tensions (n, m) [N], and their derivatives by each cable's rest length.

    These [N/m] are ``by_length`` (n, m, d) of the gradient and ``tension`` (n, m) of each cable's
    own; NaN where a cable's equations could not be solved. All four are filled, and ``guess`` (n,
    m, 3).
    """
    n, m = cables.shape[:2]
    per, total = 1.0 / length, space[14]
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
    the span: to rounding, or to some nanometres where a cable with hysteresis sticks. If it
    ``follows``, the tension behind a cable that sticks is ``STUCK`` only at the rest length in the
    table, and changes with what is paid out; otherwise it is that at any length.
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
    (Euler-Eytelwein). ``row`` is the cable at the present iterate, on which its hysteresis depends,
    ``known`` that at whose rest length ``STUCK`` holds.
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


@jit
def rates_of_each_cable(cables, load, poses, screws, deviation, values, length, guess, out, space):
    """Fill ``out`` (n, m, N_RATES); NaN where a cable's equations could not be solved."""
    n, m = cables.shape[:2]
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
