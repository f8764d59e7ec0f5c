"""Small dense linear algebra and rotations: a few unknowns, no allocation."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.jit import jit, jit_allocating, jit_inner


@jit
def cholesky(a, shift, out):
    """Lower Cholesky factor of a + shift I; False if that is not positive definite."""
    n = a.shape[0]
    for j in range(n):
        total = a[j, j] + shift
        for k in range(j):
            total -= out[j, k] * out[j, k]
        if not total > 0.0:
            return False
        out[j, j] = math.sqrt(total)
        inverse = 1.0 / out[j, j]
        for i in range(j + 1, n):
            total = a[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            out[i, j] = total * inverse
    return True


@jit_inner
def solve_factored(factor, b, out):
    n = factor.shape[0]
    for i in range(n):
        inverse, total = 1.0 / factor[i, i], b[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total * inverse
    for back in range(n):
        i = n - 1 - back
        inverse, total = 1.0 / factor[i, i], out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total * inverse


@jit_inner
def eliminate(a, b, out):
    """Solve a general small system by elimination with row pivots; ``a`` is overwritten."""
    n = a.shape[0]
    copy_vector(b, out)
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(a[r, c]) > abs(a[best, c]):
                best = r
        for k in range(c, n):
            a[c, k], a[best, k] = a[best, k], a[c, k]
        out[c], out[best] = out[best], out[c]
        for r in range(c + 1, n):
            part = a[r, c] / a[c, c]
            for k in range(c + 1, n):
                a[r, k] -= part * a[c, k]
            out[r] -= part * out[c]
    for back in range(n):
        i = n - 1 - back
        for k in range(i + 1, n):
            out[i] -= a[i, k] * out[k]
        out[i] /= a[i, i]


@jit_inner
def solve_3x3(a, b, out):
    """Solve a 3x3 system by Cramer's rule."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c01 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    c10 = a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2]
    c11 = a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]
    c12 = a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]
    c20 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    c21 = a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    out[0] = (c00 * b[0] + c10 * b[1] + c20 * b[2]) / det
    out[1] = (c01 * b[0] + c11 * b[1] + c21 * b[2]) / det
    out[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det


@jit_inner
def next_within(low, high, at, newton, before):
    """The next point of a search for the root between ``low`` and ``high``, one of which is ``at``.

    That is Newton's, or the middle. About a kink Newton's steps may circle for long inside of the
    bracket, so that one that is longer than half the step before is not taken. A step that rounding
    takes back to ``at`` ends a search, as does a middle that is ``low`` or ``high``.
    """
    if newton == at or (low < newton < high and abs(newton - at) <= 0.5 * before):
        return newton
    middle = 0.5 * (low + high)
    return middle if math.isfinite(middle) else newton


@jit_inner
def largest_diagonal(a):
    """Largest absolute diagonal entry."""
    top = 0.0
    for k in range(a.shape[0]):
        top = max(top, abs(a[k, k]))
    return top


@jit_inner
def norm(v):
    total = 0.0
    for k in range(v.shape[0]):
        total += v[k] * v[k]
    return math.sqrt(total)


@jit_inner
def copy_vector(values, out):
    for k in range(values.shape[0]):
        out[k] = values[k]


@jit_inner
def copy_rows(values, out):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            out[i, k] = values[i, k]


# Quaternions as scalars, in forms that keep the digits of small rotations.


@jit
def rotated_less(w, x, y, z, a, b, c):
    cx, cy, cz = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        2.0 * (w * cx + y * cz - z * cy),
        2.0 * (w * cy + z * cx - x * cz),
        2.0 * (w * cz + x * cy - y * cx),
    )


@jit_inner
def quaternion_product(a, b, c, d, w, x, y, z):
    # by pairs: of a rotation and its inverse exactly none is left
    return (
        a * w - (b * x + c * y + d * z),
        a * x + w * b + (c * z - d * y),
        a * y + w * c + (d * x - b * z),
        a * z + w * d + (b * y - c * x),
    )


@jit
def turned(x, y, z, a, b, c, d):
    """exp(rotation vector) times a quaternion, normalised."""
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    s = 0.5 if half < 1e-8 else math.sin(half) / angle
    a, b, c, d = quaternion_product(math.cos(half), s * x, s * y, s * z, a, b, c, d)
    inverse = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inverse, b * inverse, c * inverse, d * inverse


# Quaternions, rotation vectors and poses, row by row: what seecr.pose does with NumPy.
#
# NumPy's calls take ten times as long as the numbers of a hundred rows. An array with one row is
# that for all.

