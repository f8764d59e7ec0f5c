"""Orientations in which cables hold a platform at a given position, one position at a time.

With fewer cables than degrees of freedom, W(R) tau = -w is solved for the orientation R and the
tensions together (Carricato and Merlet 2013), by the method of Levenberg and Marquardt with limits
on the tensions: it also goes on where the linearised equations have no solution within the limits.
A straight cable's direction does not depend on its tension, so no cable law is needed here, except
for the stability. Derivatives are by finite differences along the few rotations.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    copy_rows,
    copy_vector,
    largest_diagonal,
    norm,
    solve_factored,
)
from seecr.compiled.columns import (
    ANCHOR,
    CENTRE_OF_MASS,
    EA,
    EXIT,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE_OF_WEIGHT,
)
from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.joints import N_CURRENT, joint_columns, onto_joints_gradient, place_joints
from seecr.compiled.rotation import rotated_less
from seecr.compiled.steps import advance

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
def _onto(own, columns, out):
    """From the platform's own (6,) to its coordinates (d,)."""
    if columns.shape[0] == 0:
        copy_vector(own, out)
    else:
        onto_joints_gradient(own, columns, out)


@jit_inner
def _moment(ax, ay, az, per, own):
    """Complete a force in ``own`` (6,) by its moment about the platform's origin."""
    own[3] = (ay * own[2] - az * own[1]) * per
    own[4] = (az * own[0] - ax * own[2]) * per
    own[5] = (ax * own[1] - ay * own[0]) * per


@jit_inner
def _balance(cables, load, pose, place, length, space):
    """Fill the pulls (m, d), weight (d,) and spans (m,) of the balance pulls^T tau = weight."""
    current, columns, own, pulls, weight, spans = space[0:6]
    per, m = 1.0 / length, cables.shape[0]
    px, py, pz = pose[0] + place[0], pose[1] + place[1], pose[2] + place[2]
    if current.shape[0] > 0:
        joint_columns(current, px, py, pz, per, columns)
    for i in range(m + 1):
        if i < m:
            a, b, c = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        else:
            a, b, c = load[CENTRE_OF_MASS], load[CENTRE_OF_MASS + 1], load[CENTRE_OF_MASS + 2]
        dx, dy, dz = rotated_less(pose[3], pose[4], pose[5], pose[6], a, b, c)
        a, b, c = a + dx, b + dy, c + dz
        dx, dy, dz = rotated_less(place[3], place[4], place[5], place[6], a, b, c)
        a, b, c = a + dx, b + dy, c + dz
        if i < m:
            own[0], own[1] = px + a - cables[i, EXIT], py + b - cables[i, EXIT + 1]
            own[2] = pz + c - cables[i, EXIT + 2]
            spans[i] = max(math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2), 1e-12 * length)
            for k in range(3):
                own[k] /= spans[i]
            _moment(a, b, c, per, own)
            _onto(own, columns, pulls[i])
        else:
            for k in range(3):
                own[k] = load[FORCE_OF_WEIGHT + k]
            _moment(a, b, c, per, own)
            for k in range(3):
                own[k] += load[EXTERNAL_FORCE + k]
                own[3 + k] += load[EXTERNAL_MOMENT + k] * per
            _onto(own, columns, weight)


@jit_inner
def _left(space, tension, left):
    """Residual (d,) [N] of the balance; returns its norm."""
    pulls, weight = space[3], space[4]
    for k in range(left.shape[0]):
        left[k] = -weight[k]
        for i in range(tension.shape[0]):
            left[k] += pulls[i, k] * tension[i]
    return norm(left)


@jit_inner
def _beside(number, by, row, state, length, space, tension, left):
    """Residual (d,) after a step ``by`` [m] along one coordinate."""
    (cables, load, pose, screws, _), (place, values) = row, state
    step, trial, trial_values = space[6:9]
    step[:] = 0.0
    step[number] = by
    advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
    _balance(cables, load, pose, trial, length, space)
    _left(space, tension, left)


@jit_inner
def _is_firm(row, state, length, space, tension):
    """Whether the platform is stable there with plain elastic cables."""
    (cables, load, pose, screws, _), (place, values) = row, state
    left, other, hessian, factor = space[9:13]
    d, by = left.shape[0], _DIFFERENCE * length
    for k in range(d):
        _beside(k, by, row, state, length, space, tension, left)
        _beside(k, -by, row, state, length, space, tension, other)
        for j in range(d):
            hessian[k, j] = (left[j] - other[j]) / (2.0 * by)
    space[6][:] = 0.0
    advance(place, values, space[6], length, screws, pose, space[7], space[8], space[0])
    _balance(cables, load, pose, place, length, space)
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
def _step(turns, damping, scale, low, high, tension, left, space):
    """A damped step of the rotations and tensions within limits: fills ``move``, space[17]."""
    rates, normal, factor, right, move = space[13:18]
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
    while not cholesky(normal, damping, factor):
        damping *= 10.0
    solve_factored(factor, right, move)
    far = 0.0
    for a in range(turns):
        far += move[a] ** 2
    part = min(1.0, _LONGEST / max(math.sqrt(far), 1e-300))
    for a in range(n):
        move[a] *= part


@jit_inner
def _onto_hinges(move, hinges, length, step):
    """From rotations [rad] to a step (d,) of all coordinates [m]."""
    number = 0
    for k in range(step.shape[0]):
        step[k] = 0.0
        if hinges[k]:
            step[k] = move[number] * length
            number += 1


