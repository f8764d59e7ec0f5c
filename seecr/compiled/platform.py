"""Wrench, stiffness and energy of a platform on its cables, compiled: one pose at a time.

A pose is kept as the deviation from its commanded pose: a displacement of the platform origin
[m] and a rotation from the left, as a quaternion whose small vector part keeps its digits.
Rotations enter the equations multiplied by the robot's length, so that all components of a
gradient are newtons and all steps are metres.

A free platform steps in (translation, rotation vector), both in the base frame. A platform on
slide and hinge joints steps in its joint values, times the length for hinges: the first joint
is the outermost, as in MJCF.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from seecr.compiled.law import (
    ANCHOR,
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    ENERGY,
    EXIT,
    GAP,
    HYSTERESIS_NOW,
    RADIUS,
    REST,
    SLACK,
    STRAIN,
    TENSION,
    WEIGHT,
    WINCH_SIDE,
    WINCH_TENSION,
    cable_pull,
    is_linear,
)

# Entries of the load of a pose.
FORCE_OF_WEIGHT, CENTRE_OF_MASS, EXTERNAL_FORCE, EXTERNAL_MOMENT, UP = 0, 3, 6, 9, 12
N_LOAD = 15
# Columns of what stays as the platform moves (see prepare), a row a cable and one for the load:
# arm of the anchor point and the point itself at the commanded pose, its distance to the exit
# point, and where the law is a linear spring its strain per stretch [1/m] and stiffness [N/m],
# else 0.
ARM, START, BEFORE, YIELD, RATE = 0, 3, 6, 7, 8
N_READY = 9
# Rows of scratch that evaluate needs.
N_WORK = 32

_jit = njit(cache=True, nogil=True, error_model="numpy")


@_jit
def _rotated_less(w, x, y, z, a, b, c):
    cx, cy, cz = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        2.0 * (w * cx + y * cz - z * cy),
        2.0 * (w * cy + z * cx - x * cz),
        2.0 * (w * cz + x * cy - y * cx),
    )


@_jit
def rotate_less(q, v, out):
    """(R(q) - I) v for a unit quaternion: exact for small rotations."""
    out[0], out[1], out[2] = _rotated_less(q[0], q[1], q[2], q[3], v[0], v[1], v[2])


@_jit
def _product(a, b, c, d, w, x, y, z):
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


@_jit
def turned(x, y, z, a, b, c, d):
    """exp(rotation vector) times a quaternion, of unit length."""
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    s = 0.5 if half < 1e-8 else math.sin(half) / angle
    a, b, c, d = _product(math.cos(half), s * x, s * y, s * z, a, b, c, d)
    inverse = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inverse, b * inverse, c * inverse, d * inverse


@_jit
def turn(rotvec, q, out):
    """out = exp(rotvec) q, of unit length."""
    out[0], out[1], out[2], out[3] = turned(rotvec[0], rotvec[1], rotvec[2], q[0], q[1], q[2], q[3])


@_jit
def place_joints(screws, values, length, origin, deviation, current):
    """Deviation (7,) of a jointed platform, and its joints as they stand there.

    The platform moves by E_1 E_2 ... E_n, E_j along or about joint j as it stands at the
    commanded pose (product of exponentials); ``screws`` and ``current`` are (n, 7): kind (0
    slide, 1 hinge), axis, point.
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    mx = my = mz = 0.0
    ox, oy, oz = origin[0], origin[1], origin[2]
    for j in range(screws.shape[0]):
        ax, ay, az = screws[j, 1], screws[j, 2], screws[j, 3]
        px, py, pz = screws[j, 4], screws[j, 5], screws[j, 6]
        sx, sy, sz = _rotated_less(w, x, y, z, ax, ay, az)
        nx, ny, nz = ax + sx, ay + sy, az + sz
        current[j, 0], current[j, 1], current[j, 2], current[j, 3] = screws[j, 0], nx, ny, nz
        sx, sy, sz = _rotated_less(w, x, y, z, px - ox, py - oy, pz - oz)
        current[j, 4], current[j, 5], current[j, 6] = px + sx + mx, py + sy + my, pz + sz + mz
        if screws[j, 0] == 0.0:
            mx, my, mz = mx + nx * values[j], my + ny * values[j], mz + nz * values[j]
            continue
        angle = values[j] / length
        a, b, c, d = turned(ax * angle, ay * angle, az * angle, 1.0, 0.0, 0.0, 0.0)
        # the platform's origin goes round the hinge, as the joints before have turned that
        sx, sy, sz = _rotated_less(a, b, c, d, ox - px, oy - py, oz - pz)
        tx, ty, tz = _rotated_less(w, x, y, z, sx, sy, sz)
        mx, my, mz = mx + sx + tx, my + sy + ty, mz + sz + tz
        w, x, y, z = _product(w, x, y, z, a, b, c, d)
    deviation[0], deviation[1], deviation[2] = mx, my, mz
    deviation[3], deviation[4], deviation[5], deviation[6] = w, x, y, z


