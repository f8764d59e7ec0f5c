"""Orientations in which cables hold a platform at a given position, one position at a time.

With fewer cables than degrees of freedom, W(R) tau = -w is solved for the orientation R and the
tensions together (Carricato and Merlet 2013), by the method of Levenberg and Marquardt with limits
on the tensions: it also goes on where the linearised equations have no solution within the limits.
The balance is that of straight cables, :mod:`seecr.compiled.straight`; a cable law is needed only
for the stability. Derivatives are exact for free platforms, else by finite differences along the
few rotations, in each of which the joints keep the platform's origin.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    copy_rows,
    copy_vector,
    largest_diagonal,
    solve_factored,
)
from seecr.compiled.columns import (
    EA,
)
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.placing import bring, make_placing_space, turning_basis
from seecr.compiled.steps import advance
from seecr.compiled.straight import (
    balance_straight,
    left_of,
    make_turning_space,
    rates_of_rotations,
)

# Most steps, the residual that ends them, and the one that suffices if it gets no smaller [load].
_STEPS, _EXACT, _ENOUGH = 60, 1e-14, 1e-12
# First, smallest and largest damping; factors after a better and after a worse step.
_FIRST, _LEAST, _MOST, _BETTER, _WORSE = 1e-2, 1e-12, 1e4, 0.1, 8.0
# A search ends if so many steps do not reduce the squared residual by this factor.
_PATIENCE, _GAIN = 6, 0.7
# Longest rotation of one step [rad], and step of finite differences [robot's length].
_LONGEST, _DIFFERENCE = 0.6, 1e-6
# A stiffness below this part of the largest counts as zero.
_FIRM = 1e-12
# The margin is raised by this part of a cable's share of the load, less each time that fails; and
# most attempts.
_RAISE, _FINEST, _RAISES = 0.25, 2e-3, 24


@jit_inner
def _beside(number, by, row, state, length, space, tension, left):
    """Residual (d,) after a step ``by`` [m] along one coordinate."""
    (cables, load, pose, screws), (place, values) = row, state
    step, trial, trial_values = space[6:9]
    step[:] = 0.0
    step[number] = by
    advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
    balance_straight(cables, load, pose, trial, length, space)
    left_of(space, tension, left)


@jit_inner
def _is_firm(row, state, length, space, tension):
    """Whether the platform is stable there with plain elastic cables."""
    (cables, load, pose, screws), (place, values) = row, state
    left, other, hessian, factor = space[9:13]
    d, by = left.shape[0], _DIFFERENCE * length
    for k in range(d):
        _beside(k, by, row, state, length, space, tension, left)
        _beside(k, -by, row, state, length, space, tension, other)
        for j in range(d):
            hessian[k, j] = (left[j] - other[j]) / (2.0 * by)
    space[6][:] = 0.0
    advance(place, values, space[6], length, screws, pose, space[7], space[8], space[0])
    balance_straight(cables, load, pose, place, length, space)
    pulls, spans = space[3], space[5]
    for k in range(d):
        for j in range(k + 1):
            total = 0.5 * (hessian[k, j] + hessian[j, k])
            for i in range(tension.shape[0]):
                rate = (cables[i, EA] + tension[i]) / spans[i]
                total += rate * pulls[i, k] * pulls[i, j]
            hessian[k, j] = hessian[j, k] = total
    return cholesky(hessian, -_FIRM * largest_diagonal(hessian), factor)


@jit_inner
def _normal_equations(turns, scale, low, high, tension, left, space):
    """Fill those of rotations and tensions; tensions that would leave their limits do not move."""
    rates, normal, _factor, right = space[13:17]
    n, d = right.shape[0], left.shape[0]
    for a in range(n):
        right[a] = 0.0
        for k in range(d):
            right[a] -= rates[a, k] * left[k] / scale
        for b in range(a + 1):
            total = 0.0
            for k in range(d):
                total += rates[a, k] * rates[b, k]
            normal[a, b] = normal[b, a] = total
    for a in range(turns, n):
        pull = tension[a - turns]
        if (pull <= low[a - turns] and right[a] < 0.0) or (
            pull >= high[a - turns] and right[a] > 0.0
        ):
            right[a] = 0.0
            for b in range(n):
                normal[a, b] = normal[b, a] = 0.0
            normal[a, a] = 1.0


@jit_inner
def _step(turns, damping, space):
    """A damped step of the rotations and tensions: fills ``move``, space[17]."""
    normal, factor, right, move = space[14:18]
    while not cholesky(normal, damping, factor):
        damping *= 10.0
    solve_factored(factor, right, move)
    far = 0.0
    for a in range(turns):
        far += move[a] ** 2
    part = min(1.0, _LONGEST / max(math.sqrt(far), 1e-300))
    for a in range(move.shape[0]):
        move[a] *= part


@jit_inner
def _onto_turns(move, turns, length, basis, step):
    """From rotations [rad] to a step (d,) of all coordinates [m]."""
    on_joints = basis.shape[1] > 0
    for k in range(step.shape[0]):
        step[k] = 0.0
        if on_joints:
            for a in range(turns):
                step[k] += move[a] * length * basis[a, k]
        elif k >= step.shape[0] - turns:
            step[k] = move[k - step.shape[0] + turns] * length


@jit_inner
def _turned(row, state, step, length, space, placing):
    """The trial state, space[7:9], after a step that turns the platform about its origin."""
    (_cables, _load, pose, screws), (place, values), (trial, trial_values) = row, state, space[7:9]
    if screws.shape[0] == 0:
        advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
        return
    for k in range(step.shape[0]):
        trial_values[k] = values[k] + step[k]
    bring(screws, trial_values, length, pose, 0.0, 0.0, 0.0, trial, placing)


@jit_inner
def _rotate_all(row, state, length, scale, tension, space, placing):
    """Fill the rates, space[13], of the residual by rotations and tensions [loads per one].

    The state is the one whose balance was computed last.
    """
    cables, load, pose, screws = row
    left, other, rates, step, basis = space[9], space[10], space[13], space[6], placing[2]
    by, turns = _DIFFERENCE * length, rates.shape[0] - tension.shape[0]
    copy_rows(space[3], rates[turns:])
    if screws.shape[0] == 0:  # not on joints
        rates_of_rotations(load, length, scale, tension, space)
        return
    turning_basis(placing)
    for a in range(turns):
        for k in range(step.shape[0]):
            step[k] = by * basis[a, k]
        _turned(row, state, step, length, space, placing)
        balance_straight(cables, load, pose, space[7], length, space)
        left_of(space, tension, other)
        for j in range(left.shape[0]):
            rates[a, j] = (other[j] - left[j]) / by * length / scale


@jit_inner
def _solve(row, state, length, scale, low, high, tension, space, placing):
    """Balance a platform from a state, in place; returns whether that succeeded."""
    (cables, load, pose, screws), (place, values) = row, state
    left, other, right, move, tried = space[9], space[10], space[16], space[17], space[18]
    m = tension.shape[0]
    turns = right.shape[0] - m
    damping, mark, idle = _FIRST, np.inf, 0
    step, trial, trial_values = space[6:9]
    step[:] = 0.0
    advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
    balance_straight(cables, load, pose, place, length, space)
    size = left_of(space, tension, left) / scale
    for _ in range(_STEPS):
        if size <= _EXACT:
            return True
        _rotate_all(row, state, length, scale, tension, space, placing)
        _normal_equations(turns, scale, low, high, tension, left, space)
        better = False
        while not better and damping <= _MOST:
            _step(turns, damping, space)
            _onto_turns(move, turns, length, placing[2], step)
            for i in range(m):
                tried[i] = min(max(tension[i] + move[turns + i] * scale, low[i]), high[i])
            _turned(row, state, step, length, space, placing)
            balance_straight(cables, load, pose, trial, length, space)
            new = left_of(space, tried, other) / scale
            better = new < size
            damping = max(damping * _BETTER, _LEAST) if better else max(damping, 1e-6) * _WORSE
            if not better and size <= _ENOUGH:
                break
        if not better:
            break
        copy_vector(trial, place)
        copy_vector(trial_values, values)
        copy_vector(tried, tension)
        copy_vector(other, left)
        size = new
        if size * size < _GAIN * mark:
            mark, idle = size * size, 0
        else:
            idle += 1
            if idle >= _PATIENCE:
                break
    return size <= _ENOUGH


@jit_inner
def _inside(low, high, tension):
    """How far all tensions are inside limits [N]."""
    least = np.inf
    for i in range(tension.shape[0]):
        least = min(least, min(tension[i] - low[i], high[i] - tension[i]))
    return least


@jit_inner
def _raise(row, state, other, length, scale, low, high, space, placing):
    """Turn a platform that is held to where the tensions are farther inside; returns how far."""
    narrow_low, narrow_high, tension, pulls = space[19:23]
    m = tension.shape[0]
    share = scale / m
    best, by = _inside(low, high, tension), _RAISE * share
    for _ in range(_RAISES):
        if by < _FINEST * share:
            break
        for i in range(m):
            narrow_low[i], narrow_high[i] = low[i] + best + by, high[i] - best - by
            if narrow_low[i] > narrow_high[i]:
                narrow_low[i] = narrow_high[i] = 0.5 * (low[i] + high[i])
            pulls[i] = min(max(tension[i], narrow_low[i]), narrow_high[i])
        copy_vector(state[0], other[0])
        copy_vector(state[1], other[1])
        held = _solve(row, other, length, scale, narrow_low, narrow_high, pulls, space, placing)
        if held and _is_firm(row, other, length, space, pulls):
            copy_vector(other[0], state[0])
            copy_vector(other[1], state[1])
            copy_vector(pulls, tension)
            best = _inside(low, high, tension)
            by *= 2.0
        else:
            by *= 0.25
    return best


@jit_allocating
def turn_batch(
    cables, load, poses, screws, turns, length, scale, low, high, starts, start_values, farther,
    best, best_values, margins,
):  # fmt: skip
    """Orientations that hold n platforms, from k starts each; better ones replace those known.

    Args:
        cables: (n, m, N_COLUMNS). load: (n, N_LOAD). poses: (n, 7). screws: (n, d or 0, 7).
        turns: independent rotations about the origin. length: [m]. scale: (n,) [N].
        low, high: (n, m) [N] limits.
        starts: (n, k, 7) deviations. start_values: (n, k, d) joint values, hinges times length; on
            joints only their rotations count.
        farther: try all starts, and turn on to where tensions are farther inside; otherwise the
            first orientation that holds will do.
        best: (n, 7), best_values: (n, d), margins: (n,) [N] the best so far, updated; minus
            infinity where there is none.
    """
    m, d = cables.shape[1], start_values.shape[2]
    space = make_turning_space(m, d, screws.shape[1], turns)
    placing = make_placing_space(space[0], space[1], turns)
    state, other = (np.empty(7), np.zeros(d)), (np.empty(7), np.zeros(d))
    tension = space[21]
    for r in range(poses.shape[0]):
        row, least, most = (cables[r], load[r], poses[r], screws[r]), low[r], high[r]
        for k in range(starts.shape[1]):
            copy_vector(starts[r, k], state[0])
            copy_vector(start_values[r, k], state[1])
            if not bring(screws[r], state[1], length, poses[r], 0.0, 0.0, 0.0, state[0], placing):
                continue
            for i in range(m):
                tension[i] = min(max(scale[r] / m, least[i]), most[i])
            held = _solve(row, state, length, scale[r], least, most, tension, space, placing)
            if not held or not _is_firm(row, state, length, space, tension):
                continue
            margin = _inside(least, most, tension)
            if farther and turns + m > d:
                margin = _raise(row, state, other, length, scale[r], least, most, space, placing)
            if margin > margins[r]:
                margins[r] = margin
                copy_vector(state[0], best[r])
                copy_vector(state[1], best_values[r])
            if not farther:
                break
