"""How far inside their limits tensions that balance a load can stay: exact, without a search.

With W = L Q^T (Householder), the tensions that balance are tau = tau_p + N nu, with N the null
space of W. The margin is the maximum over nu of the smallest tau_i - low_i and high_i - tau_i. This
is a small linear program in nu and the margin itself. Its dual simplex starts from a basis of
artificial functions and ends after a few pivots.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import eliminate
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.rotation import rotated_less

# A matrix is singular if a pivot of its factor is below this part of the largest.
_SINGULAR = 1e-11
# Value of the artificial functions in loads: a margin that they limit is unbounded.
_TOP = 1e7
_PIVOTS, _ROUNDING = 200, 1e-12
# Rounding relative to the artificial functions, and the weight from which one of them is active.
_OWN_ROUNDING, _HOLDS = 1e-14, 1e-9


@jit_inner
def null_space(matrix, load, work, particular, null):
    """Particular solution (m,) and null space (m, m - d) of matrix (d, m); False if singular."""
    d, m = matrix.shape
    for i in range(m):
        for k in range(d):
            work[i, k] = matrix[k, i]
    largest = 0.0
    for k in range(d):
        size = 0.0
        for i in range(k, m):
            size += work[i, k] ** 2
        size = math.sqrt(size)
        largest = max(largest, size)
        if size <= _SINGULAR * largest:
            return False
        sign = 1.0 if work[k, k] >= 0.0 else -1.0
        head = work[k, k] + sign * size
        # the vector is stored below the diagonal with a first entry of one, its factor in the last
        # column
        factor = head / (sign * size)
        for i in range(k + 1, m):
            work[i, k] /= head
        work[k, k] = -sign * size
        work[k, d] = factor
        for j in range(k + 1, d):
            dot = work[k, j]
            for i in range(k + 1, m):
                dot += work[i, k] * work[i, j]
            dot *= factor
            work[k, j] -= dot
            for i in range(k + 1, m):
                work[i, j] -= dot * work[i, k]
    for j in range(m - d + 1):
        # the last one is the particular solution: R^-T load, then zeros
        for i in range(m):
            particular[i] = 0.0
        if j < m - d:
            particular[d + j] = 1.0
        else:
            for k in range(d):
                total = load[k]
                for i in range(k):
                    total -= work[i, k] * particular[i]
                particular[k] = total / work[k, k]
        for back in range(d):
            k = d - 1 - back
            dot = particular[k]
            for i in range(k + 1, m):
                dot += work[i, k] * particular[i]
            dot *= work[k, d]
            particular[k] -= dot
            for i in range(k + 1, m):
                particular[i] -= dot * work[i, k]
        if j < m - d:
            for i in range(m):
                null[i, j] = particular[i]
    return True


@jit_inner
def _rows(particular, null, low, high, top, a, b):
    """The functions a nu + b whose minimum is maximised, artificial first; returns how many."""
    m, r = null.shape
    for j in range(r + 1):
        for k in range(r):
            a[j, k] = -1.0 if j == r else (1.0 if j == k else 0.0)
        b[j] = top
    count = r + 1
    for i in range(m):
        for k in range(r):
            a[count, k] = null[i, k]
        b[count] = particular[i] - low[i]
        count += 1
        if high[i] != np.inf:
            for k in range(r):
                a[count, k] = -null[i, k]
            b[count] = high[i] - particular[i]
            count += 1
    return count


@jit_allocating
def _largest_least(a, b, count, r, scale, answer):
    """max over nu of min_i (a_i nu + b_i) by the dual simplex; nan if it does not end.

    Infinite if artificial functions, the first r + 1, limit it. ``answer`` (r + 1,) is nu and the
    minimum, which the artificial functions keep finite.
    """
    k = r + 1
    basis = np.arange(k)
    system, right = np.empty((k, k)), np.empty(k)
    # weights of the basis: they sum the coefficients of nu to zero and those of the margin to one
    weights, change = np.full(k, 1.0 / k), np.empty(k)
    for _ in range(_PIVOTS):
        for row in range(k):
            for c in range(r):
                system[row, c] = a[basis[row], c]
            system[row, r] = -1.0
            right[row] = -b[basis[row]]
        eliminate(system, right, answer)
        size = scale * _ROUNDING
        for c in range(k):
            size = max(size, _OWN_ROUNDING * abs(answer[c]))
        least, enters = -size, -1
        for i in range(count):
            value = b[i] - answer[r]
            for c in range(r):
                value += a[i, c] * answer[c]
            if value < least:
                least, enters = value, i
        if enters < 0:
            held = 0.0
            for row in range(k):
                if basis[row] < k:
                    held += weights[row]
            return np.inf if held > _HOLDS else answer[r]
        # the entering function as a combination of the basis
        for row in range(k):
            for c in range(r):
                system[c, row] = a[basis[row], c]
            system[r, row] = 1.0
        for c in range(r):
            right[c] = a[enters, c]
        right[r] = 1.0
        eliminate(system, right, change)
        best, leaves = np.inf, -1
        for row in range(k):
            if change[row] > 1e-12:
                ratio = weights[row] / change[row]
                if ratio < best:
                    best, leaves = ratio, row
        if leaves < 0:
            return np.nan
        for row in range(k):
            weights[row] -= best * change[row]
        basis[leaves], weights[leaves] = enters, best
    return np.nan


@jit_allocating
def _space(d, m):
    """Scratch arrays for any number of poses."""
    rows = m - d + 1 + 2 * m
    return (
        np.empty((m, d + 1)), np.empty(m), np.empty((m, m - d)),
        np.empty((rows, max(m - d, 1))), np.empty(rows), np.empty(m - d + 1),
    )  # fmt: skip


@jit_inner
def _least_margin(matrix, loads, low, high, scale, space):
    """The smallest margin [N] over loads (k, d); nan if the matrix is singular."""
    work, particular, null, a, b, answer = space
    least = np.inf
    for k in range(len(loads)):
        if not null_space(matrix, loads[k], work, particular, null):
            return np.nan
        count = _rows(particular, null, low, high, _TOP * scale, a, b)
        found = _largest_least(a, b, count, null.shape[1], scale, answer)
        if np.isnan(found):
            return np.nan
        least = min(least, found)
    return least


@jit_allocating
def margins_of(matrices, loads, low, high, scale, out):
    """Margins (n,) of matrices (n, d, m) and loads (n, k, d): the smallest over k loads."""
    space = _space(*matrices.shape[1:])
    for r in range(len(matrices)):
        out[r] = _least_margin(matrices[r], loads[r], low, high, scale, space)


@jit_allocating
def innermost_of(matrices, loads, low, high, scale, out, tensions):
    """Like :func:`margins_of`, with one load (n, d) and limits (n, m) each; also fills tensions.

    ``tensions`` (n, m) are those that stay farthest inside; nan if the margin is not finite.
    """
    space = _space(*matrices.shape[1:])
    null, particular, answer = space[2], space[1], space[5]
    for r in range(len(matrices)):
        out[r] = _least_margin(matrices[r], loads[r : r + 1], low[r], high[r], scale[r], space)
        for i in range(matrices.shape[2]):
            tensions[r, i] = particular[i] if np.isfinite(out[r]) else np.nan
            for k in range(null.shape[1]):
                tensions[r, i] += null[i, k] * answer[k]


@jit_allocating
def margins_at(poses, exits, anchors, centre, weight, wrenches, low, high, length, scale, out):
    """Margins (n,) of a free platform at poses (n, 7); wrenches (k, 6) add to its weight."""
    m = len(exits)
    matrix, load = np.empty((6, m)), np.empty((len(wrenches), 6))
    arm, unit, space = np.empty(3), np.empty(3), _space(6, m)
    for r in range(len(poses)):
        w, x, y, z = poses[r, 3], poses[r, 4], poses[r, 5], poses[r, 6]
        for i in range(m):
            size = 0.0
            p, q, s = anchors[i, 0], anchors[i, 1], anchors[i, 2]
            arm[0], arm[1], arm[2] = rotated_less(w, x, y, z, p, q, s)
            for c in range(3):
                arm[c] += anchors[i, c]
                unit[c] = exits[i, c] - poses[r, c] - arm[c]
                size += unit[c] ** 2
            size = math.sqrt(size)
            for c in range(3):
                unit[c] /= size
                matrix[c, i] = unit[c]
            for c in range(3):
                e, f = (c + 1) % 3, (c + 2) % 3
                matrix[3 + c, i] = (arm[e] * unit[f] - arm[f] * unit[e]) / length
        p, q, s = centre[0], centre[1], centre[2]
        arm[0], arm[1], arm[2] = rotated_less(w, x, y, z, p, q, s)
        for c in range(3):
            arm[c] += centre[c]
        for k in range(len(wrenches)):
            for c in range(3):
                e, f = (c + 1) % 3, (c + 2) % 3
                moment = arm[e] * weight[f] - arm[f] * weight[e]
                load[k, c] = -wrenches[k, c] - weight[c]
                load[k, 3 + c] = -(wrenches[k, 3 + c] + moment) / length
        out[r] = _least_margin(matrix, load, low, high, scale, space)
