"""Values of slides and hinges that bring a platform to given poses, in closed form.

Slides do not turn the platform. So its orientation alone determines the angles of up to three
hinges, and once these are known, its position is linear in the slides' values. Of three hinges
there are two sets of angles (Paden and Kahan's subproblems: Murray, Li and Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, section 3.2). The pose that values lead to is computed
from them, so that a caller can tell whether they are right.
"""

from __future__ import annotations

import math

from seecr.compiled.jit import jit, jit_inner
from seecr.compiled.joints import place_joints
from seecr.compiled.rotation import quaternion_product, rotated_less, turned

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
        screws: (d, 7) kind (0 slide, 1 hinge), axis and point of each joint at the reference pose.
        home: (7,) reference pose. poses: (n, 7).
        length: [m] over which positions count. near: a pose is reached if it is no farther off.
        values: (n, d) [m, rad]; reached: (n, 7) pose at these values; current: (n, d, 8) the
            joints there, as place_joints has them; off: (n,) how far off that is, in lengths or
            rad, infinite if there is no closed form. All are filled.
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
