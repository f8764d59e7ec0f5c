"""Effect of a change of the tables at fixed poses, evaluated only for the cables that changed.

A parameter usually changes a few cables. The others pull the same before and after, so only those
whose rows differ are evaluated, before and after, and subtracted. Their forces are those of
:func:`seecr.compiled.cable.cable_pull`. Nothing is solved, so no stiffness is assembled.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.algebra import copy_vector
from seecr.compiled.cable import cable_pull
from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE_OF_WEIGHT,
    N_STATE,
    TENSION,
    UP,
)
from seecr.compiled.jit import jit_allocating, jit_inner, jit_merged
from seecr.compiled.joints import N_CURRENT, joint_columns, onto_joints_gradient, place_joints
from seecr.compiled.platform import N_WORK
from seecr.compiled.rotation import rotated_less


@jit_allocating
def make_change_space(joints):
    """Scratch arrays, made once per batch."""
    return (
        np.empty(7), np.zeros((joints, N_CURRENT)), np.empty((joints, 6)), np.empty(3), np.empty(3),
        np.empty(3), np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(N_STATE),
        np.empty((N_WORK, 6)), np.empty(6), np.empty(7), np.zeros(6),
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


@jit_allocating
def change_at_rest(
    plus, minus, plus_load, minus_load, poses, screws, deviation, values, length, guess,
    gradient, tension,
):  # fmt: skip
    """Gradient (n, d) and tensions (n, m) of ``plus`` minus ``minus``; NaN where unsolved.

    All outputs are filled.
    """
    n, m = plus.shape[:2]
    space, per = make_change_space(screws.shape[1]), 1.0 / length
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


@jit_allocating
def change_of_each_cable(
    plus, minus, load, poses, screws, deviation, values, length, guess, gradient, tension
):
    """The same cable by cable: gradient (n, m, d), each cable's own tension (n, m).

    The load is taken to be the same in both.
    """
    n, m = plus.shape[:2]
    space, per = make_change_space(screws.shape[1]), 1.0 / length
    for r in range(n):
        place_platform(screws[r], values[r], length, poses[r], deviation[r], space)
        up = load[r, UP:]
        for i in range(m):
            space[11][:] = 0.0
            ahead = add_pull(1.0, plus[r, i], poses[r], up, per, guess[r, i], space)
            behind = add_pull(-1.0, minus[r, i], poses[r], up, per, guess[r, i], space)
            tension[r, i] = ahead + behind
            put_gradient(space, gradient[r, i])
