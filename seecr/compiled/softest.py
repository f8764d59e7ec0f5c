"""The smallest eigenvalue of small symmetric matrices, and an eigenvector of it.

Householder's reflections make the matrix tridiagonal, Laguerre's steps on its characteristic
polynomial find the eigenvalue from below, and inverse iteration with the matrix itself finds the
eigenvector (Wilkinson, The Algebraic Eigenvalue Problem, 5.29, 7.26 and 5.54). This takes a fifth
of the time of all eigenvectors, and is as exact, to rounding of the largest entry, whether the
eigenvalue is repeated, negative or zero.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import cholesky, norm, solve_factored
from seecr.compiled.jit import jit_allocating, jit_inner

# For matrices whose largest entry is 1: the rounding of zero, and how far below the smallest
# eigenvalue the first shift for a Cholesky factor is.
_ROUNDING, _BELOW = 2e-16, 1e-15
# Squared motion that is added, relative to the largest, where joints can be moved without the
# platform.
_IDLE = 1e-14
# Entries this close to the largest count as equal to it; the first of them is made positive.
_AS_LARGE = 1.0 - 1e-6


@jit_inner
def _make_tridiagonal(a, diagonal, beside, v, p):
    """Diagonal (n,) and subdiagonal (n - 1, then 0); the lower triangle is overwritten."""
    n = a.shape[0]
    for k in range(n - 2):
        size = 0.0
        for i in range(k + 1, n):
            v[i] = a[i, k]
            size += v[i] * v[i]
        size = math.sqrt(size)
        diagonal[k], beside[k] = a[k, k], 0.0
        if size == 0.0:
            continue
        beside[k] = -size if v[k + 1] >= 0.0 else size
        v[k + 1] -= beside[k]
        # I - factor v v' is the reflection
        factor, along = 1.0 / (size * abs(v[k + 1])), 0.0
        for i in range(k + 1, n):
            total = 0.0
            for j in range(k + 1, i + 1):
                total += a[i, j] * v[j]
            for j in range(i + 1, n):
                total += a[j, i] * v[j]
            p[i] = factor * total
            along += p[i] * v[i]
        along *= 0.5 * factor
        for i in range(k + 1, n):
            p[i] -= along * v[i]
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                a[i, j] -= v[i] * p[j] + p[i] * v[j]
    for k in range(max(n - 2, 0), n):
        diagonal[k] = a[k, k]
        beside[k] = a[k + 1, k] if k + 1 < n else 0.0


@jit_inner
def _sums(diagonal, beside, at):
    """Sums of 1/(lambda - at) and of its square over the eigenvalues; 0 if one lies below ``at``.

    They follow from the pivots of the matrix minus ``at``, whose product is the characteristic
    polynomial, and from the pivots' first two derivatives.
    """
    one, two = 0.0, 0.0
    square, inverse, slope, bend = 0.0, 0.0, 0.0, 0.0
    for i in range(diagonal.shape[0]):
        # of the pivot before: slope and bend are divided by it
        part = square * inverse
        pivot = diagonal[i] - at - part
        if not pivot > 0.0:
            return 0.0, 0.0
        inverse = 1.0 / pivot
        bend = part * (bend - 2.0 * slope * slope) * inverse
        slope = (part * slope - 1.0) * inverse
        one -= slope
        two += slope * slope - bend
        square = beside[i] * beside[i]
    return one, two


@jit_inner
def _smallest(diagonal, beside):
    """The smallest eigenvalue of a tridiagonal matrix with entries of size 1.

    Laguerre's steps from below never pass it; a step that passes it by rounding is halved.
    """
    n, low = diagonal.shape[0], np.inf
    for i in range(n):
        low = min(low, diagonal[i] - abs(beside[i]) - (abs(beside[i - 1]) if i > 0 else 0.0))
    one, two, step = 0.0, 0.0, _ROUNDING
    while one == 0.0:
        low -= step
        step *= 2.0
        one, two = _sums(diagonal, beside, low)
    step = 1.0
    while step > _ROUNDING and low + step > low:
        root = max(n * two - one * one, 0.0)
        step = n / (one + math.sqrt((n - 1.0) * root))
        while step > _ROUNDING:
            there, squared = _sums(diagonal, beside, low + step)
            if there > 0.0:
                low, one, two = low + step, there, squared
                break
            step *= 0.5
    return low


@jit_inner
def _softest(matrix, scaled, factor, work, direction):
    """Smallest eigenvalue of a matrix, from its lower triangle; fills the direction (n,)."""
    n, top = matrix.shape[0], 0.0
    finite = True
    for i in range(n):
        for j in range(i + 1):
            finite = finite and math.isfinite(matrix[i, j])
            top = max(top, abs(matrix[i, j]))
    for k in range(n):
        direction[k] = np.nan if not finite else 1.0 if k == 0 else 0.0
    if top == 0.0 or not finite:
        return 0.0 if finite else np.nan
    for i in range(n):
        for j in range(i + 1):
            scaled[i, j] = factor[i, j] = matrix[i, j] / top
    diagonal, beside, x = work[0], work[1], work[2]
    _make_tridiagonal(factor, diagonal, beside, x, work[3])
    least = _smallest(diagonal, beside)
    below = _BELOW
    while not cholesky(scaled, below - least, factor):
        below *= 2.0
    for k in range(n):
        # irregular, so that no eigenvector is orthogonal to it
        x[k] = 1.0 / (k + 1.618)
    for _ in range(3):
        solve_factored(factor, x, direction)
        size, largest = norm(direction), 0.0
        for k in range(n):
            x[k] = direction[k] / size
            largest = max(largest, abs(x[k]))
    first = 0
    while abs(x[first]) < _AS_LARGE * largest:
        first += 1
    for k in range(n):
        direction[k] = x[k] if x[first] > 0.0 else -x[k]
    return least * top


@jit_allocating
def softest_batch(matrices, values, directions):
    """Smallest eigenvalues and eigenvectors of symmetric matrices (n, d, d), from lower triangles.

    Args:
        matrices: only read.
        values: (n,), filled; nan if an entry is not finite.
        directions: (n, d), filled: of unit length, with a positive largest component; for a
            repeated eigenvalue, any of its eigenvectors.
    """
    d = matrices.shape[1]
    scaled, factor, work = np.empty((d, d)), np.empty((d, d)), np.empty((4, d))
    for k in range(len(matrices)):
        values[k] = _softest(matrices[k], scaled, factor, work, directions[k])


@jit_inner
def _factor_motion(columns, square, factor):
    """Cholesky factor of the products of motions; joints that move nothing count as hardly any."""
    d, top = columns.shape[0], 0.0
    for i in range(d):
        for j in range(i + 1):
            total = 0.0
            for k in range(6):
                total += columns[i, k] * columns[j, k]
            square[i, j] = total
        top = max(top, square[i, i])
    shift = 0.0
    while not cholesky(square, shift, factor):
        shift = 10.0 * shift + _IDLE * top + 1e-300


@jit_inner
def _onto_motion(matrix, factor, out):
    """Fill out = L^-1 matrix L^-T, from the lower triangle of the matrix."""
    d = matrix.shape[0]
    for i in range(d):
        for j in range(d):
            total = matrix[i, j] if j <= i else matrix[j, i]
            for k in range(j):
                total -= out[i, k] * factor[j, k]
            out[i, j] = total / factor[j, j]
    for j in range(d):
        for i in range(d):
            total = out[i, j]
            for k in range(i):
                total -= factor[i, k] * out[k, j]
            out[i, j] = total / factor[i, i]


@jit_inner
def _motion_of(direction, factor, columns, motion):
    """The motion (6,) of steps L^-T direction, with a positive largest component."""
    d = direction.shape[0]
    for back in range(d):
        i = d - 1 - back
        for k in range(i + 1, d):
            direction[i] -= factor[k, i] * direction[k]
        direction[i] /= factor[i, i]
    largest, first = 0.0, 0
    for k in range(6):
        motion[k] = 0.0
        for i in range(d):
            motion[k] += direction[i] * columns[i, k]
        largest = max(largest, abs(motion[k]))
    while first < 5 and abs(motion[first]) < _AS_LARGE * largest:
        first += 1
    if motion[first] < 0.0:
        for k in range(6):
            motion[k] = -motion[k]


@jit_allocating
def softest_motions(matrices, columns, values, motions):
    """The same on joints, as motions of the platform: of K v = value M v, M their products.

    Unlike eigenvalues of K itself they do not depend on the order and places of joints.

    Args:
        matrices: (n, d, d) K by steps of the joints, only read.
        columns: (n, d, 6) motion of the platform per step of each joint.
        values: (n,), filled; nan if an entry is not finite.
        motions: (n, 6), filled: of unit length, with a positive largest component.
    """
    d = matrices.shape[1]
    scaled, factor, work = np.empty((d, d)), np.empty((d, d)), np.empty((4, d))
    own, reduced, direction = np.empty((d, d)), np.empty((d, d)), np.empty(d)
    for k in range(len(matrices)):
        values[k] = math.nan
        for i in range(6):
            motions[k, i] = math.nan
        if not np.isfinite(columns[k]).all():
            continue
        _factor_motion(columns[k], reduced, own)
        _onto_motion(matrices[k], own, reduced)
        values[k] = _softest(reduced, scaled, factor, work, direction)
        if math.isfinite(values[k]):
            _motion_of(direction, own, columns[k], motions[k])
