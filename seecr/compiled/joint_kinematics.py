"""Platforms on slide and hinge joints: their poses, and joint values that lead to poses.

Its coordinates are the joint values, times the robot's length for hinges. The first joint is the
outermost, as in MJCF.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    quaternion_product,
    rotated_less,
    solve_factored,
    turned,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner

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


# Platforms on joints that keep their origin, or bring it somewhere, with as little turning.
#
# Joints are no measure of the platform's motion: a hinge beside the origin also moves it, and
# slides behind a hinge turn with it. So what keeps a position, or turns about it, is computed here
# from the motion of the origin itself.

# Weight of the origin's motion relative to turning: what is left of it falls by this each step.
_WEIGHT = 1e4
# Most steps; distance from the goal that is rounding, and that still counts as there [length].
_STEPS, _EXACT, _THERE = 20, 1e-15, 1e-9
# Damping of joints that move nothing, relative to the largest diagonal entry.
_IDLE = 1e-15


@jit_allocating
def make_placing_space(current, columns, turns):
    """Scratch arrays: those given, basis (turns, d), its rotations, steps, and a linear system."""
    d = current.shape[0]
    return (
        current, columns, np.zeros((turns, d)), np.zeros((d, 3)), np.zeros((d, d)),
        np.zeros((d, d)), np.zeros((d, d)), np.zeros(d), np.zeros(d),
    )  # fmt: skip


@jit_inner
def _factor(space):
    """Factor the weighted squares of the joints' motion."""
    columns, normal, factor = space[1], space[4], space[5]
    d, top = columns.shape[0], 0.0
    for i in range(d):
        for j in range(i + 1):
            total = 0.0
            for k in range(3):
                total += _WEIGHT * columns[i, k] * columns[j, k]
                total += columns[i, 3 + k] * columns[j, 3 + k]
            normal[i, j] = total
        top = max(top, normal[i, i])
    shift = _IDLE * top
    while not cholesky(normal, shift, factor):
        shift = 10.0 * shift + 1e-300


@jit_inner
def _least_turn(x, y, z, space):
    """Fill the step (d,), space[8], that moves the origin by x, y, z and hardly turns."""
    columns, factor, right, step = space[1], space[5], space[7], space[8]
    for i in range(columns.shape[0]):
        right[i] = _WEIGHT * (columns[i, 0] * x + columns[i, 1] * y + columns[i, 2] * z)
    solve_factored(factor, right, step)


@jit_inner
def bring(screws, values, length, pose, x, y, z, deviation, space):
    """Bring the origin of a platform on joints to x, y, z from ``pose``; whether it is there.

    It turns as little as its joints allow, not at all if slides can move it. ``values`` (d,) [m]
    are changed, ``deviation`` (7,) is filled. Does nothing to a free platform.
    """
    if screws.shape[0] == 0:
        return True
    far = np.inf
    for number in range(_STEPS + 1):
        place_joints(screws, values, length, pose, deviation, space[0])
        dx, dy, dz = x - deviation[0], y - deviation[1], z - deviation[2]
        before, far = far, max(abs(dx), max(abs(dy), abs(dz)))
        close = far <= _THERE * length
        if far <= _EXACT * length or (close and far >= 0.5 * before) or number == _STEPS:
            break
        px, py, pz = pose[0] + deviation[0], pose[1] + deviation[1], pose[2] + deviation[2]
        joint_columns(space[0], px, py, pz, 1.0 / length, space[1])
        _factor(space)
        _least_turn(dx, dy, dz, space)
        for k in range(values.shape[0]):
            values[k] += space[8][k]
    return far <= _THERE * length


@jit_inner
def turning_basis(space):
    """Fill the basis (t, d), space[2]: steps along the joints that turn about the origin.

    Their rotations, times the length, are orthonormal, and the origin stays where it is to first
    order. Current joints and their columns are given in the space. Each hinge's rotation is made to
    keep the origin, and of these the largest that are independent are taken (Gram and Schmidt with
    pivots).
    """
    current, columns, basis, turned, steps = space[0], space[1], space[2], space[3], space[6]
    d = columns.shape[0]
    _factor(space)
    for j in range(d):
        if current[j, 0] == 0.0:  # a slide
            turned[j, 0] = turned[j, 1] = turned[j, 2] = 0.0
            continue
        _least_turn(-columns[j, 0], -columns[j, 1], -columns[j, 2], space)
        for i in range(d):
            steps[j, i] = space[8][i]
        steps[j, j] += 1.0
        for k in range(3):
            turned[j, k] = 0.0
            for i in range(d):
                turned[j, k] += steps[j, i] * columns[i, 3 + k]
    for number in range(basis.shape[0]):
        best, largest = 0, -1.0
        for j in range(d):
            size = turned[j, 0] ** 2 + turned[j, 1] ** 2 + turned[j, 2] ** 2
            if size > largest * (1.0 + 1e-9):
                best, largest = j, size
        inverse = 1.0 / np.sqrt(max(largest, 1e-300))
        for i in range(d):
            basis[number, i] = steps[best, i] * inverse
        x, y, z = turned[best, 0] * inverse, turned[best, 1] * inverse, turned[best, 2] * inverse
        for j in range(d if number + 1 < basis.shape[0] else 0):
            along = turned[j, 0] * x + turned[j, 1] * y + turned[j, 2] * z
            turned[j, 0] -= along * x
            turned[j, 1] -= along * y
            turned[j, 2] -= along * z
            for i in range(d):
                steps[j, i] -= along * basis[number, i]


