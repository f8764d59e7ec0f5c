"""The steps of a descent: Newton's, those away from saddles, and tests of a stationary point."""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import (
    cholesky,
    copy_rows,
    eliminate,
    largest_diagonal,
    norm,
    solve_factored,
)
from seecr.compiled.columns import EXTERNAL_MOMENT, GAP, RADIUS, REST, SLACK, TENSION
from seecr.compiled.jit import jit, jit_allocating, jit_inner
from seecr.compiled.joints import place_joints
from seecr.compiled.outcomes import IDLE, SINGULAR, SINGULAR_PART, UNSTABLE
from seecr.compiled.platform import add_skew, evaluate, has_moment, prepare
from seecr.compiled.rotation import turned


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


@jit_allocating
def mirrored_step(gradient, hessian, radius, step):
    """Newton step with the absolute value of each eigenvalue: it leads away from saddles.

    If the gradient has no component along an unstable direction, the shift for that direction would
    only shorten the step in all others.
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
    span = norm(step)
    if span > radius:
        for k in range(n):
            step[k] *= radius / span


@jit_allocating
def escape(hessian, top, radius, step):
    """Step along the softest direction; UNSTABLE if it is downhill, SINGULAR if it is flat."""
    eigenvalues, vectors = np.linalg.eigh(hessian)
    for k in range(step.shape[0]):
        step[k] = 0.1 * radius * vectors[k, 0]
    return UNSTABLE if eigenvalues[0] < -SINGULAR_PART * top else SINGULAR


@jit_inner
def is_idle(states, i, scale):
    """Whether the tension of a cable is mere rounding: it is as long as its rest length."""
    return states[i, SLACK] == 0.0 and states[i, TENSION] < IDLE * scale


@jit_allocating
def holds_without_idle(cables, load, pose, deviation, length, guess, states, scale, space):
    """Whether the equilibrium is stable without the cables whose tension is mere rounding.

    A cable that is exactly as long as its rest length has stiffness on one side only.
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


@jit_inner
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
