"""Platforms on joints that keep their origin, or bring it somewhere, with as little turning.

Joints are no measure of the platform's motion: a hinge beside the origin also moves it, and slides
behind a hinge turn with it. So what keeps a position, or turns about it, is computed here from the
motion of the origin itself.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.algebra import cholesky, solve_factored
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.joints import N_CURRENT, joint_columns, place_joints

# Weight of the origin's motion relative to turning: what is left of it falls by this each step.
_WEIGHT = 1e4
# Most steps; distance from the goal that is rounding, and that still counts as there [length].
_STEPS, _EXACT, _THERE = 20, 1e-15, 1e-9
# Damping of joints that move nothing, relative to the largest diagonal entry.
_IDLE = 1e-15


@jit_allocating
def make_placing_space(current, columns, turns):
    """Scratch arrays: those given, basis (turns, d), its rotations, steps, and a linear system.

    Args:
        current: (d, N_CURRENT) joints as they are, and columns: (d, 6) their motion; none for a
            free platform. turns: independent rotations that keep the origin.
    """
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
    """Bring the origin of a platform on joints to a displacement x, y, z from ``pose``.

    It turns as little as its joints allow, not at all if slides can move it. Does nothing to a free
    platform.

    Args:
        screws: (d, 7). values: (d,) [m], changed. length: [m]. pose: (7,). deviation: (7,), filled.
        space: scratch arrays, those of make_placing_space.

    Returns:
        whether it is there.
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
    """Bring the origins of k displaced platforms on joints to given displacements, see bring.

    Args:
        screws: (n, d, 7). poses: (n, 7). rows: (k,) which of these each is displaced from.
        away: (k, d) [m] joint values minus those at the poses, changed. length: [m].
        places: (k, 3) [m] displacements of the origin. there: (k,) bool, filled.
    """
    d, deviation = screws.shape[1], np.zeros(7)
    space = make_placing_space(np.zeros((d, N_CURRENT)), np.zeros((d, 6)), 0)
    for r in range(rows.shape[0]):
        row = rows[r]
        there[r] = bring(
            screws[row], away[r], length, poses[row], places[r, 0], places[r, 1], places[r, 2],
            deviation, space,
        )  # fmt: skip
