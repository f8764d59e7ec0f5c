"""The compiled descent of a platform to where it rests (see forces.py for its coordinates)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from seecr.compiled.law import EA, GAP, N_STATE, RADIUS, REST, SLACK, TENSION
from seecr.compiled.platform import (
    CENTRE_OF_MASS,
    EXTERNAL_FORCE,
    EXTERNAL_MOMENT,
    FORCE_OF_WEIGHT,
    N_LOAD,
    N_READY,
    N_WORK,
    UP,
    add_skew,
    evaluate,
    has_moment,
    place_joints,
    prepare,
    rotate_less,
    turn,
    turned,
)

__all__ = [
    "CENTRE_OF_MASS", "EXTERNAL_FORCE", "EXTERNAL_MOMENT", "FORCE_OF_WEIGHT", "N_LOAD", "UP",
    "add_skew", "place_joints", "rotate_less", "turn",
]  # fmt: skip

# Outcomes of the descent; equilibrium.py turns them into sentences.
CONVERGED, UNSTABLE, SINGULAR, STALLED, FALLING, CABLE_LAW, ITERATIONS, SPINNING = range(8)

# A stiffness below this part of the largest diagonal entry is none.
SINGULAR_PART = 1e-11
# A tension below this part of the load is rounding.
IDLE = 1e-11
# An equilibrium leaves at most this part of the load; the descent goes on to FINE while it
# still gains digits.
TOLERANCE = 1e-9
FINE = 1e-13
# Rounding ends the search for more digits after this many steps within the tolerance.
LATE = 8
# After so many steps that a shift has made this short a part of the trust region, each
# direction steps by its own stiffness.
PATIENCE, SHORT = 4, 0.1
# A moment that has turned the platform so many times round will not find what holds it.
MOST_TURNS = 3.0
# Cables stiffer than this many loads are made stiff in stages (see solve_in_stages).
STIFF, STAGE = 2000.0, 10.0

_jit = njit(cache=True, nogil=True, error_model="numpy")


@_jit
def cholesky(a, shift, out):
    """Lower factor of a + shift I; False where that is not positive definite."""
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


@_jit
def _solve_factored(factor, b, out):
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


@_jit
def _eliminate(a, b, out):
    """Solve a general small system by elimination with row pivots; ``a`` is spent."""
    n = a.shape[0]
    _copy(b, out)
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


@_jit
def largest_diagonal(a):
    """Largest diagonal entry by size."""
    top = 0.0
    for k in range(a.shape[0]):
        top = max(top, abs(a[k, k]))
    return top


@_jit
def _norm(v):
    total = 0.0
    for k in range(v.shape[0]):
        total += v[k] * v[k]
    return math.sqrt(total)


@_jit
def residual_size(gradient):
    """Largest of force and (torque / length): the norms of the wrench's halves [N]."""
    if gradient.shape[0] != 6:
        return _norm(gradient)
    force = gradient[0] ** 2 + gradient[1] ** 2 + gradient[2] ** 2
    torque = gradient[3] ** 2 + gradient[4] ** 2 + gradient[5] ** 2
    return math.sqrt(max(force, torque))


@_jit
def _copy(values, out):
    for k in range(values.shape[0]):
        out[k] = values[k]


@_jit
def _copy_rows(values, out):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            out[i, k] = values[i, k]


@_jit
def _advance(deviation, values, step, length, screws, pose, trial, trial_values, current):
    """The state one step on."""
    if screws.shape[0] == 0:
        for k in range(3):
            trial[k] = deviation[k] + step[k]
        trial[3], trial[4], trial[5], trial[6] = turned(
            step[3] / length, step[4] / length, step[5] / length,
            deviation[3], deviation[4], deviation[5], deviation[6],
        )  # fmt: skip
        return
    for k in range(screws.shape[0]):
        trial_values[k] = values[k] + step[k]
    place_joints(screws, trial_values, length, pose, trial, current)


