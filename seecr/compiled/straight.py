"""The balance of platforms on straight cables, and how it changes when they turn.

A straight cable's direction does not depend on its tension, so no cable law is needed here.
Functions share scratch arrays, those of make_turning_space.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import copy_vector, norm
from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    EXIT,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE_OF_WEIGHT,
)
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.joints import N_CURRENT, joint_columns, onto_joints_gradient
from seecr.compiled.rotation import quaternion_product, rotated_less
from seecr.compiled.steps import advance


@jit_inner
def _onto(own, columns, out):
    """From the platform's own (6,) to its coordinates (d,)."""
    if columns.shape[0] == 0:
        copy_vector(own, out)
    else:
        onto_joints_gradient(own, columns, out)


@jit_inner
def _moment(ax, ay, az, per, own):
    """Complete a force in ``own`` (6,) by its moment about the platform's origin."""
    own[3] = (ay * own[2] - az * own[1]) * per
    own[4] = (az * own[0] - ax * own[2]) * per
    own[5] = (ax * own[1] - ay * own[0]) * per


@jit_inner
def balance_straight(cables, load, pose, place, length, space):
    """Fill the pulls (m, d), weight (d,), spans (m,) and arms (m + 1, 3), the last the weight's.

    The balance is pulls^T tau = weight.
    """
    current, columns, own, pulls, weight, spans = space[0:6]
    arms, per, m = space[23], 1.0 / length, cables.shape[0]
    px, py, pz = pose[0] + place[0], pose[1] + place[1], pose[2] + place[2]
    qw, qx, qy, qz = quaternion_product(
        place[3], place[4], place[5], place[6], pose[3], pose[4], pose[5], pose[6]
    )
    if current.shape[0] > 0:
        joint_columns(current, px, py, pz, per, columns)
    for i in range(m + 1):
        if i < m:
            a, b, c = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        else:
            a, b, c = load[CENTRE_OF_MASS], load[CENTRE_OF_MASS + 1], load[CENTRE_OF_MASS + 2]
        dx, dy, dz = rotated_less(qw, qx, qy, qz, a, b, c)
        a, b, c = a + dx, b + dy, c + dz
        arms[i, 0], arms[i, 1], arms[i, 2] = a, b, c
        if i < m:
            own[0], own[1] = px + a - cables[i, EXIT], py + b - cables[i, EXIT + 1]
            own[2] = pz + c - cables[i, EXIT + 2]
            spans[i] = max(math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2), 1e-12 * length)
            for k in range(3):
                own[k] /= spans[i]
            _moment(a, b, c, per, own)
            _onto(own, columns, pulls[i])
        else:
            for k in range(3):
                own[k] = load[FORCE_OF_WEIGHT + k]
            _moment(a, b, c, per, own)
            for k in range(3):
                own[k] += load[EXTERNAL_FORCE + k]
                own[3 + k] += load[EXTERNAL_MOMENT + k] * per
            _onto(own, columns, weight)


@jit_inner
def left_of(space, tension, left):
    """Residual (d,) [N] of the balance; returns its norm."""
    pulls, weight = space[3], space[4]
    for k in range(left.shape[0]):
        left[k] = -weight[k]
        for i in range(tension.shape[0]):
            left[k] += pulls[i, k] * tension[i]
    return norm(left)


@jit_inner
def _turned_arm(axis, a, b, c):
    """Its velocity e x arm when it turns about a base axis e."""
    if axis == 0:
        return 0.0, -c, b
    return (c, 0.0, -a) if axis == 1 else (-b, a, 0.0)


@jit_inner
def _add_rate(part, per, a, b, c, da, db, dc, fx, fy, fz, vx, vy, vz, out):
    """Add a part of the rates (6,) of a force f at an arm, from the velocities of both."""
    out[0] += part * vx
    out[1] += part * vy
    out[2] += part * vz
    out[3] += part * per * (db * fz - dc * fy + b * vz - c * vy)
    out[4] += part * per * (dc * fx - da * fz + c * vx - a * vz)
    out[5] += part * per * (da * fy - db * fx + a * vy - b * vx)


@jit_inner
def rates_of_rotations(load, length, scale, tension, space):
    """The rates of a free platform by its rotations, at the state that the balance is of.

    The direction u of a cable of span s turns by (e x a - u (u . (e x a))) / s.
    """
    pulls, spans, rates, arms, m = space[3], space[5], space[13], space[23], tension.shape[0]
    per = 1.0 / length
    for axis in range(3):
        for k in range(6):
            rates[axis, k] = 0.0
        for i in range(m):
            a, b, c = arms[i, 0], arms[i, 1], arms[i, 2]
            da, db, dc = _turned_arm(axis, a, b, c)
            x, y, z = pulls[i, 0], pulls[i, 1], pulls[i, 2]
            along, one = x * da + y * db + z * dc, 1.0 / spans[i]
            vx, vy, vz = one * (da - along * x), one * (db - along * y), one * (dc - along * z)
            part = tension[i] / scale
            _add_rate(part, per, a, b, c, da, db, dc, x, y, z, vx, vy, vz, rates[axis])
        a, b, c = arms[m, 0], arms[m, 1], arms[m, 2]
        da, db, dc = _turned_arm(axis, a, b, c)
        x, y, z = load[FORCE_OF_WEIGHT], load[FORCE_OF_WEIGHT + 1], load[FORCE_OF_WEIGHT + 2]
        _add_rate(-1.0 / scale, per, a, b, c, da, db, dc, x, y, z, 0.0, 0.0, 0.0, rates[axis])


@jit_allocating
def make_turning_space(m, d, joints, turns):
    """Scratch arrays, made once per batch."""
    n = turns + m
    return (
        np.zeros((joints, N_CURRENT)), np.zeros((joints, 6)), np.empty(6), np.empty((m, d)),
        np.empty(d), np.empty(m), np.empty(d), np.empty(7), np.empty(d), np.empty(d), np.empty(d),
        np.empty((d, d)), np.empty((d, d)), np.empty((n, d)), np.empty((n, n)), np.empty((n, n)),
        np.empty(n), np.empty(n), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
        np.empty((m + 1, 3)),
    )  # fmt: skip


@jit_allocating
def straight_balance_batch(
    cables, load, poses, screws, rows, away, length, matrices, loads
):  # fmt: skip
    """The balance of platforms on straight cables at k displaced poses; fills the last two.

    Args:
        cables: (n, m, N_COLUMNS). load: (n, N_LOAD). poses: (n, 7). screws: (n, d or 0, 7).
        rows: (k,) which of these each displacement is for.
        away: (k, d) [m] displacements of a step's kind, rotations times the length.
        length: [m].
        matrices: (k, d, m), loads: (k, d) [N], torques over the length: matrix tau = load.
    """
    m, d = cables.shape[1], loads.shape[1]
    joints, still, values = screws.shape[1], np.zeros(7), np.zeros(d)
    space = make_turning_space(m, d, joints, joints)  # nothing is turned
    place, trial_values = space[7], space[8]
    still[3] = 1.0
    for r in range(rows.shape[0]):
        row = rows[r]
        advance(
            still, values, away[r], length, screws[row], poses[row], place, trial_values, space[0]
        )
        balance_straight(cables[row], load[row], poses[row], place, length, space)
        for k in range(d):
            loads[r, k] = space[4][k]
            for i in range(m):
                matrices[r, k, i] = space[3][i, k]
