"""Tensions that balance a load: farthest inside their limits, or nearest to wanted ones.

With W = L Q^T (Householder), the tensions that balance are tau = tau_p + N nu, with N the null
space of W. The margin is the maximum over nu of the smallest tau_i - low_i and high_i - tau_i. This
is a small linear program in nu and the margin itself. Its dual simplex starts from a basis of
artificial functions and ends after a few pivots.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    eliminate,
    largest_diagonal,
    rotated_less,
    solve_factored,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner, jit_pasted

# A matrix is singular if a pivot of its factor is below this part of the largest.
_SINGULAR = 1e-11
# Value of the artificial functions in loads: a margin that they limit is unbounded.
_TOP = 1e7
_PIVOTS, _ROUNDING = 200, 1e-12
# Rounding relative to the artificial functions, and the weight from which one of them is active.
_OWN_ROUNDING, _HOLDS = 1e-14, 1e-9
# A system with a pivot below this part of the largest loses too many digits for a margin.
_NEARLY_SINGULAR = 1e-9


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


@jit_pasted
def _rows(particular, null, low, high, top, a, b):
    """Fill the functions a nu + b whose minimum is maximised: artificial, lower, upper ones."""
    m, r = null.shape
    for k in range(r):
        for j in range(r + 1):
            a[j, k] = -1.0 if j == r else (1.0 if j == k else 0.0)
        for i in range(m):
            a[r + 1 + i, k], a[r + 1 + m + i, k] = null[i, k], -null[i, k]
    for j in range(r + 1):
        b[j] = top
    for i in range(m):
        b[r + 1 + i], b[r + 1 + m + i] = particular[i] - low[i], high[i] - particular[i]


@jit_pasted
def _largest_least(a, b, scale, basis, answer, system, right, weights, change):
    """max over nu of min_i (a_i nu + b_i) by the dual simplex; nan if it does not end.

    Infinite if artificial functions, the first r + 1, limit it. ``basis`` (r + 1,) and ``answer``
    (r + 1,) are filled: the functions that limit it, and nu and the minimum, which the artificial
    functions keep finite. The others are scratch: (r + 1, r + 1), and (r + 1,) each.
    """
    k = basis.shape[0]
    r = k - 1
    for row in range(k):
        basis[row] = row
    # weights of the basis: they sum the coefficients of nu to zero and those of the margin to one
    for row in range(k):
        weights[row] = 1.0 / k
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
        for i in range(b.shape[0]):
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


# Of a row of poses, those of a grid, neighbours are mostly limited by the same cables.
#
# With the limits that are reached, the tensions of the other cables and the margin follow from one
# system of d equations, and the weights of the limits from its transpose. If no limit is exceeded
# and no weight is negative, that is the largest margin, without a null space and without pivots.

# Neighbours that are tried one after the other: BLOCK of seecr.parallel. The next ones begin anew,
# so that digits do not depend on how a batch is divided.
_BLOCK = 64


def _space(n_loads: int, d: int, m: int) -> tuple[Any, ...]:
    """Scratch arrays for any number of poses, made by NumPy: so nothing compiled creates any.

    Those of _margin, of _again, the limits (k, m) that a neighbour reached, and those of poses.
    """
    r = m - d + 1
    rows, more = r + 2 * m, max(m - d, 1)
    simplex = (
        np.empty((m, d + 1)), np.empty(m), np.empty((m, m - d)), np.empty((rows, more)),
        np.empty(rows), np.empty(r), np.empty(r, np.int64), np.empty((r, r)), np.empty(r),
        np.empty(r), np.empty(r),
    )  # fmt: skip
    system = np.empty((d, d)), np.empty((d, d)), np.empty(d), np.empty(d), np.empty(d)
    place = np.empty((d, m)), np.empty((n_loads, d)), np.empty(3), np.empty(3)
    return simplex, system, np.zeros((n_loads, m), np.int64), place


@jit_pasted
def _margin(matrix, load, low, high, scale, side, space):
    """The margin [N] of one load; nan if the matrix is singular. Fills ``side`` (m,) see _again."""
    work, particular, null, a, b, answer, basis, system, right, weights, change = space[0]
    d, m = matrix.shape
    side[:] = 0
    if not null_space(matrix, load, work, particular, null):
        return np.nan
    _rows(particular, null, low, high, _TOP * scale, a, b)
    found = _largest_least(a, b, scale, basis, answer, system, right, weights, change)
    for row in range(basis.shape[0]):
        number = basis[row] - (m - d + 1)
        if number >= 0:
            side[number % m] += 1 if number < m else -1
    return found


@jit_inner
def _again(matrix, load, low, high, scale, side, space):
    """The margin [N] if the same limits are reached as at a neighbour; nan if others are.

    ``side`` (m,) is 1 for cables at their lower limit, -1 at their upper one, 0 for the others.
    """
    system, transposed, right, found, dual = space[1]
    d, m = matrix.shape
    free = 0
    for i in range(m):
        free += side[i] == 0
    if free != d - 1:  # also where nothing is known, or both limits of one cable are reached
        return np.nan
    column = 0
    for k in range(d):
        right[k], system[k, d - 1] = load[k], 0.0
    for i in range(m):
        if side[i] == 0:
            for k in range(d):
                system[k, column] = matrix[k, i]
            column += 1
        else:
            limit = low[i] if side[i] > 0 else high[i]
            for k in range(d):
                right[k] -= matrix[k, i] * limit
                system[k, d - 1] += side[i] * matrix[k, i]
    for k in range(d):
        dual[k] = 0.0
        for j in range(d):
            transposed[k, j] = system[j, k]
    eliminate(system, right, found)
    top, least = largest_diagonal(system), np.inf
    for k in range(d):
        least, right[k] = min(least, abs(system[k, k])), 1.0 if k == d - 1 else 0.0
    if not least > _NEARLY_SINGULAR * top:
        return np.nan
    eliminate(transposed, right, dual)
    margin, column, allowed = found[d - 1], 0, scale * _ROUNDING
    for i in range(m):
        if side[i] == 0:
            pull = found[column]
            column += 1
            if min(pull - low[i], high[i] - pull) < margin - allowed:
                return np.nan
        else:
            weight = 0.0
            for k in range(d):
                weight += matrix[k, i] * dual[k]
            if side[i] * weight < -_ROUNDING or high[i] - low[i] < 2.0 * margin - allowed:
                return np.nan
    return margin


@jit_pasted
def _least_margin(matrix, loads, low, high, scale, space):
    """The smallest margin [N] over loads (k, d); nan if the matrix is singular.

    ``space[2]`` (k, m) says which limits a neighbour reached, or is zero; it is changed.
    """
    least, sides = np.inf, space[2]
    for k in range(len(loads)):
        found = _again(matrix, loads[k], low, high, scale, sides[k], space)
        if np.isnan(found):
            found = _margin(matrix, loads[k], low, high, scale, sides[k], space)
            again = _again(matrix, loads[k], low, high, scale, sides[k], space)
            found = found if np.isnan(again) else again  # the digits that a neighbour would give
        if np.isnan(found):
            return np.nan
        least = min(least, found)
    return least


def margins_of(matrices, loads, low, high, scale, out) -> None:
    """Margins (n,) of matrices (n, d, m) and loads (n, k, d): the smallest over k loads.

    Limits (n, m) and scales (n,) are of each, or have one row for all.
    """
    space = _space(loads.shape[1], *matrices.shape[1:])
    _margins_of(matrices, loads, low, high, scale, out, space)


@jit
def _margins_of(matrices, loads, low, high, scale, out, space):
    for r in range(len(matrices)):
        if r % _BLOCK == 0:
            space[2][:] = 0
        row, of = r % len(low), r % len(scale)
        out[r] = _least_margin(matrices[r], loads[r], low[row], high[row], scale[of], space)


def innermost_of(matrices, loads, low, high, scale, out, tensions) -> None:
    """Margins of one load (n, d) and limits (n, m) each, and tensions (n, m) farthest inside.

    Tensions are nan if the margin is not finite.
    """
    space = _space(1, *matrices.shape[1:])
    _innermost_of(matrices, loads, low, high, scale, out, tensions, space)


@jit
def _innermost_of(matrices, loads, low, high, scale, out, tensions, space):
    particular, null, answer, side = space[0][1], space[0][2], space[0][5], space[2][0]
    for r in range(len(matrices)):
        out[r] = _margin(matrices[r], loads[r], low[r], high[r], scale[r], side, space)
        for i in range(matrices.shape[2]):
            tensions[r, i] = particular[i] if np.isfinite(out[r]) else np.nan
            for k in range(null.shape[1]):
                tensions[r, i] += null[i, k] * answer[k]


def margins_at(
    poses, exits, anchors, centre, weight, wrenches, low, high, length, scale, out
) -> None:
    """Margins (n,) of a free platform at poses (n, 7); wrenches (k, 6) add to its weight."""
    space = _space(len(wrenches), 6, len(exits))
    _margins_at(
        poses, exits, anchors, centre, weight, wrenches, low, high, length, scale, out, space
    )


@jit
def _margins_at(
    poses, exits, anchors, centre, weight, wrenches, low, high, length, scale, out, space
):
    m = len(exits)
    matrix, load, arm, unit = space[3]
    for r in range(len(poses)):
        if r % _BLOCK == 0:
            space[2][:] = 0
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


# Tensions that balance a load and exceed their limits by as little as possible, summed.
#
# With at most two more cables than degrees of freedom they are tau = tau_p + N nu with nu in a
# plane. The sum is convex and linear between the lines on which a tension is at a limit, so it is
# least where two of these cross: all crossings are tried.

# Lines that cross at less than this angle [rad] are parallel.
_PARALLEL = 1e-9
# Sums that differ by less than this part are equal.
_SAME = 1e-12


@jit_inner
def _exceeding(particular, null, x, y, low, high, tension):
    """Fill tensions (m,) at a point of the plane; returns by how much they exceed their limits."""
    total = 0.0
    for i in range(particular.shape[0]):
        tension[i] = particular[i] + null[i, 0] * x + null[i, 1] * y
        total += max(low[i] - tension[i], 0.0) + max(tension[i] - high[i], 0.0)
    return total


@jit_inner
def _crossing(null, first, second, to_first, to_second):
    """Where two lines null[i] . nu = to_i cross; whether they do."""
    a, b, c, d = null[first, 0], null[first, 1], null[second, 0], null[second, 1]
    size = np.sqrt((a * a + b * b) * (c * c + d * d))
    cross = a * d - b * c
    if not abs(cross) > _PARALLEL * size:
        return False, 0.0, 0.0
    return True, (to_first * d - to_second * b) / cross, (to_second * a - to_first * c) / cross


@jit_allocating
def least_beyond(matrix, load, low, high, tension):
    """Fill the tensions (m,) [N] that exceed their limits least; False if W is singular.

    The matrix is (d, m), with m - d from 0 to 2.
    """
    d, m = matrix.shape
    own, particular = np.empty((m, m - d)), np.empty(m)
    if not null_space(matrix, load, np.empty((m, d + 1)), particular, own):
        return False
    # of a line or a point, the coordinates that are not there are lines of their own through zero
    n, more = m + 2 - (m - d), m - d
    null, ends = np.zeros((n, 2)), np.zeros((n, 2))
    for i in range(m):
        for k in range(more):
            null[i, k] = own[i, k]
        ends[i, 0], ends[i, 1] = low[i] - particular[i], high[i] - particular[i]
    for k in range(more, 2):
        null[m + k - more, k] = 1.0
    best, at_x, at_y = np.inf, 0.0, 0.0
    # from the last cable on: of equal sums the first cables exceed their limits
    for i in range(n - 1, -1, -1):
        for j in range(i - 1, -1, -1):
            for side in range(4):
                to_i, to_j = ends[i, side % 2], ends[j, side // 2]
                if not (np.isfinite(to_i) and np.isfinite(to_j)):
                    continue
                crosses, x, y = _crossing(null, i, j, to_i, to_j)
                if crosses:
                    total = _exceeding(particular, null, x, y, low, high, tension)
                    if total < (1.0 - _SAME) * best:
                        best, at_x, at_y = total, x, y
    _exceeding(particular, null, at_x, at_y, low, high, tension)
    return best < np.inf


# The tensions nearest to wanted ones that balance a load within limits, by the dual problem.

FOUND, NONE, UNDECIDED = 0, 1, 2
# Most steps, most halvings of one, residual of the balance relative to its load, and damping of a
# step relative to the residual.
_STEPS, _HALVINGS, _LEFT, _DAMPING = 100, 40, 1e-13, 1e-9
# A shortened step ends where the slope is this part of that at its start.
_FLAT = 0.1
_NEARLY = 1e-9
# Tensions beyond this many loads do not occur.
_MOST_EVER = 1e6
# A proof that nothing balances must exceed rounding by this part.
_PROVEN = 1e-10
# Sweeps over the cables, and the change [largest tension] that ends them.
_SWEEPS, _CHANGE = 60, 1e-9


@jit_inner
def _clipped(matrix, aim, low, high, dual, tension):
    """tension = aim + A^T dual within limits; returns the part of the dual's value due to it."""
    d, m = matrix.shape
    value = 0.0
    for i in range(m):
        z = aim[i]
        for k in range(d):
            z += matrix[k, i] * dual[k]
        t = min(max(z, low[i]), high[i])
        tension[i] = t
        value += t * z - 0.5 * t * t
    return value