@jit_inner
def _rotate_all(row, state, length, scale, tension, space):
    """Fill the rates, space[13], of the residual by rotations and tensions [loads per one]."""
    hinges, left, other, rates = row[4], space[9], space[10], space[13]
    number, by = 0, _DIFFERENCE * length
    copy_rows(space[3], rates[rates.shape[0] - tension.shape[0] :])
    for k in range(left.shape[0]):
        if hinges[k]:
            _beside(k, by, row, state, length, space, tension, other)
            for j in range(left.shape[0]):
                rates[number, j] = (other[j] - left[j]) / by * length / scale
            number += 1


@jit_inner
def _solve(row, state, length, scale, low, high, tension, space):
    """Balance a platform from a state, in place; returns whether that succeeded."""
    (cables, load, pose, screws, hinges), (place, values) = row, state
    left, other, right, move, tried = space[9], space[10], space[16], space[17], space[18]
    m = tension.shape[0]
    turns = right.shape[0] - m
    damping, mark, idle = _FIRST, np.inf, 0
    step, trial, trial_values = space[6:9]
    step[:] = 0.0
    advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
    _balance(cables, load, pose, place, length, space)
    size = _left(space, tension, left) / scale
    for _ in range(_STEPS):
        if size <= _EXACT:
            return True
        _rotate_all(row, state, length, scale, tension, space)
        better = False
        while not better and damping <= _MOST:
            _step(turns, damping, scale, low, high, tension, left, space)
            _onto_hinges(move, hinges, length, step)
            for i in range(m):
                tried[i] = min(max(tension[i] + move[turns + i] * scale, low[i]), high[i])
            advance(place, values, step, length, screws, pose, trial, trial_values, space[0])
            _balance(cables, load, pose, trial, length, space)
            new = _left(space, tried, other) / scale
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
def _raise(row, state, other, length, scale, low, high, space):
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
        held = _solve(row, other, length, scale, narrow_low, narrow_high, pulls, space)
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
def make_turning_space(m, d, joints, turns):
    """Scratch arrays, made once per batch."""
    n = turns + m
    return (
        np.zeros((joints, N_CURRENT)), np.zeros((joints, 6)), np.empty(6), np.empty((m, d)),
        np.empty(d), np.empty(m), np.empty(d), np.empty(7), np.empty(d), np.empty(d), np.empty(d),
        np.empty((d, d)), np.empty((d, d)), np.empty((n, d)), np.empty((n, n)), np.empty((n, n)),
        np.empty(n), np.empty(n), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
    )  # fmt: skip


@jit_allocating
def turn_batch(
    cables, load, poses, screws, hinges, length, scale, low, high, starts, start_values, farther,
    best, best_values, margins,
):  # fmt: skip
    """Orientations that hold n platforms, from k starts each; better ones replace those known.

    Args:
        cables: (n, m, N_COLUMNS). load: (n, N_LOAD). poses: (n, 7). screws: (n, d or 0, 7).
        hinges: (d,) coordinates that are rotations. length: [m]. scale: (n,) [N].
        low, high: (n, m) [N] limits.
        starts: (n, k, 7) deviations. start_values: (n, k, d) joint values, hinges times length.
        farther: try all starts, and turn on to where tensions are farther inside; otherwise the
            first orientation that holds will do.
        best: (n, 7), best_values: (n, d), margins: (n,) [N] the best so far, updated; minus
            infinity where there is none.
    """
    m, d, turns = cables.shape[1], hinges.shape[0], 0
    for k in range(d):
        turns += hinges[k]
    space = make_turning_space(m, d, screws.shape[1], turns)
    state, other = (np.empty(7), np.zeros(d)), (np.empty(7), np.zeros(d))
    tension = space[21]
    for r in range(poses.shape[0]):
        row, least, most = (cables[r], load[r], poses[r], screws[r], hinges), low[r], high[r]
        for k in range(starts.shape[1]):
            copy_vector(starts[r, k], state[0])
            copy_vector(start_values[r, k], state[1])
            if screws.shape[1] > 0:
                place_joints(screws[r], state[1], length, poses[r], state[0], space[0])
            for i in range(m):
                tension[i] = min(max(scale[r] / m, least[i]), most[i])
            held = _solve(row, state, length, scale[r], least, most, tension, space)
            if not held or not _is_firm(row, state, length, space, tension):
                continue
            margin = _inside(least, most, tension)
            if farther and turns + m > d:
                margin = _raise(row, state, other, length, scale[r], least, most, space)
            if margin > margins[r]:
                margins[r] = margin
                copy_vector(state[0], best[r])
                copy_vector(state[1], best_values[r])
            if not farther:
                break


@jit_allocating
def straight_balance_batch(
    cables, load, poses, screws, rows, away, length, matrices, loads
):  # fmt: skip
    """The balance of platforms on straight cables at k displaced poses; fills the last two.

    Args:
        cables: (n, m, N_COLUMNS). load: (n, N_LOAD). poses: (n, 7). screws: (n, d or 0, 7).
        rows: (k,) which of these each displacement is for.
        away: (k, d) [m] displacements of a step's kind, rotations times the length.
        length: [m].
        matrices: (k, d, m), loads: (k, d) [N], torques over the length: matrix tau = load.
    """
    m, d = cables.shape[1], loads.shape[1]
    space, still, values = make_turning_space(m, d, screws.shape[1], 3), np.zeros(7), np.zeros(d)
    place, trial_values = space[7], space[8]
    still[3] = 1.0
    for r in range(rows.shape[0]):
        row = rows[r]
        advance(
            still, values, away[r], length, screws[row], poses[row], place, trial_values, space[0]
        )
        _balance(cables[row], load[row], poses[row], place, length, space)
        for k in range(d):
            loads[r, k] = space[4][k]
            for i in range(m):
                matrices[r, k, i] = space[3][i, k]