@_jit
def prepare(cables, load, pose, ready):
    """Fill ``ready`` (m + 1, N_READY) with what stays as the platform moves from a command."""
    m = cables.shape[0]
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    for i in range(m):
        a, b, c = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        dx, dy, dz = _rotated_less(w, x, y, z, a, b, c)
        ready[i, ARM], ready[i, ARM + 1], ready[i, ARM + 2] = a + dx, b + dy, c + dz
        before = 0.0
        for k in range(3):
            ready[i, START + k] = pose[k] + ready[i, ARM + k]
            before += (ready[i, START + k] - cables[i, EXIT + k]) ** 2
        ready[i, BEFORE] = math.sqrt(before)
        ready[i, YIELD] = 0.0
        if cables[i, WEIGHT] == 0.0 and cables[i, RADIUS] == 0.0 and is_linear(cables[i]):
            rest, ea = cables[i, REST], cables[i, EA]
            yields = rest * cables[i, CREEP_RATE] + cables[i, COMPLIANCE]
            ready[i, YIELD] = 1.0 / (rest + ea * yields + cables[i, WINCH_SIDE])
            ready[i, RATE] = ea * ready[i, YIELD]
    a, b, c = load[CENTRE_OF_MASS], load[CENTRE_OF_MASS + 1], load[CENTRE_OF_MASS + 2]
    dx, dy, dz = _rotated_less(w, x, y, z, a, b, c)
    ready[m, ARM], ready[m, ARM + 1], ready[m, ARM + 2] = a + dx, b + dy, c + dz
    ready[m, START], ready[m, START + 1], ready[m, START + 2] = pose[0], pose[1], pose[2]


@_jit
def _linear_pull(cables, ready, i, stretch, states):
    """Tension [N] of a linear spring; fills its state."""
    elastic = stretch - cables[i, REST] * cables[i, CREEP]
    states[i, HYSTERESIS_NOW], states[i, STRAIN] = 0.0, elastic * ready[i, YIELD]
    taut = elastic >= 0.0
    tension = elastic * ready[i, RATE] if taut else 0.0
    states[i, TENSION] = states[i, WINCH_TENSION] = tension
    states[i, SLACK], states[i, ENERGY] = 0.0 if taut else 1.0, 0.5 * tension * elastic
    return tension