@jit_inner
def _unbalanced(matrix, load, tension, left):
    """left = A tension - load; returns its largest component."""
    d, m = matrix.shape
    most = 0.0
    for k in range(d):
        total = -load[k]
        for i in range(m):
            total += matrix[k, i] * tension[i]
        left[k] = total
        most = max(most, abs(total))
    return most


@jit_allocating
def _newton_step(matrix, low, high, tension, left, damping, step):
    """The step of the dual that balances if the cables inside their limits stay inside."""
    d, m = matrix.shape
    square, factor = np.zeros((d, d)), np.zeros((d, d))
    trace = 0.0
    for i in range(m):
        for k in range(d):
            trace += matrix[k, i] ** 2
        if low[i] < tension[i] < high[i]:
            for k in range(d):
                for j in range(k + 1):
                    square[k, j] += matrix[k, i] * matrix[j, i]
    shift = damping * trace / d
    for _ in range(20):
        if cholesky(square, shift, factor):
            break
        shift = 10.0 * max(shift, 1e-16 * trace)
    for k in range(d):
        left[k] = -left[k]
    solve_factored(factor, left, step)
    for k in range(d):
        left[k] = -left[k]


@jit_inner
def _take_up(matrix, low, high, step, tension):
    """Apply A^T step to the tensions that are inside their limits, and keep them there."""
    for i in range(matrix.shape[1]):
        if low[i] < tension[i] < high[i]:
            change = 0.0
            for k in range(matrix.shape[0]):
                change += matrix[k, i] * step[k]
            tension[i] = min(max(tension[i] + change, low[i]), high[i])