@jit_allocating
def bring_batch(screws, poses, rows, away, length, places, there):
    """Bring the origins of k displaced platforms on joints to places (k, 3) [m], see bring.

    ``rows`` (k,) says which of the poses (n, 7) each is displaced from, by ``away`` (k, d) [m],
    which is changed; ``there`` (k,) is filled.
    """
    d, deviation = screws.shape[1], np.zeros(7)
    space = make_placing_space(np.zeros((d, N_CURRENT)), np.zeros((d, 6)), 0)
    for r in range(rows.shape[0]):
        row = rows[r]
        there[r] = bring(
            screws[row], away[r], length, poses[row], places[r, 0], places[r, 1], places[r, 2],
            deviation, space,
        )  # fmt: skip


# Values of slides and hinges that bring a platform to given poses, in closed form.
#
# Slides do not turn the platform. So its orientation alone determines the angles of up to three
# hinges, and once these are known, its position is linear in the slides' values. Of three hinges
# there are two sets of angles (Paden and Kahan's subproblems: Murray, Li and Sastry, A
# Mathematical Introduction to Robotic Manipulation, 1994, section 3.2). The pose that values lead
# to is computed from them, so that a caller can tell whether they are right.

# Sine of the angle between axes below which these do not determine angles, or slides, well.
_PARALLEL = 1e-3
# Solves for the slides: the second one removes the first one's rounding.
_SOLVES = 2
# Scratch numbers per slide: a vector of an orthonormal base of their axes, a row of the triangle
# that takes it to these, and the slide's change.
N_SCRATCH = 7
_TRIANGLE, _CHANGE = 3, 6


@jit_inner
def _angle(ax, ay, az, w, x, y, z):
    """Angle [rad], within half a turn, of the part about an axis of a unit quaternion."""
    sine = ax * x + ay * y + az * z
    if w < 0.0:
        w, sine = -w, -sine
    return 2.0 * math.atan2(sine, w)


@jit_inner
def _turned_by(screws, j, angle, w, x, y, z):
    """The quaternion after a turn about hinge j's axis."""
    return turned(
        screws[j, 1] * angle, screws[j, 2] * angle, screws[j, 3] * angle, w, x, y, z
    )  # fmt: skip


@jit_inner
def _moved(screws, j, w, x, y, z):
    """The axis of hinge j after a rotation."""
    a, b, c = screws[j, 1], screws[j, 2], screws[j, 3]
    dx, dy, dz = rotated_less(w, x, y, z, a, b, c)
    return a + dx, b + dy, c + dz


@jit_inner
def _about(screws, j, ux, uy, uz, vx, vy, vz):
    """Angle [rad] about hinge j's axis from one vector to another."""
    ax, ay, az = screws[j, 1], screws[j, 2], screws[j, 3]
    sine = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
    along = (ax * ux + ay * uy + az * uz) * (ax * vx + ay * vy + az * vz)
    return math.atan2(sine, ux * vx + uy * vy + uz * vz - along)


@jit_inner
def _sine(screws, i, j):
    """Sine of the angle between two axes."""
    x = screws[i, 2] * screws[j, 3] - screws[i, 3] * screws[j, 2]
    y = screws[i, 3] * screws[j, 1] - screws[i, 1] * screws[j, 3]
    z = screws[i, 1] * screws[j, 2] - screws[i, 2] * screws[j, 1]
    return math.sqrt(x * x + y * y + z * z)


@jit_inner
def _two(screws, i, j, w, x, y, z, values):
    """Angles of hinges i and j, i further out: j's axis is turned by i alone."""
    if _sine(screws, i, j) < _PARALLEL:
        return False
    bx, by, bz = _moved(screws, j, w, x, y, z)
    values[i] = _about(screws, i, screws[j, 1], screws[j, 2], screws[j, 3], bx, by, bz)
    w, x, y, z = _turned_by(screws, i, -values[i], w, x, y, z)
    values[j] = _angle(screws[j, 1], screws[j, 2], screws[j, 3], w, x, y, z)
    return True