@_jit
def _newton_step(gradient, hessian, shift, radius, load, current, length, factor, step):
    """Solve (H + shift I) step = -gradient, shift the least that makes H definite.

    A moment skews the stiffness: the step takes that in, and still does positive work.
    """
    n = step.shape[0]
    if not cholesky(hessian, shift, factor):
        top = largest_diagonal(hessian)
        if top == 0.0:
            top = _norm(gradient) / radius
        shift = max(4.0 * shift, 1e-6 * top + 1e-300)
        while not cholesky(hessian, shift, factor):
            shift *= 4.0
    if has_moment(load):
        _copy_rows(hessian, factor)
        for k in range(n):
            factor[k, k] += shift
        add_skew(load, current, length, factor)
        _eliminate(factor, gradient, step)
    else:
        _solve_factored(factor, gradient, step)
    span = _norm(step)
    scale = -1.0 if span <= radius else -radius / span
    for k in range(n):
        step[k] *= scale
    return shift


@_jit
def _mirrored_step(gradient, hessian, radius, step):
    """Newton's step with every stiffness taken by size: from saddles away, elsewhere on.

    Where the force has no part along a direction that is unstable, the shift that this direction
    needs would only shorten the step in all others.
    """
    eigenvalues, vectors = np.linalg.eigh(hessian)
    n = step.shape[0]
    floor = 1e-9 * max(abs(eigenvalues[0]), abs(eigenvalues[n - 1])) + 1e-300
    for k in range(n):
        step[k] = 0.0
    for j in range(n):
        part = 0.0
        for k in range(n):
            part += vectors[k, j] * gradient[k]
        part /= max(abs(eigenvalues[j]), floor)
        for k in range(n):
            step[k] -= part * vectors[k, j]
    span = _norm(step)
    if span > radius:
        for k in range(n):
            step[k] *= radius / span


@_jit
def _escape(hessian, top, radius, step):
    """Softest direction, as a step; UNSTABLE where it is downhill, SINGULAR where it is flat."""
    eigenvalues, vectors = np.linalg.eigh(hessian)
    for k in range(step.shape[0]):
        step[k] = 0.1 * radius * vectors[k, 0]
    return UNSTABLE if eigenvalues[0] < -SINGULAR_PART * top else SINGULAR


@_jit
def is_idle(states, i, scale):
    """Whether the tension of a cable is mere rounding: it is as long as its rest length."""
    return states[i, SLACK] == 0.0 and states[i, TENSION] < IDLE * scale


@_jit
def _holds_without_idle(cables, load, pose, deviation, length, guess, states, scale, space):
    """Whether the equilibrium is stable without the cables whose tension is mere rounding.

    A cable that is exactly as long as its rest length resists on one side only.
    """
    idle = False
    for i in range(cables.shape[0]):
        idle = idle or is_idle(states, i, scale)
    if not idle:
        return True
    (_step, factor, _trial, _values, gradient, hessian, other_states, slopes, _guess, current,
     work, ready) = space  # fmt: skip
    rest = cables.copy()
    for i in range(cables.shape[0]):
        if is_idle(states, i, scale):
            rest[i, GAP] = -rest[i, REST]
            rest[i, RADIUS] = 0.0
    prepare(rest, load, pose, ready)
    evaluate(
        rest, ready, load, deviation, current, length, guess.copy(), gradient, hessian,
        other_states, slopes, work,
    )  # fmt: skip
    return cholesky(hessian, -SINGULAR_PART * largest_diagonal(hessian), factor)


@_jit
def _turns(load, current, length, step):
    """Full turns about the axis of the external moment that a step makes."""
    mx, my, mz = load[EXTERNAL_MOMENT], load[EXTERNAL_MOMENT + 1], load[EXTERNAL_MOMENT + 2]
    turn_by = 0.0
    if current.shape[0] == 0:
        turn_by = mx * step[3] + my * step[4] + mz * step[5]
    for j in range(current.shape[0]):
        if current[j, 0] == 1.0:
            along = mx * current[j, 1] + my * current[j, 2] + mz * current[j, 3]
            turn_by += along * step[j]
    return turn_by / (2.0 * math.pi * length * math.sqrt(mx * mx + my * my + mz * mz))


