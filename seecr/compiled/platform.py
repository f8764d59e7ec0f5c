"""Wrench, stiffness and energy of a platform on its cables, one pose at a time.

A pose is stored as the deviation from its commanded pose: a displacement of the platform origin [m]
and a rotation from the left, as a quaternion, whose small vector part keeps its digits. Rotations
enter the equations multiplied by the robot's length, so that all components of a gradient are
newtons and all steps are metres.

The coordinates of a free platform are (translation, rotation vector), both in the base frame. For a
platform on joints see :mod:`seecr.compiled.joint_kinematics`.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import rotated_less
from seecr.compiled.cable import N_WORK, cable_pull
from seecr.compiled.cable_law import is_linear
from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    ENERGY,
    EXIT,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE_OF_WEIGHT,
    GAP,
    HYSTERESIS_NOW,
    LIFT,
    PULL,
    PUSHES,
    RADIUS,
    REST,
    SLACK,
    STRAIN,
    TENSION,
    UP,
    WEIGHT,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner, jit_pasted
from seecr.compiled.joint_kinematics import (
    N_CURRENT,
    VALUE,
    joint_columns,
    onto_joints,
    place_joints,
)

# Columns of what is constant while the platform moves (see prepare), one row per cable and one for
# the load: arm of the anchor point and the point itself at the commanded pose, its distance to the
# exit point, and if the law is a linear spring its strain per stretch [1/m] and stiffness [N/m],
# else 0.
ARM, START, BEFORE, YIELD, RATE = 0, 3, 6, 7, 8
N_READY = 9
# Sine of the angle between axes that are parallel but for rounding.
_PARALLEL = 1e-9


@jit_inner
def prepare(cables, load, pose, ready):
    """Fill ``ready`` (m + 1, N_READY) with what does not change as the platform moves."""
    m = cables.shape[0]
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    for i in range(m):
        a, b, c = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        dx, dy, dz = rotated_less(w, x, y, z, a, b, c)
        ready[i, ARM], ready[i, ARM + 1], ready[i, ARM + 2] = a + dx, b + dy, c + dz
        before = 0.0
        for k in range(3):
            ready[i, START + k] = pose[k] + ready[i, ARM + k]
            before += (ready[i, START + k] - cables[i, EXIT + k]) ** 2
        ready[i, BEFORE] = math.sqrt(before)
        ready[i, YIELD] = 0.0
        straight = cables[i, WEIGHT] == 0.0 and cables[i, RADIUS] == 0.0
        if straight and cables[i, LIFT] == 0.0 and is_linear(cables[i]):
            rest, ea = cables[i, REST], cables[i, EA]
            yields = rest * cables[i, CREEP_RATE] + cables[i, COMPLIANCE]
            ready[i, YIELD] = 1.0 / (rest + ea * yields + cables[i, WINCH_SIDE])
            ready[i, RATE] = ea * ready[i, YIELD]
    a, b, c = load[CENTRE_OF_MASS], load[CENTRE_OF_MASS + 1], load[CENTRE_OF_MASS + 2]
    dx, dy, dz = rotated_less(w, x, y, z, a, b, c)
    ready[m, ARM], ready[m, ARM + 1], ready[m, ARM + 2] = a + dx, b + dy, c + dz
    ready[m, START], ready[m, START + 1], ready[m, START + 2] = pose[0], pose[1], pose[2]


@jit_inner
def _linear_pull(cables, ready, i, stretch, states):
    """Tension [N] of a linear spring; fills its state."""
    elastic = stretch - cables[i, REST] * cables[i, CREEP]
    states[i, HYSTERESIS_NOW], states[i, STRAIN] = 0.0, elastic * ready[i, YIELD]
    taut = elastic >= 0.0 or cables[i, PUSHES] == 1.0
    pull = cables[i, PULL]
    tension = pull + elastic * ready[i, RATE] if taut else 0.0
    states[i, TENSION] = states[i, WINCH_TENSION] = tension
    states[i, SLACK], states[i, ENERGY] = 0.0 if taut else 1.0, 0.5 * (tension + pull) * elastic
    return tension


@jit_inner
def _add_point(ax, ay, az, fx, fy, fz, per, gradient, hessian):
    """Add a force on a platform point to the gradient, and its geometric stiffness to the hessian.

    The point's arm is in units of the robot's length 1/per. Its path is curved under rotation,
    hence the geometric stiffness -force . d2x.
    """
    gradient[0] -= fx
    gradient[1] -= fy
    gradient[2] -= fz
    gradient[3] -= ay * fz - az * fy
    gradient[4] -= az * fx - ax * fz
    gradient[5] -= ax * fy - ay * fx
    fx, fy, fz = fx * per, fy * per, fz * per
    hessian[3, 3] += ay * fy + az * fz
    hessian[4, 4] += az * fz + ax * fx
    hessian[5, 5] += ax * fx + ay * fy
    hessian[4, 3] -= 0.5 * (fx * ay + fy * ax)
    hessian[5, 3] -= 0.5 * (fx * az + fz * ax)
    hessian[5, 4] -= 0.5 * (fy * az + fz * ay)


@jit_pasted
def _other_pull(cables, ready, load, i, dx, dy, dz, guess, work, states):
    """Force and stiffness of a cable that is no linear spring (cable_pull), in work[12:19]."""
    start, move = work[14], work[15]
    for k in range(3):
        start[k] = ready[i, START + k]
    move[0], move[1], move[2] = dx, dy, dz
    return cable_pull(
        cables[i], start, move, load[UP : UP + 3], guess[i], work, work[12], work[16:19], work[13],
        states[i],
    )  # fmt: skip


@jit_inner
def _evaluate(
    cables, ready, load, deviation, length, guess, gradient, hessian, states, slopes, work
):
    """See evaluate; for a free platform."""
    m = cables.shape[0]
    px, py, pz = deviation[0], deviation[1], deviation[2]
    w, x, y, z = deviation[3], deviation[4], deviation[5], deviation[6]
    per, energy = 1.0 / length, 0.0
    # sums in registers: gradient by translation and rotation (scaled), stiffness by translation
    # (t), by rotation (r) and mixed (m, rotation first)
    gx = gy = gz = hx = hy = hz = 0.0
    txx = txy = txz = tyy = tyz = tzz = rxx = rxy = rxz = ryy = ryz = rzz = 0.0
    mxx = mxy = mxz = myx = myy = myz = mzx = mzy = mzz = 0.0
    for i in range(m):
        ax, ay, az = ready[i, ARM], ready[i, ARM + 1], ready[i, ARM + 2]
        dx, dy, dz = rotated_less(w, x, y, z, ax, ay, az)
        ax, ay, az = (ax + dx) * per, (ay + dy) * per, (az + dz) * per
        dx, dy, dz = dx + px, dy + py, dz + pz
        if ready[i, YIELD] > 0.0:
            sx = ready[i, START] - cables[i, EXIT]
            sy = ready[i, START + 1] - cables[i, EXIT + 1]
            sz = ready[i, START + 2] - cables[i, EXIT + 2]
            growth = dx * (2.0 * sx + dx) + dy * (2.0 * sy + dy) + dz * (2.0 * sz + dz)
            ux, uy, uz = sx + dx, sy + dy, sz + dz
            now = math.sqrt(ux * ux + uy * uy + uz * uz)
            stretch = growth / (now + ready[i, BEFORE]) + cables[i, GAP]
            tension, rate = _linear_pull(cables, ready, i, stretch, states), ready[i, RATE]
            if states[i, SLACK] == 1.0:
                for k in range(6):
                    slopes[i, k] = 0.0
                continue
            inverse = 1.0 / now
            ux, uy, uz, turning = ux * inverse, uy * inverse, uz * inverse, tension * inverse
            fx, fy, fz = -tension * ux, -tension * uy, -tension * uz
            ex, ey, ez = rate * ux, rate * uy, rate * uz
            along = rate - turning
            kxx, kxy, kxz = along * ux * ux + turning, along * ux * uy, along * ux * uz
            kyy, kyz, kzz = along * uy * uy + turning, along * uy * uz, along * uz * uz + turning
        else:
            if not _other_pull(cables, ready, load, i, dx, dy, dz, guess, work, states):
                return np.inf
            if states[i, SLACK] == 1.0 and states[i, TENSION] == 0.0:
                energy += states[i, ENERGY]
                for k in range(6):
                    slopes[i, k] = 0.0
                continue
            fx, fy, fz = work[12, 0], work[12, 1], work[12, 2]
            ex, ey, ez = work[13, 0], work[13, 1], work[13, 2]
            kxx, kxy, kxz = work[16, 0], work[17, 0], work[18, 0]
            kyy, kyz, kzz = work[17, 1], work[18, 1], work[18, 2]
        energy += states[i, ENERGY]
        # J^T k J with J = [I, -[arm]x] the Jacobian of the anchor point
        xx, xy, xz = ay * kxz - az * kxy, ay * kyz - az * kyy, ay * kzz - az * kyz
        yx, yy, yz = az * kxx - ax * kxz, az * kxy - ax * kyz, az * kxz - ax * kzz
        zx, zy, zz = ax * kxy - ay * kxx, ax * kyy - ay * kxy, ax * kyz - ay * kxz
        txx, txy, txz = txx + kxx, txy + kxy, txz + kxz
        tyy, tyz, tzz = tyy + kyy, tyz + kyz, tzz + kzz
        mxx, mxy, mxz = mxx + xx, mxy + xy, mxz + xz
        myx, myy, myz = myx + yx, myy + yy, myz + yz
        mzx, mzy, mzz = mzx + zx, mzy + zy, mzz + zz
        gx, gy, gz = gx - fx, gy - fy, gz - fz
        hx, hy, hz = hx - (ay * fz - az * fy), hy - (az * fx - ax * fz), hz - (ax * fy - ay * fx)
        # and the geometric stiffness: -force . d2x
        fx, fy, fz = fx * per, fy * per, fz * per
        sx, sy, sz = fx * ax, fy * ay, fz * az
        rxx += ay * xz - az * xy + sy + sz
        ryy += az * yx - ax * yz + sz + sx
        rzz += ax * zy - ay * zx + sx + sy
        rxy += az * xx - ax * xz - 0.5 * (fx * ay + fy * ax)
        rxz += ax * xy - ay * xx - 0.5 * (fx * az + fz * ax)
        ryz += ax * yy - ay * yx - 0.5 * (fy * az + fz * ay)
        slopes[i, 0], slopes[i, 1], slopes[i, 2] = ex, ey, ez
        slopes[i, 3], slopes[i, 4] = ay * ez - az * ey, az * ex - ax * ez
        slopes[i, 5] = ax * ey - ay * ex
    g, h = gradient, hessian
    g[0], g[1], g[2], g[3], g[4], g[5] = gx, gy, gz, hx, hy, hz
    h[0, 0], h[1, 0], h[1, 1], h[2, 0], h[2, 1], h[2, 2] = txx, txy, tyy, txz, tyz, tzz
    h[3, 0], h[3, 1], h[3, 2], h[4, 0], h[4, 1], h[4, 2] = mxx, mxy, mxz, myx, myy, myz
    h[5, 0], h[5, 1], h[5, 2] = mzx, mzy, mzz
    h[3, 3], h[4, 3], h[4, 4], h[5, 3], h[5, 4], h[5, 5] = rxx, rxy, ryy, rxz, ryz, rzz
    # the weight acts at the centre of mass, the external force at the platform origin
    ax, ay, az = ready[m, ARM], ready[m, ARM + 1], ready[m, ARM + 2]
    dx, dy, dz = rotated_less(w, x, y, z, ax, ay, az)
    fx, fy, fz = load[FORCE_OF_WEIGHT], load[FORCE_OF_WEIGHT + 1], load[FORCE_OF_WEIGHT + 2]
    ax, ay, az = (ax + dx) * per, (ay + dy) * per, (az + dz) * per
    _add_point(ax, ay, az, fx, fy, fz, per, gradient, hessian)
    energy -= fx * (px + dx) + fy * (py + dy) + fz * (pz + dz)
    for k in range(3):
        energy -= load[EXTERNAL_FORCE + k] * deviation[k]
        gradient[k] -= load[EXTERNAL_FORCE + k]
        gradient[3 + k] -= load[EXTERNAL_MOMENT + k] * per
    for k in range(6):
        for r in range(k):
            hessian[r, k] = hessian[k, r]
    return energy


@jit_inner
def evaluate(
    cables, ready, load, deviation, current, length, guess, gradient, hessian, states, slopes, work
):
    """Gradient of the energy (minus the wrench) and stiffness at a deviation; and the energy.

    It is nan under a moment whose work depends on the way and if a law has none in closed form; inf
    if a cable's own equations could not be solved.

    Args:
        cables: (m, N_COLUMNS). ready: (m + 1, N_READY), prepared. load: (N_LOAD,).
        deviation: (7,) from the commanded pose. length: the robot's [m].
        current: (n, N_CURRENT) current joints, none for a free platform.
        guess: (m, 3) warm start of the catenaries. work: (N_WORK + m, 6) scratch.
        gradient: (d,) [N]; hessian: (d, d) [N/m], under a moment its symmetric part; states:
            (m, N_STATE); slopes: (m, d) [N/m] of the tensions. All are filled.
    """
    n, m = current.shape[0], cables.shape[0]
    if n == 0:
        energy = _evaluate(
            cables, ready, load, deviation, length, guess, gradient, hessian, states, slopes, work
        )
        return energy - work_of_moment(load, current, length)
    columns, g, h, own = work[19:25], work[25], work[26:32], work[N_WORK:]
    x = ready[m, START] + deviation[0]
    y, z = ready[m, START + 1] + deviation[1], ready[m, START + 2] + deviation[2]
    energy = _evaluate(cables, ready, load, deviation, length, guess, g, h, states, own, work)
    joint_columns(current, x, y, z, 1.0 / length, columns)
    onto_joints(g, h, columns, 1.0 / length, gradient, hessian)
    for i in range(m):
        for j in range(n):
            slopes[i, j] = 0.0
            for k in range(6):
                slopes[i, j] += own[i, k] * columns[j, k]
    return energy - work_of_moment(load, current, length)


@jit_allocating
def evaluate_batch(
    cables, load, poses, screws, deviation, values, length,
    gradient, hessian, states, slopes, energy, guess,
):  # fmt: skip
    """Gradient, stiffness and energy at given deviations; all outputs are filled."""
    m = cables.shape[1]
    work, ready = np.empty((N_WORK + m, 6)), np.zeros((m + 1, N_READY))
    current = np.zeros((screws.shape[1], N_CURRENT))
    for i in range(poses.shape[0]):
        prepare(cables[i], load[i], poses[i], ready)
        if screws.shape[1] > 0:
            place_joints(screws[i], values[i], length, poses[i], deviation[i], current)
        energy[i] = evaluate(
            cables[i], ready, load[i], deviation[i], current, length, guess[i],
            gradient[i], hessian[i], states[i], slopes[i], work,
        )  # fmt: skip


@jit_inner
def has_moment(load):
    """Whether there is an external moment."""
    k = EXTERNAL_MOMENT
    return load[k] != 0.0 or load[k + 1] != 0.0 or load[k + 2] != 0.0


@jit_inner
def _are_parallel(a, b):
    """Whether two vectors are parallel, to rounding."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    squares = (a[0] ** 2 + a[1] ** 2 + a[2] ** 2) * (b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
    return x * x + y * y + z * z <= _PARALLEL * _PARALLEL * squares


