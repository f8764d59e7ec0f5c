"""The tensions nearest to wanted ones that balance a load within limits, by the dual problem."""

from __future__ import annotations

import numpy as np

from seecr.compiled.algebra import cholesky, solve_factored
from seecr.compiled.jit import jit_allocating, jit_inner

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
    piecewise linear (Qi and Sun 1993; for projections on polyhedra Qi and Sun 2006): it ends
    after finitely many steps, most often two or three. Returns FOUND, NONE with a proof by
    Farkas' lemma, or UNDECIDED if tensions are so many times the load that convergence is slow.

    Args:
        matrix: (d, m). load: (d,). aim, low, high: (m,). tension: (m,), filled.
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
    """Tensions (n, m) within limits that minimise |A tension - load|, one after another in turn.

    Args:
        matrix: (n, d, m). load: (n, d). low, high: (n, m). tension: (n, m), filled.
    """
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