@_jit
def make_space(m, n, joints):
    """Scratch of a descent: made once for a batch."""
    return (
        np.zeros(n), np.zeros((n, n)), np.zeros(7), np.zeros(n), np.zeros(n), np.zeros((n, n)),
        np.zeros((m, N_STATE)), np.zeros((m, n)), np.zeros((m, 3)), np.zeros((joints, 7)),
        np.zeros((N_WORK, 6)), np.zeros((m + 1, N_READY)),
    )  # fmt: skip


@_jit
def solve_one(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, enough, space,
):  # fmt: skip
    """Descend from a start to the equilibrium it leads to.

    A Newton method on the energy: the exact stiffness, shifted until it is positive definite,
    steps kept within a trust region, taken where the energy falls. Where a law has no energy
    in closed form (weight, friction, hysteresis, moments), the work along the step, by the
    trapezium rule, stands for it. From a stationary point that is no minimum the descent goes
    on along the softest direction.

    Args:
        scale: load [N] that residuals are measured against.
        radius: first trust region [m].
        reach: deviations beyond this [m] count as falling.
        limit: most evaluations.
        enough: residual/scale at which to stop; FINE for all digits there are.
        space: from make_space.

    Returns:
        (outcome, evaluations, residual/scale)
    """
    (step, factor, trial, trial_values, trial_gradient, trial_hessian, trial_states, trial_slopes,
     trial_guess, current, work, ready) = space  # fmt: skip
    n = gradient.shape[0]
    largest = 20.0 * radius
    prepare(cables, load, pose, ready)
    _copy(start, trial)
    _copy(start_values, trial_values)
    _copy(start_values, values)
    if screws.shape[0] > 0:
        place_joints(screws, values, length, pose, trial, current)
    count, escapes, idle, late, short, shift, span = 0, 0, 0, 0, 0, 0.0, 0.0
    energy, size, forced = 0.0, np.inf, True
    pushed, turns = has_moment(load), 0.0
    while True:
        _copy_rows(guess, trial_guess)
        trial_energy = evaluate(
            cables, ready, load, trial, current, length, trial_guess,
            trial_gradient, trial_hessian, trial_states, trial_slopes, work,
        )  # fmt: skip
        count += 1
        trial_size = residual_size(trial_gradient)
        broken = trial_energy == np.inf or not math.isfinite(trial_size)
        if count == 1 and broken:
            _copy(trial, deviation)
            return CABLE_LAW, count, np.inf
        fell, expected = 0.0, 0.0
        if count > 1:
            for k in range(n):
                fell -= 0.5 * (gradient[k] + trial_gradient[k]) * step[k]
                expected -= 0.5 * gradient[k] * step[k]
            rounding = 1e-14 * (abs(energy) + scale * span)
            if math.isfinite(energy) and math.isfinite(trial_energy) and abs(fell) > rounding:
                fell = energy - trial_energy
        falls = fell > 1e-3 * expected
        if not falls and size < 1e-3 * scale:
            falls = trial_size < 0.9 * size
        if (falls or forced) and not broken:
            idle = idle + 1 if trial_size > 0.5 * size and size <= TOLERANCE * scale else 0
            energy, size = trial_energy, trial_size
            if pushed and count > 1:
                turns += _turns(load, current, length, step)
                if turns > MOST_TURNS:
                    return SPINNING, count, size / scale
            _copy(trial, deviation)
            _copy(trial_values, values)
            _copy(trial_gradient, gradient)
            _copy_rows(trial_guess, guess)
            _copy_rows(trial_hessian, hessian)
            _copy_rows(trial_states, states)
            _copy_rows(trial_slopes, slopes)
            shift *= 0.1
            if shift < 1e-9 * largest_diagonal(hessian):
                shift = 0.0
            if span > 0.8 * radius and fell > 0.7 * expected:
                radius = min(2.5 * radius, largest)
            if deviation[0] ** 2 + deviation[1] ** 2 + deviation[2] ** 2 > reach * reach:
                return FALLING, count, size / scale
        else:
            idle += 1 if size <= TOLERANCE * scale else 0
            radius = 0.3 * min(radius, span)
            if screws.shape[0] > 0:
                place_joints(screws, values, length, pose, trial, current)
            if radius < 1e-16 * length and size > TOLERANCE * scale:
                return STALLED, count, size / scale
        forced = False
        balanced = size <= TOLERANCE * scale
        late = late + 1 if balanced else 0
        if size <= enough * scale or (balanced and (idle >= 2 or late >= LATE)):
            top = largest_diagonal(hessian)
            if cholesky(hessian, -SINGULAR_PART * top, factor):
                firm = _holds_without_idle(
                    cables, load, pose, deviation, length, guess, states, scale, space
                )  # fmt: skip
                return CONVERGED if firm else SINGULAR, count, size / scale
            kind = _escape(hessian, top, radius, step)
            if kind == SINGULAR or escapes >= 4:
                return kind, count, size / scale
            escapes += 1
            idle, late, forced = 0, 0, True
        else:
            shift = _newton_step(
                gradient, hessian, shift, radius, load, current, length, factor, step
            )
            short = short + 1 if shift > 0.0 and _norm(step) < SHORT * radius else 0
            if short >= PATIENCE and not pushed:
                _mirrored_step(gradient, hessian, radius, step)
        if count >= limit:
            return ITERATIONS, count, size / scale
        span = _norm(step)
        _advance(deviation, values, step, length, screws, pose, trial, trial_values, current)