@jit_inner
def _three(screws, i, j, k, w, x, y, z, which, values):
    """Angles of hinges i, j and k, from the outside in; ``which`` is 1 or -1, one of two sets.

    The angle between the axes of i and k depends on j alone.
    """
    if _sine(screws, i, j) < _PARALLEL or _sine(screws, j, k) < _PARALLEL:
        return False
    ax, ay, az = screws[i, 1], screws[i, 2], screws[i, 3]
    bx, by, bz = screws[j, 1], screws[j, 2], screws[j, 3]
    cx, cy, cz = screws[k, 1], screws[k, 2], screws[k, 3]
    tx, ty, tz = _moved(screws, k, w, x, y, z)
    constant = (ax * bx + ay * by + az * bz) * (bx * cx + by * cy + bz * cz)
    cosine = ax * cx + ay * cy + az * cz - constant
    sine = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    goal = (ax * tx + ay * ty + az * tz - constant) / math.sqrt(cosine**2 + sine**2)
    middle = math.atan2(sine, cosine)
    angle = middle + which * math.acos(min(1.0, max(-1.0, goal)))
    values[j] = math.atan2(math.sin(angle), math.cos(angle))
    mw, mx, my, mz = _turned_by(screws, j, values[j], 1.0, 0.0, 0.0, 0.0)
    ux, uy, uz = _moved(screws, k, mw, mx, my, mz)
    values[i] = _about(screws, i, ux, uy, uz, tx, ty, tz)
    w, x, y, z = _turned_by(screws, i, -values[i], w, x, y, z)
    w, x, y, z = _turned_by(screws, j, -values[j], w, x, y, z)
    values[k] = _angle(cx, cy, cz, w, x, y, z)
    return True


@jit_inner
def _hinges(screws, w, x, y, z, which, values):
    """Angles of up to three hinges at a rotation from the reference; False if not so simple."""
    count, i, j, k = 0, 0, 0, 0
    for number in range(screws.shape[0]):
        if screws[number, 0] == 0.0:
            continue
        i, j, k = j, k, number
        count += 1
    if count == 0:
        return True
    if count == 1:
        values[k] = _angle(screws[k, 1], screws[k, 2], screws[k, 3], w, x, y, z)
        return True
    if count == 2:
        return _two(screws, j, k, w, x, y, z, values)
    return count == 3 and _three(screws, i, j, k, w, x, y, z, which, values)


@jit_inner
def _base(current, scratch):
    """Fill an orthonormal base of the slides' axes (Gram and Schmidt); False if it has none."""
    found = 0
    for j in range(current.shape[0]):
        if current[j, 0] != 0.0:
            continue
        if found == 3:
            return False
        vx, vy, vz = current[j, 1], current[j, 2], current[j, 3]
        for i in range(found):
            bx, by, bz = scratch[i, 0], scratch[i, 1], scratch[i, 2]
            along = bx * vx + by * vy + bz * vz
            scratch[i, _TRIANGLE + found] = along
            vx, vy, vz = vx - along * bx, vy - along * by, vz - along * bz
        size = math.sqrt(vx * vx + vy * vy + vz * vz)
        if size < _PARALLEL:
            return False
        scratch[found, _TRIANGLE + found] = size
        scratch[found, 0], scratch[found, 1], scratch[found, 2] = vx / size, vy / size, vz / size
        found += 1
    return True


@jit_inner
def _slide(current, scratch, x, y, z, values):
    """Move the slides so that the platform's position changes by x, y, z, or comes nearest."""
    count = 0
    for j in range(current.shape[0]):
        if current[j, 0] == 0.0:
            count += 1
    row = count
    for back in range(current.shape[0]):
        j = current.shape[0] - 1 - back
        if current[j, 0] != 0.0:
            continue
        row -= 1
        total = scratch[row, 0] * x + scratch[row, 1] * y + scratch[row, 2] * z
        for other in range(row + 1, count):
            total -= scratch[row, _TRIANGLE + other] * scratch[other, _CHANGE]
        change = total / scratch[row, _TRIANGLE + row]
        scratch[row, _CHANGE] = change
        values[j] += change


@jit_inner
def _place(screws, values, home, pose, current):
    """The pose (7,) at joint values."""
    place_joints(screws, values, 1.0, home, pose, current)
    w, x, y, z = quaternion_product(
        pose[3], pose[4], pose[5], pose[6], home[3], home[4], home[5], home[6]
    )
    pose[0], pose[1], pose[2] = home[0] + pose[0], home[1] + pose[1], home[2] + pose[2]
    pose[3], pose[4], pose[5], pose[6] = w, x, y, z