@_jit
def _add_point(ax, ay, az, fx, fy, fz, per, gradient, hessian):
    """Add a force on a platform point: to the gradient, and what bending its path adds.

    The point's arm is in units of the robot's length 1/per. Its path bends with rotation:
    -force . d2x is the geometric part of the stiffness.
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


@_jit
def _joint_columns(current, x, y, z, per, columns):
    """Motion (n, 6) of the platform origin, now at x, y, z, by the joints in scaled steps."""
    for j in range(current.shape[0]):
        a, b, c = current[j, 1], current[j, 2], current[j, 3]
        if current[j, 0] == 0.0:
            columns[j, 0], columns[j, 1], columns[j, 2] = a, b, c
            columns[j, 3] = columns[j, 4] = columns[j, 5] = 0.0
            continue
        dx, dy, dz = x - current[j, 4], y - current[j, 5], z - current[j, 6]
        columns[j, 0] = (b * dz - c * dy) * per
        columns[j, 1] = (c * dx - a * dz) * per
        columns[j, 2] = (a * dy - b * dx) * per
        columns[j, 3], columns[j, 4], columns[j, 5] = a, b, c


@_jit
def _onto_joints(g, h, columns, per, gradient, hessian):
    """From the platform's own gradient and stiffness to those of its joints.

    Joint j moves on with each hinge i further out: the origin's motion v_j turns by a_i x v_j,
    and the rotation vector of both has half of a_i x a_j to second order.
    """
    for j in range(gradient.shape[0]):
        total = 0.0
        for k in range(6):
            total += g[k] * columns[j, k]
        gradient[j] = total
        vx, vy, vz = columns[j, 0], columns[j, 1], columns[j, 2]
        ux, uy, uz = 0.5 * columns[j, 3], 0.5 * columns[j, 4], 0.5 * columns[j, 5]
        for i in range(j + 1):
            a, b, c = per * columns[i, 3], per * columns[i, 4], per * columns[i, 5]
            total = g[0] * (b * vz - c * vy) + g[1] * (c * vx - a * vz) + g[2] * (a * vy - b * vx)
            total += g[3] * (b * uz - c * uy) + g[4] * (c * ux - a * uz) + g[5] * (a * uy - b * ux)
            for k in range(6):
                part = 0.0
                for r in range(6):
                    part += h[k, r] * columns[i, r]
                total += part * columns[j, k]
            hessian[i, j] = hessian[j, i] = total


@_jit
def _other_pull(cables, ready, load, i, dx, dy, dz, guess, work, states):
    """What a cable that is no linear spring does; see cable_pull. Fills work[12:19]."""
    start, move = work[14], work[15]
    for k in range(3):
        start[k] = ready[i, START + k]
    move[0], move[1], move[2] = dx, dy, dz
    return cable_pull(
        cables[i], start, move, load[UP : UP + 3], guess[i], work, work[12], work[16:19], work[13],
        states[i],
    )  # fmt: skip


@_jit
def _evaluate(
    cables, ready, load, deviation, length, guess, gradient, hessian, states, slopes, work
):
    """See evaluate; of a free platform."""
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
        dx, dy, dz = _rotated_less(w, x, y, z, ax, ay, az)
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
        # J^T k J with J = [I, -[arm]x] the motion of the anchor point
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
        # and the bending of its path: -force . d2x
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
    dx, dy, dz = _rotated_less(w, x, y, z, ax, ay, az)
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
    # a constant moment has no potential in three dimensions
    return np.nan if has_moment(load) else energy


@_jit
def evaluate(
    cables, ready, load, deviation, current, length, guess, gradient, hessian, states, slopes, work
):
    """Gradient of the energy (minus the wrench) and stiffness at a deviation; returns energy.

    Args:
        cables: (m, N_COLUMNS).
        ready: (m + 1, N_READY), prepared.
        load: (N_LOAD,).
        deviation: (7,) from the commanded pose.
        current: (n, 7) joints as they stand, (0, 7) for a free platform.
        length: the robot's length [m].
        guess: (m, 3) warm start of the catenaries.
        gradient: (d,) [N], filled.
        hessian: (d, d) [N/m], filled: the stiffness; under a moment its symmetric part.
        states: (m, N_STATE), filled.
        slopes: (m, d) [N/m], derivative of the tensions, filled.
        work: (N_WORK, 6) scratch.

    Returns:
        energy [J]; nan where a law has none in closed form; inf where a cable's own
        equations could not be solved.
    """
    n, m = current.shape[0], cables.shape[0]
    if n == 0:
        return _evaluate(
            cables, ready, load, deviation, length, guess, gradient, hessian, states, slopes, work
        )
    columns, g, h, own = work[19:25], work[25], work[26:32], np.empty((m, 6))
    x = ready[m, START] + deviation[0]
    y, z = ready[m, START + 1] + deviation[1], ready[m, START + 2] + deviation[2]
    energy = _evaluate(cables, ready, load, deviation, length, guess, g, h, states, own, work)
    _joint_columns(current, x, y, z, 1.0 / length, columns)
    _onto_joints(g, h, columns, 1.0 / length, gradient, hessian)
    for i in range(m):
        for j in range(n):
            slopes[i, j] = 0.0
            for k in range(6):
                slopes[i, j] += own[i, k] * columns[j, k]
    return energy


@_jit
def has_moment(load):
    """Whether an external moment acts: it has no potential."""
    k = EXTERNAL_MOMENT
    return load[k] != 0.0 or load[k + 1] != 0.0 or load[k + 2] != 0.0


@_jit
def add_skew(load, current, length, matrix):
    """Add to the symmetric part of the stiffness what a constant moment skews it by.

    An axis a_j turns with those further out, which a step's rotation vector shares evenly:
    -M . (a_i x a_j)/2 in row j of column i, and the opposite in row i of column j. For a free
    platform, whose axes are those of the base frame, that is -[M]x/2.
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