@jit_inner
def work_of_moment(load, current, length):
    """Work [J] of the external moment, which is constant in the base frame, on the way from the
    commanded pose; nan if it depends on the way.

    On a platform that turns freely it does: two quarter turns in either order do different work. On
    hinges its torque along joint j is M . a_j, and joint i further out turns the axis a_j. That
    torque depends on i, but that along i never on j; so there is a potential only if all torques
    are constant, that is, M . (a_i x a_j) = 0 in every pose: each two hinges are parallel, or the
    outer one is parallel to the moment. If this holds at one pose for all pairs, it does at all.
    """
    if not has_moment(load):
        return 0.0
    n, moment, work = current.shape[0], load[EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3], 0.0
    if n == 0:
        return np.nan
    for j in range(n):
        if current[j, 0] == 0.0:
            continue
        axis = current[j, 1:4]
        for i in range(j):
            outer = current[i, 1:4]
            turns = current[i, 0] == 1.0 and not _are_parallel(outer, axis)
            if turns and not _are_parallel(outer, moment):
                return np.nan
        torque = moment[0] * axis[0] + moment[1] * axis[1] + moment[2] * axis[2]
        work += torque * current[j, VALUE] / length
    return work


@jit
def add_skew(load, current, length, matrix):
    """Add the skew part of the stiffness due to a constant moment to its symmetric part.

    An axis a_j rotates with the axes further out; a step's rotation vector shares that evenly:
    -M . (a_i x a_j)/2 in row j of column i, and the opposite in row i of column j. For a free
    platform, whose axes are those of the base frame, this is -[M]x/2.
    """
    mx = 0.5 * load[EXTERNAL_MOMENT] / length**2
    my = 0.5 * load[EXTERNAL_MOMENT + 1] / length**2
    mz = 0.5 * load[EXTERNAL_MOMENT + 2] / length**2
    if current.shape[0] == 0:
        matrix[3, 4] += mz
        matrix[4, 3] -= mz
        matrix[4, 5] += mx
        matrix[5, 4] -= mx
        matrix[5, 3] += my
        matrix[3, 5] -= my
        return
    for j in range(current.shape[0]):
        for i in range(j):
            if current[i, 0] == 0.0 or current[j, 0] == 0.0:
                continue
            part = mx * (current[i, 2] * current[j, 3] - current[i, 3] * current[j, 2])
            part += my * (current[i, 3] * current[j, 1] - current[i, 1] * current[j, 3])
            part += mz * (current[i, 1] * current[j, 2] - current[i, 2] * current[j, 1])
            matrix[j, i] -= part
            matrix[i, j] += part
