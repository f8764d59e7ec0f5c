"""Small dense linear algebra and rotations: a few unknowns, no allocation."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.jit import jit, jit_allocating, jit_inner, jit_lanes

# A pivot below this part of its diagonal entry is rounding, of which an entry that is a sum over
# cables has some tens of 1e-16: of either sign, so that a step may lead uphill.
_ROUNDED = 1e-14


@jit
def cholesky(a, shift, out):
    """Lower Cholesky factor of a + shift I; False if that is not positive definite."""
    n = a.shape[0]
    for j in range(n):
        total = a[j, j] + shift
        least = _ROUNDED * total
        for k in range(j):
            total -= out[j, k] * out[j, k]
        if not total > max(least, 0.0):
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
# Jacobi's rotations make a matrix diagonal (Golub and Van Loan, Matrix Computations, 8.5). They
# are as exact, to rounding of the largest entry, whether the eigenvalue is repeated, negative or
# zero. They need no branches, so that sixteen matrices are rotated abreast, in lanes as those of
# seecr.compiled.lanes: numbers of all lanes are the last axis.

# Lanes; of matrices whose largest entry is 1 the entries that are rounding; and most sweeps, of
# which five or six are enough.
_LANES, _ROUNDING, _SWEEPS = 16, 1e-17, 30
# Keeps a division from being 0/0; smaller numbers need no rotation.
_NOTHING = 1e-30
# Squared motion that is added, relative to the largest, where joints can be moved without the
# platform.
_IDLE = 1e-14
# Entries this close to the largest count as equal to it; the first of them is made positive.
_AS_LARGE = 1.0 - 1e-6


@jit_lanes
def _rotate(a, turn, active, p, q):
    """Rotate coordinates p < q of every lane that is active, so that its entry p, q gets zero.

    ``a`` (d, d, lanes) are upper triangles; ``turn`` (2, lanes) is filled with cosine and sine.
    """
    for i in range(_LANES):
        beside, apart = active[i] * a[p, q, i], a[q, q, i] - a[p, p, i]
        size = abs(apart) + math.sqrt(apart * apart + 4.0 * beside * beside) + _NOTHING
        tangent = (2.0 * beside if apart >= 0.0 else -2.0 * beside) / size
        cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
        turn[0, i], turn[1, i] = cosine, tangent * cosine
        a[p, p, i] -= tangent * beside
        a[q, q, i] += tangent * beside
        a[p, q, i] -= beside
    for k in range(a.shape[0]):
        if k != p and k != q:
            r, s, u, v = min(k, p), max(k, p), min(k, q), max(k, q)
            for i in range(_LANES):
                c, w, x, y = turn[0, i], turn[1, i], a[r, s, i], a[u, v, i]
                a[r, s, i], a[u, v, i] = c * x - w * y, w * x + c * y


@jit_lanes
def _turn_back(vectors, turn, p, q):
    """Vectors (d, lanes) as they were before coordinates p < q were rotated."""
    for i in range(_LANES):
        c, w, x, y = turn[0, i], turn[1, i], vectors[p, i], vectors[q, i]
        vectors[p, i], vectors[q, i] = c * x + w * y, c * y - w * x


@jit_inner
def _begin(matrix, a, i):
    """Put a matrix, scaled, into lane i; returns its largest entry, nan if one is not finite."""
    d, top = matrix.shape[0], 0.0
    for r in range(d):
        for c in range(r + 1):
            size = abs(matrix[r, c])
            top = size if size > top or not math.isfinite(size) else top
    known = 0.0 < top < np.inf
    for r in range(d):
        for c in range(r + 1):
            a[c, r, i] = matrix[r, c] / top if known else 0.0
    return top if top < np.inf else np.nan


@jit_inner
def _are_active(a, active):
    """Fill active (lanes,) with 1 where a lane is not diagonal yet; returns whether any is."""
    some = False
    for i in range(_LANES):
        most = 0.0
        for q in range(a.shape[0]):
            for p in range(q):
                most = max(most, abs(a[p, q, i]))
        active[i] = 1.0 if most > _ROUNDING else 0.0
        some = some or most > _ROUNDING
    return some


@jit_inner
def first_positive(vector, scale):
    """Multiply a vector by scale, and turn it so that its largest component is positive."""
    largest, first = 0.0, 0
    for k in range(vector.shape[0]):
        largest = max(largest, abs(vector[k]))
    while first < vector.shape[0] - 1 and abs(vector[first]) < _AS_LARGE * largest:
        first += 1
    if vector[first] < 0.0:
        scale = -scale
    for k in range(vector.shape[0]):
        vector[k] *= scale


@jit_allocating
def softest_batch(matrices, values, directions):
    """Smallest eigenvalues (n,) and eigenvectors (n, d) of symmetric matrices (n, d, d), filled.

    Only lower triangles are read; values are nan if an entry is not finite. Directions have unit
    length and a positive largest component; for a repeated eigenvalue they are any of its
    eigenvectors.
    """
    n, d = matrices.shape[:2]
    a, vectors = np.empty((d, d, _LANES)), np.empty((d, _LANES))
    turns, active, tops = np.empty((_SWEEPS, d, d, 2, _LANES)), np.empty(_LANES), np.empty(_LANES)
    for first in range(0, n, _LANES):
        for i in range(_LANES):
            tops[i] = _begin(matrices[min(first + i, n - 1)], a, i)
        sweeps = 0
        while sweeps < _SWEEPS and _are_active(a, active):
            for p in range(d - 1):
                for q in range(p + 1, d):
                    _rotate(a, turns[sweeps, p, q], active, p, q)
            sweeps += 1
        for i in range(_LANES):
            best = 0
            for k in range(d):
                best = k if a[k, k, i] < a[best, best, i] else best
                vectors[k, i] = 0.0
            vectors[best, i] = 1.0
            if first + i < n:
                values[first + i] = a[best, best, i] * tops[i]
        # only one vector is asked for: turning that back takes less than turning all along
        while sweeps > 0:
            sweeps -= 1
            for p in range(d - 2, -1, -1):
                for q in range(d - 1, p, -1):
                    _turn_back(vectors, turns[sweeps, p, q], p, q)
        for at in range(first, min(first + _LANES, n)):
            for k in range(d):
                directions[at, k] = vectors[k, at - first] + 0.0 * tops[at - first]
            first_positive(directions[at], 1.0 / norm(directions[at]))


@jit
def diagonalise(a, vectors):
    """Turn a symmetric matrix, of which the lower triangle is read, into its eigenvalues.

    They are on its diagonal then, in no order, and their vectors are columns. Jacobi's rotations
    again: NumPy's ``eigh``, compiled, would load SciPy when it is first called, which takes 0.2 s.
    """
    d, top, some = a.shape[0], 0.0, True
    for r in range(d):
        for c in range(d):
            vectors[r, c] = 1.0 if r == c else 0.0
            a[min(r, c), max(r, c)] = a[max(r, c), min(r, c)]
            top = max(top, abs(a[r, c]))
    for _ in range(_SWEEPS):
        if not some:
            break
        some = False
        for p in range(d - 1):
            for q in range(p + 1, d):
                beside, apart = a[p, q], a[q, q] - a[p, p]
                if abs(beside) <= _ROUNDING * top:
                    continue
                some = True
                size = abs(apart) + math.hypot(apart, 2.0 * beside)
                tangent = (2.0 * beside if apart >= 0.0 else -2.0 * beside) / size
                cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
                sine = tangent * cosine
                for k in range(d):
                    x, y = a[k, p], a[k, q]
                    a[k, p], a[k, q] = cosine * x - sine * y, sine * x + cosine * y
                    x, y = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = cosine * x - sine * y, sine * x + cosine * y
                for k in range(d):
                    x, y = a[p, k], a[q, k]
                    a[p, k], a[q, k] = cosine * x - sine * y, sine * x + cosine * y


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


@jit_allocating
def softest_motions(matrices, columns, values, motions):
    """The same on joints, as motions (n, 6) of the platform: of K v = value M v, M their products.

    Unlike eigenvalues of K, which is by steps of the joints, they do not depend on the order and
    places of joints. ``columns`` (n, d, 6) are the platform's motion per step of each joint.
    """
    n, d = matrices.shape[:2]
    factors, reduced, steps = np.empty((n, d, d)), np.empty((n, d, d)), np.empty((n, d))
    for k in range(n):
        if np.isfinite(columns[k]).all():
            _factor_motion(columns[k], reduced[k], factors[k])
            _onto_motion(matrices[k], factors[k], reduced[k])
        else:
            reduced[k] = factors[k] = math.nan
    softest_batch(reduced, values, steps)
    for k in range(n):
        # the motion of steps L^-T direction
        for back in range(d):
            i = d - 1 - back
            for j in range(i + 1, d):
                steps[k, i] -= factors[k, j, i] * steps[k, j]
            steps[k, i] /= factors[k, i, i]
        for j in range(6):
            motions[k, j] = 0.0
            for i in range(d):
                motions[k, j] += steps[k, i] * columns[k, i, j]
        first_positive(motions[k], 1.0)