@jit_inner
def _none_balance(matrix, load, low, high, most_ever, dual):
    """Whether the dual proves that no tensions within limits balance (Farkas)."""
    d, m = matrix.shape
    most, size = 0.0, 0.0
    for k in range(d):
        most -= dual[k] * load[k]
        size += abs(dual[k] * load[k])
    for i in range(m):
        along = 0.0
        for k in range(d):
            along += dual[k] * matrix[k, i]
        if along != 0.0:
            most += along * (min(high[i], most_ever) if along > 0.0 else low[i])
    return most < -_PROVEN * size


@jit_allocating
def project(matrix, load, aim, low, high, tension):
    """min |tension - aim|^2 with A tension = load, low <= tension <= high; returns the outcome.

    A semismooth Newton method on the dual, whose gradient A clip(aim + A^T dual) - load is
    piecewise linear (Qi and Sun 1993; for projections on polyhedra Qi and Sun 2006): it ends after
    finitely many steps, most often two or three. Returns FOUND, NONE with a proof by Farkas' lemma,
    or UNDECIDED if tensions are so many times the load that convergence is slow.
    """
    d = matrix.shape[0]
    dual, tried, step, left = np.zeros(d), np.zeros(d), np.zeros(d), np.zeros(d)
    scale = 1e-300
    for k in range(d):
        scale = max(scale, abs(load[k]))
    for i in range(matrix.shape[1]):
        scale = max(scale, low[i], abs(aim[i]))
    value = _clipped(matrix, aim, low, high, dual, tension)
    most = _unbalanced(matrix, load, tension, left)
    for _ in range(_STEPS):
        if most <= _NEARLY * scale:
            # with a long dual, rounding remains: the cables inside their limits take it up
            for _ in range(3):
                if most <= _LEFT * scale:
                    break
                _newton_step(matrix, low, high, tension, left, 0.0, step)
                _take_up(matrix, low, high, step, tension)
                most = _unbalanced(matrix, load, tension, left)
            return FOUND if most <= 1e3 * _LEFT * scale else UNDECIDED
        if _none_balance(matrix, load, low, high, _MOST_EVER * scale, dual):
            return NONE
        _newton_step(matrix, low, high, tension, left, _DAMPING * min(1.0, most / scale), step)
        descent = 0.0
        for k in range(d):
            descent += left[k] * step[k]
        part, before = 1.0, most
        # with too few cables inside their limits a step is far too long; the first part of it that
        # is any better is still too long, so it is shortened to where the value is about least
        short, long = 0.0, 1.0
        for _ in range(_HALVINGS):
            work, slope = 0.0, 0.0
            for k in range(d):
                tried[k] = dual[k] + part * step[k]
                work += load[k] * tried[k]
            new = _clipped(matrix, aim, low, high, tried, tension) - work
            most = _unbalanced(matrix, load, tension, left)
            for k in range(d):
                slope += left[k] * step[k]
            # near the solution the dual's value is rounding, and the residual decides
            fine = new <= value + 1e-4 * part * descent or most < 0.5 * before
            if fine and (part == 1.0 or abs(slope) <= _FLAT * abs(descent)):
                break
            if slope > 0.0:
                long = part
            else:
                short = part
            part = 0.5 * (short + long)
        dual[:] = tried
        value = new
    return UNDECIDED


