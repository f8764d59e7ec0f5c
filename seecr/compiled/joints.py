"""A platform on slide and hinge joints: its pose, and forces projected onto the joints.

Its coordinates are the joint values, times the robot's length for hinges. The first joint is the
outermost, as in MJCF.
"""

from __future__ import annotations

from seecr.compiled.jit import jit, jit_inner
from seecr.compiled.rotation import quaternion_product, rotated_less, turned

# Columns of a current joint: those of a screw, and the joint's value.
VALUE = 7
N_CURRENT = 8


@jit
def place_joints(screws, values, length, origin, deviation, current):
    """Deviation (7,) of a platform on joints, and the current joint axes and points.

    The platform moves by E_1 E_2 ... E_n, with E_j along or about joint j at the commanded pose
    (product of exponentials). ``screws`` are (n, 7): kind (0 slide, 1 hinge), axis, point;
    ``current`` (n, N_CURRENT) has the value besides.
    """
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    mx = my = mz = 0.0
    ox, oy, oz = origin[0], origin[1], origin[2]
    for j in range(screws.shape[0]):
        ax, ay, az = screws[j, 1], screws[j, 2], screws[j, 3]
        px, py, pz = screws[j, 4], screws[j, 5], screws[j, 6]
        sx, sy, sz = rotated_less(w, x, y, z, ax, ay, az)
        nx, ny, nz = ax + sx, ay + sy, az + sz
        current[j, 0], current[j, 1], current[j, 2], current[j, 3] = screws[j, 0], nx, ny, nz
        sx, sy, sz = rotated_less(w, x, y, z, px - ox, py - oy, pz - oz)
        current[j, 4], current[j, 5], current[j, 6] = px + sx + mx, py + sy + my, pz + sz + mz
        current[j, VALUE] = values[j]
        if screws[j, 0] == 0.0:
            mx, my, mz = mx + nx * values[j], my + ny * values[j], mz + nz * values[j]
            continue
        angle = values[j] / length
        a, b, c, d = turned(ax * angle, ay * angle, az * angle, 1.0, 0.0, 0.0, 0.0)
        # the platform's origin rotates about the hinge, which the joints before have rotated
        sx, sy, sz = rotated_less(a, b, c, d, ox - px, oy - py, oz - pz)
        tx, ty, tz = rotated_less(w, x, y, z, sx, sy, sz)
        mx, my, mz = mx + sx + tx, my + sy + ty, mz + sz + tz
        w, x, y, z = quaternion_product(w, x, y, z, a, b, c, d)
    deviation[0], deviation[1], deviation[2] = mx, my, mz
    deviation[3], deviation[4], deviation[5], deviation[6] = w, x, y, z


@jit
def place_batch(screws, values, length, poses, deviation, current):
    """Current joints (n, d, N_CURRENT) of n platforms; ``deviation`` is that of the last one."""
    for r in range(screws.shape[0]):
        place_joints(screws[r], values[r], length, poses[r], deviation, current[r])


@jit_inner
def joint_columns(current, x, y, z, per, columns):
    """Motion (n, 6) of the platform origin, now at x, y, z, per scaled step of each joint."""
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


@jit_inner
def onto_joints_gradient(g, columns, gradient):
    """From the platform's own gradient (6,) to that of its joints (d,)."""
    for j in range(gradient.shape[0]):
        total = 0.0
        for k in range(6):
            total += g[k] * columns[j, k]
        gradient[j] = total


@jit_inner
def onto_joints(g, h, columns, per, gradient, hessian):
    """From the platform's own gradient and stiffness to those of its joints.

    A hinge i further out also moves joint j: the origin's motion v_j rotates by a_i x v_j, and the
    rotation vector of both has half of a_i x a_j to second order.
    """
    onto_joints_gradient(g, columns, gradient)
    for j in range(gradient.shape[0]):
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