@jit_inner
def _missed(pose, reached, length):
    """How far two poses are apart [rad]: positions count over the length."""
    x, y, z = pose[0] - reached[0], pose[1] - reached[1], pose[2] - reached[2]
    w, a, b, c = quaternion_product(
        pose[3], pose[4], pose[5], pose[6], reached[3], -reached[4], -reached[5], -reached[6]
    )
    turn = 2.0 * math.atan2(math.sqrt(a * a + b * b + c * c), abs(w))
    return max(math.sqrt(x * x + y * y + z * z) / length, turn)


@jit_inner
def _reach(screws, home, pose, which, length, values, reached, current, scratch):
    """One pose, by one of two sets of angles; returns how far off it is, infinite if unknown."""
    w, x, y, z = quaternion_product(
        pose[3], pose[4], pose[5], pose[6], home[3], -home[4], -home[5], -home[6]
    )
    for j in range(values.shape[0]):
        values[j] = 0.0
    simple = _hinges(screws, w, x, y, z, which, values)
    _place(screws, values, home, reached, current)
    if not (simple and _base(current, scratch)):
        return math.inf
    for _ in range(_SOLVES):
        _slide(
            current, scratch, pose[0] - reached[0], pose[1] - reached[1], pose[2] - reached[2],
            values,
        )  # fmt: skip
        _place(screws, values, home, reached, current)
    off = _missed(pose, reached, length)
    return off if off < math.inf else math.inf


@jit_inner
def _turn_of(screws, values):
    """Sum of the hinges' squared angles."""
    total = 0.0
    for j in range(screws.shape[0]):
        total += screws[j, 0] * values[j] ** 2
    return total


@jit
def reach_batch(screws, home, poses, length, near, values, reached, current, off, scratch):
    """Joint values that bring a platform to n poses, where there is a closed form.

    Of two sets of angles it takes the one that leads to the pose; if both do, the smaller ones.

    Args:
        screws: (d, 7) of the joints at the reference pose ``home`` (7,). poses: (n, 7).
        length: [m] over which positions count. near: a pose is reached if it is no farther off.
        values, reached, current: (n, d) [m, rad], (n, 7) pose and (n, d, 8) joints there, filled.
        off: (n,) how far off, in lengths or rad, infinite if there is no closed form, filled.
        scratch: (3, N_SCRATCH).
    """
    count = 0
    for j in range(screws.shape[0]):
        if screws[j, 0] != 0.0:
            count += 1
    for r in range(poses.shape[0]):
        pose, own, there, now = poses[r], values[r], reached[r], current[r]
        off[r] = _reach(screws, home, pose, 1.0, length, own, there, now, scratch)
        if count != 3 or off[r] == math.inf:
            continue
        first, turns = off[r], _turn_of(screws, own)
        off[r] = _reach(screws, home, pose, -1.0, length, own, there, now, scratch)
        if off[r] <= near and (first > near or _turn_of(screws, own) < turns):
            continue
        if first <= near or first < off[r]:
            off[r] = _reach(screws, home, pose, 1.0, length, own, there, now, scratch)


@jit
def place_home_batch(screws, values, home, poses, current):
    """Poses (n, 7) at joint values (n, d), and the joints there (n, d, 8)."""
    for r in range(values.shape[0]):
        _place(screws, values[r], home, poses[r], current[r])


# How far platforms on joints are displaced, and how each joint moves them there.


@jit_inner
def _fill_turn(deviation, length, apart):
    """The rotation vector of a deviation, times the length, the shorter way."""
    w, x, y, z = deviation[3], deviation[4], deviation[5], deviation[6]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    part = 2.0 * length * (math.atan2(sine, w) / sine if sine > 1e-12 else 1.0)
    apart[3], apart[4], apart[5] = part * x, part * y, part * z


@jit_allocating
def apart_batch(screws, poses, rows, away, length, apart, columns):
    """Displacements (k, 6) [m] and motions (k, d, 6) of k platforms on joints; both are filled.

    ``rows`` (k,) says which of the poses (n, 7) each is displaced from, by ``away`` (k, d) [m].
    Motions are the platform's twist at its origin per step of each joint there, in base axes.
    Rotations are times the length.
    """
    current, deviation = np.zeros((screws.shape[1], N_CURRENT)), np.zeros(7)
    for r in range(rows.shape[0]):
        row = rows[r]
        place_joints(screws[row], away[r], length, poses[row], deviation, current)
        for k in range(3):
            apart[r, k] = deviation[k]
        _fill_turn(deviation, length, apart[r])
        x, y, z = (
            poses[row, 0] + deviation[0],
            poses[row, 1] + deviation[1],
            poses[row, 2] + deviation[2],
        )
        joint_columns(current, x, y, z, 1.0 / length, columns[r])