# Below this sine of half the angle the series of 2 asin(s)/s is exact to double precision.
_SMALL = 1e-4


@jit
def multiply_rows(a, b, out):
    """Hamilton products (n, 4)."""
    for r in range(len(out)):
        i, j = r % len(a), r % len(b)
        out[r, 0], out[r, 1], out[r, 2], out[r, 3] = quaternion_product(
            a[i, 0], a[i, 1], a[i, 2], a[i, 3], b[j, 0], b[j, 1], b[j, 2], b[j, 3]
        )


@jit
def rotate_rows(quat, vectors, out):
    """Vectors (n, 3) turned by unit quaternions."""
    for r in range(len(out)):
        i, j = r % len(quat), r % len(vectors)
        a, b, c = vectors[j, 0], vectors[j, 1], vectors[j, 2]
        x, y, z = rotated_less(quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3], a, b, c)
        out[r, 0], out[r, 1], out[r, 2] = a + x, b + y, c + z


@jit_inner
def _rotation_vector(w, x, y, z):
    """Of a unit quaternion, of length at most pi."""
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    per = 2.0 + sine * sine / 3.0 if sine < _SMALL else 2.0 * math.atan2(sine, w) / sine
    return per * x, per * y, per * z


@jit
def rotation_vector_rows(quat, out):
    """Rotation vectors (n, 3) of unit quaternions (n, 4)."""
    for r in range(len(out)):
        w, x, y, z = quat[r, 0], quat[r, 1], quat[r, 2], quat[r, 3]
        out[r, 0], out[r, 1], out[r, 2] = _rotation_vector(w, x, y, z)


@jit
def difference_rows(a, b, out):
    """Changes (n, 6) from poses ``b`` to poses ``a``."""
    for r in range(len(out)):
        i, j = r % len(a), r % len(b)
        for k in range(3):
            out[r, k] = a[i, k] - b[j, k]
        w, x, y, z = quaternion_product(
            a[i, 3], a[i, 4], a[i, 5], a[i, 6], b[j, 3], -b[j, 4], -b[j, 5], -b[j, 6]
        )
        out[r, 3], out[r, 4], out[r, 5] = _rotation_vector(w, x, y, z)


@jit
def add_rows(poses, changes, out):
    """Poses (n, 7) after changes (n, 6)."""
    for r in range(len(out)):
        i, j = r % len(poses), r % len(changes)
        for k in range(3):
            out[r, k] = poses[i, k] + changes[j, k]
        out[r, 3], out[r, 4], out[r, 5], out[r, 6] = turned(
            changes[j, 3], changes[j, 4], changes[j, 5],
            poses[i, 3], poses[i, 4], poses[i, 5], poses[i, 6],
        )  # fmt: skip


@jit
def deviate_rows(deviation, poses, out):
    """Poses (n, 7) that deviate from ``poses`` by displacements and quaternions (n, 7)."""
    for r in range(len(out)):
        i, j = r % len(deviation), r % len(poses)
        for k in range(3):
            out[r, k] = poses[j, k] + deviation[i, k]
        w, x, y, z = quaternion_product(
            deviation[i, 3], deviation[i, 4], deviation[i, 5], deviation[i, 6],
            poses[j, 3], poses[j, 4], poses[j, 5], poses[j, 6],
        )  # fmt: skip
        size = math.sqrt(w * w + x * x + y * y + z * z)
        out[r, 3], out[r, 4], out[r, 5], out[r, 6] = w / size, x / size, y / size, z / size


# The smallest eigenvalue of small symmetric matrices, and an eigenvector of it.
#
# Householder's reflections make the matrix tridiagonal, Laguerre's steps on its characteristic
# polynomial find the eigenvalue from below, and inverse iteration with the matrix itself finds the
# eigenvector (Wilkinson, The Algebraic Eigenvalue Problem, 5.29, 7.26 and 5.54). This takes a
# fifth of the time of all eigenvectors, and is as exact, to rounding of the largest entry, whether
# the eigenvalue is repeated, negative or zero.

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
    """Smallest eigenvalues (n,) and eigenvectors (n, d) of symmetric matrices (n, d, d), filled.

    Only lower triangles are read; values are nan if an entry is not finite. Directions have unit
    length and a positive largest component; for a repeated eigenvalue they are any of its
    eigenvectors.
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
    """The same on joints, as motions (n, 6) of the platform: of K v = value M v, M their products.

    Unlike eigenvalues of K, which is by steps of the joints, they do not depend on the order and
    places of joints. ``columns`` (n, d, 6) are the platform's motion per step of each joint.
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