@_jit
def solve_in_stages(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, softened, staged, space,
):  # fmt: skip
    """Like solve_one, from soft to stiff: a stiff robot's energy is a narrow curved valley.

    Cables stiffer than STIFF loads start as soft as that and are made STAGE times stiffer
    until they are themselves; each stage starts from the equilibrium of the one before.
    """
    top = 0.0
    for i in range(cables.shape[0]):
        top = max(top, cables[i, EA])
    factor, total, enough = 1.0, 0, 1e-3
    while staged and top * factor > STIFF * scale:
        factor /= STAGE
    while True:
        now = cables
        if factor < 0.99:
            _copy_rows(cables, softened)
            for i in range(cables.shape[0]):
                softened[i, EA] *= factor
            now = softened
        else:
            enough = FINE
        outcome, count, residual = solve_one(
            now, load, pose, screws, start, start_values, length, scale, radius, reach,
            limit, guess, gradient, hessian, states, slopes, deviation, values, enough, space,
        )  # fmt: skip
        total += count
        if enough == FINE:
            return outcome, total, residual
        start, start_values = deviation.copy(), values.copy()
        factor *= STAGE


@_jit
def solve_batch(
    cables, load, poses, screws, starts, start_values, length, scale, radius, reach, limit,
    outcome, count, residual, gradient, hessian, states, slopes, deviation, values, guess, staged,
):  # fmt: skip
    """Independent poses, each from its own start; all outputs are filled."""
    softened = np.empty_like(cables[0])
    space = make_space(cables.shape[1], gradient.shape[1], screws.shape[1])
    for i in range(poses.shape[0]):
        outcome[i], count[i], residual[i] = solve_in_stages(
            cables[i], load[i], poses[i], screws[i], starts[i], start_values[i], length, scale[i],
            radius, reach[i], limit, guess[i], gradient[i], hessian[i], states[i], slopes[i],
            deviation[i], values[i], softened, staged, space,
        )  # fmt: skip


@_jit
def evaluate_batch(
    cables, load, poses, screws, deviation, values, length,
    gradient, hessian, states, slopes, energy, guess,
):  # fmt: skip
    """Wrench and stiffness at given deviations; all outputs are filled."""
    work = np.empty((N_WORK, 6))
    ready = np.zeros((cables.shape[1] + 1, N_READY))
    current = np.zeros((screws.shape[1], 7))
    for i in range(poses.shape[0]):
        prepare(cables[i], load[i], poses[i], ready)
        if screws.shape[1] > 0:
            place_joints(screws[i], values[i], length, poses[i], deviation[i], current)
        energy[i] = evaluate(
            cables[i], ready, load[i], deviation[i], current, length, guess[i],
            gradient[i], hessian[i], states[i], slopes[i], work,
        )  # fmt: skip