@jit_allocating
def project_batch(matrix, load, aim, low, high, tension, outcome):
    """:func:`project` for n poses: (n, d, m), (n, d), (n, m) each; fills tension and outcome."""
    for r in range(matrix.shape[0]):
        outcome[r] = project(matrix[r], load[r], aim[r], low[r], high[r], tension[r])


@jit_inner
def _sweep(matrix, low, high, tension, left):
    """Each tension once to where the residual is least with the others; the largest change."""
    d, m = matrix.shape
    most = 0.0
    for i in range(m):
        square, along = 0.0, 0.0
        for k in range(d):
            square += matrix[k, i] ** 2
            along += matrix[k, i] * left[k]
        if square == 0.0:
            continue
        new = min(max(tension[i] - along / square, low[i]), high[i])
        change = new - tension[i]
        tension[i] = new
        most = max(most, abs(change))
        for k in range(d):
            left[k] += matrix[k, i] * change
    return most


@jit_allocating
def nearest_batch(matrix, load, low, high, tension):
    """Tensions (n, m) within limits that minimise |A tension - load|, one after another in turn."""
    left = np.empty(matrix.shape[1])
    for r in range(matrix.shape[0]):
        largest = 0.0
        for i in range(matrix.shape[2]):
            tension[r, i] = low[r, i]
        _unbalanced(matrix[r], load[r], tension[r], left)
        for _ in range(_SWEEPS):
            change = _sweep(matrix[r], low[r], high[r], tension[r], left)
            for i in range(matrix.shape[2]):
                largest = max(largest, tension[r, i])
            if change <= _CHANGE * largest:
                break
