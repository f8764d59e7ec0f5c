"""Newton descent of a platform to its equilibrium, one pose after the other."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    copy_rows,
    copy_vector,
    diagonalise,
    eliminate,
    first_positive,
    largest_diagonal,
    norm,
    solve_factored,
    turned,
)
from seecr.compiled.columns import (
    CABLE_LAW,
    CONVERGED,
    EA,
    EXTERNAL_MOMENT,
    FALLING,
    GAP,
    IDLE,
    ITERATIONS,
    PUSHES,
    RADIUS,
    REST,
    SINGULAR,
    SINGULAR_PART,
    SLACK,
    SPINNING,
    STALLED,
    TENSION,
    TOLERANCE,
    UNSTABLE,
)
from seecr.compiled.jit import jit, jit_allocating_inner, jit_inner, jit_pasted
from seecr.compiled.joint_kinematics import place_joints
from seecr.compiled.platform import add_skew, evaluate, has_moment, prepare

# The steps of a descent: Newton's, those away from saddles, and tests of a stationary point.


@jit
def residual_size(gradient):
    """The larger of force and torque over length [N]; for joints the norm of the gradient."""
    if gradient.shape[0] != 6:
        return norm(gradient)
    force = gradient[0] ** 2 + gradient[1] ** 2 + gradient[2] ** 2
    torque = gradient[3] ** 2 + gradient[4] ** 2 + gradient[5] ** 2
    return math.sqrt(max(force, torque))


@jit_inner
def advance(deviation, values, step, length, screws, pose, trial, trial_values, current):
    """The state after one step, and on joints these as they are then."""
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


@jit_inner
def newton_step(gradient, hessian, shift, radius, load, current, length, factor, step):
    """Solve (H + shift I) step = -gradient, with a shift that makes H positive definite.

    A moment whose work depends on the way makes the stiffness asymmetric; the step includes that,
    and still does positive work.
    """
    n = step.shape[0]
    if not cholesky(hessian, shift, factor):
        top = largest_diagonal(hessian)
        if top == 0.0:
            top = norm(gradient) / radius
        shift = max(4.0 * shift, 1e-6 * top + 1e-300)
        while not cholesky(hessian, shift, factor):
            shift *= 4.0
    if has_moment(load):
        copy_rows(hessian, factor)
        for k in range(n):
            factor[k, k] += shift
        add_skew(load, current, length, factor)
        eliminate(factor, gradient, step)
    else:
        solve_factored(factor, gradient, step)
    span = norm(step)
    scale = -1.0 if span <= radius else -radius / span
    for k in range(n):
        step[k] *= scale
    return shift


@jit_allocating_inner
def mirrored_step(gradient, hessian, radius, step):
    """Newton step with the absolute value of each eigenvalue: it leads away from saddles.

    If the gradient has no component along an unstable direction, the shift for that direction would
    only shorten the step in all others.
    """
    a, vectors, n, floor = hessian.copy(), np.empty_like(hessian), step.shape[0], 1e-300
    diagonalise(a, vectors)
    for k in range(n):
        step[k] = 0.0
        floor = max(floor, 1e-9 * abs(a[k, k]))
    for j in range(n):
        part = 0.0
        for k in range(n):
            part += vectors[k, j] * gradient[k]
        part /= max(abs(a[j, j]), floor)
        for k in range(n):
            step[k] -= part * vectors[k, j]
    span = norm(step)
    if span > radius:
        for k in range(n):
            step[k] *= radius / span


@jit_allocating_inner
def escape(hessian, top, radius, step):
    """Step along the softest direction; UNSTABLE if it is downhill, SINGULAR if it is flat."""
    a, vectors, softest = hessian.copy(), np.empty_like(hessian), 0
    diagonalise(a, vectors)
    for k in range(step.shape[0]):
        softest = k if a[k, k] < a[softest, softest] else softest
    for k in range(step.shape[0]):
        step[k] = vectors[k, softest]
    first_positive(step, 0.1 * radius)  # of two sides the same one on every machine
    return UNSTABLE if a[softest, softest] < -SINGULAR_PART * top else SINGULAR


@jit_inner
def is_idle(cables, states, i, scale):
    """Whether the tension of a cable is mere rounding: it is as long as its rest length."""
    taut = states[i, SLACK] == 0.0 and cables[i, PUSHES] == 0.0
    return taut and states[i, TENSION] < IDLE * scale


@jit_inner
def holds_without_idle(cables, load, pose, deviation, length, guess, states, scale, space):
    """Whether the equilibrium is stable without the cables whose tension is mere rounding.

    A cable that is exactly as long as its rest length has stiffness on one side only.
    """
    idle = False
    for i in range(cables.shape[0]):
        idle = idle or is_idle(cables, states, i, scale)
    if not idle:
        return True
    (_step, factor, _trial, _values, gradient, hessian, other_states, slopes, other_guess, current,
     work, ready, rest) = space  # fmt: skip
    copy_rows(cables, rest)
    copy_rows(guess, other_guess)
    for i in range(cables.shape[0]):
        if is_idle(cables, states, i, scale):
            rest[i, GAP] = -rest[i, REST]
            rest[i, RADIUS] = 0.0
    prepare(rest, load, pose, ready)
    evaluate(
        rest, ready, load, deviation, current, length, other_guess, gradient, hessian,
        other_states, slopes, work,
    )  # fmt: skip
    return cholesky(hessian, -SINGULAR_PART * largest_diagonal(hessian), factor)


@jit_pasted
def turns_about_moment(load, current, length, step):
    """Turns about the axis of the external moment that a step makes."""
    mx, my, mz = load[EXTERNAL_MOMENT], load[EXTERNAL_MOMENT + 1], load[EXTERNAL_MOMENT + 2]
    turn_by = 0.0
    if current.shape[0] == 0:
        turn_by = mx * step[3] + my * step[4] + mz * step[5]
    for j in range(current.shape[0]):
        if current[j, 0] == 1.0:
            along = mx * current[j, 1] + my * current[j, 2] + mz * current[j, 3]
            turn_by += along * step[j]
    return turn_by / (2.0 * math.pi * length * math.sqrt(mx * mx + my * my + mz * mz))


# The descent continues down to this part of the load while it gains digits.
FINE = 1e-13
# The search for more digits ends after this many steps within the tolerance.
LATE = 8
# After so many steps that a shift has shortened to this part of the trust region, each
# eigenvector's step uses its own stiffness.
PATIENCE, SHORT = 4, 0.1
# After so many turns by an external moment, no equilibrium is expected.
MOST_TURNS = 3.0
# Cables stiffer than this many loads are stiffened in stages by this factor (solve_in_stages).
STIFF, STAGE = 2000.0, 10.0


@jit_pasted
def solve_one(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, enough, space,
):  # fmt: skip
    """Descend from a start to the equilibrium that it leads to.

    This is a Newton method on the potential energy: the exact stiffness is shifted until it is
    positive definite, and steps are kept within a trust region and accepted if the energy falls. If
    there is no energy in closed form (friction, hysteresis, users' laws, weight over pulleys,
    moments), the work along the step, by the trapezium rule, takes its place. From a stationary
    point that is not a minimum the descent continues along the softest direction.

    Residuals are measured against the load ``scale`` [N]; ``radius`` is the first trust region, and
    deviations that are larger than the start's by more than ``reach`` count as falling [m];
    ``limit`` is most evaluations, ``enough`` the residual/scale at which to stop. Returns outcome,
    evaluations and residual/scale.
    """
    (step, factor, trial, trial_values, trial_gradient, trial_hessian, trial_states, trial_slopes,
     trial_guess, current, work, ready, _rest) = space  # fmt: skip
    n = gradient.shape[0]
    largest = 20.0 * radius
    # cables pull a platform back from wherever it starts
    reach += math.sqrt(start[0] ** 2 + start[1] ** 2 + start[2] ** 2)
    prepare(cables, load, pose, ready)
    copy_vector(start, trial)
    copy_vector(start_values, trial_values)
    copy_vector(start_values, values)
    if screws.shape[0] > 0:
        place_joints(screws, values, length, pose, trial, current)
    count, escapes, idle, late, short, shift, span = 0, 0, 0, 0, 0, 0.0, 0.0
    energy, size, forced = 0.0, np.inf, True
    pushed, turns = has_moment(load), 0.0
    while True:
        copy_rows(guess, trial_guess)
        trial_energy = evaluate(
            cables, ready, load, trial, current, length, trial_guess,
            trial_gradient, trial_hessian, trial_states, trial_slopes, work,
        )  # fmt: skip
        count += 1
        trial_size = residual_size(trial_gradient)
        broken = trial_energy == np.inf or not math.isfinite(trial_size)
        if count == 1 and broken:
            copy_vector(trial, deviation)
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
                turns += turns_about_moment(load, current, length, step)
                if turns > MOST_TURNS:
                    return SPINNING, count, size / scale
            copy_vector(trial, deviation)
            copy_vector(trial_values, values)
            copy_vector(trial_gradient, gradient)
            copy_rows(trial_guess, guess)
            copy_rows(trial_hessian, hessian)
            copy_rows(trial_states, states)
            copy_rows(trial_slopes, slopes)
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
                firm = holds_without_idle(
                    cables, load, pose, deviation, length, guess, states, scale, space
                )  # fmt: skip
                return CONVERGED if firm else SINGULAR, count, size / scale
            kind = escape(hessian, top, radius, step)
            if kind == SINGULAR or escapes >= 4:
                return kind, count, size / scale
            escapes += 1
            idle, late, forced = 0, 0, True
        else:
            shift = newton_step(
                gradient, hessian, shift, radius, load, current, length, factor, step
            )
            short = short + 1 if shift > 0.0 and norm(step) < SHORT * radius else 0
            if short >= PATIENCE and not pushed:
                mirrored_step(gradient, hessian, radius, step)
        if count >= limit:
            return ITERATIONS, count, size / scale
        span = norm(step)
        advance(deviation, values, step, length, screws, pose, trial, trial_values, current)


@jit_pasted
def solve_in_stages(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, staged, fine, space, stages,
):  # fmt: skip
    """Like solve_one with ``fine`` enough, if ``staged`` from soft to stiff.

    The energy of a stiff robot is a narrow curved valley. So all cables are first softened by
    powers of STAGE, until the stiffest has at most STIFF loads, and then stiffened by STAGE in each
    stage. A stage starts from the equilibrium of the one before.
    """
    top = 0.0
    for i in range(cables.shape[0]):
        top = max(top, cables[i, EA])
    softened, before, values_before = stages
    factor, total, enough, last = 1.0, 0, 1e-3, False
    while staged and top * factor > STIFF * scale:
        factor /= STAGE
    while True:
        now = cables
        if factor < 0.99:
            copy_rows(cables, softened)
            for i in range(cables.shape[0]):
                softened[i, EA] *= factor
            now = softened
        else:
            enough, last = fine, True
        outcome, count, residual = solve_one(
            now, load, pose, screws, start, start_values, length, scale, radius, reach,
            limit, guess, gradient, hessian, states, slopes, deviation, values, enough, space,
        )  # fmt: skip
        total += count
        if last:
            return outcome, total, residual
        copy_vector(deviation, before)
        copy_vector(values, values_before)
        start, start_values = before, values_before
        factor *= STAGE
