"""Small dense linear algebra: a few unknowns, no allocation."""

from __future__ import annotations

import math

from seecr.compiled.jit import jit, jit_inner


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
