"""The compiled inner loop: wrench, stiffness and energy of a platform, and the descent to rest.

A pose is kept as the deviation from its commanded pose: a displacement of the platform origin
[m] and a rotation from the left, as a quaternion whose small vector part keeps its digits.
Rotations enter the equations multiplied by the robot's length, so that all components of a
gradient are newtons and all steps are metres.

A free platform steps in (translation, rotation vector), both in the base frame. A platform on
slide and hinge joints steps in its joint values, times the length for hinges: the first joint
is the outermost, as in MJCF.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from seecr.cable_law import (
    ANCHOR,
    EA,
    ENERGY,
    GAP,
    N_STATE,
    RADIUS,
    REST,
    SLACK,
    TENSION,
    cable_pull,
)

# Entries of the load of a pose.
FORCE_OF_WEIGHT, CENTRE_OF_MASS, EXTERNAL_FORCE, EXTERNAL_MOMENT, UP = 0, 3, 6, 9, 12
N_LOAD = 15
# Rows of scratch that evaluate needs.
N_WORK = 28

# Outcomes of the descent; equilibrium.py turns them into sentences.
CONVERGED, UNSTABLE, SINGULAR, STALLED, FALLING, CABLE_LAW, ITERATIONS = range(7)

# A stiffness below this part of the largest diagonal entry is none.
SINGULAR_PART = 1e-11
# A tension below this part of the load is rounding.
IDLE = 1e-11
# An equilibrium leaves at most this part of the load; the descent goes on to FINE while it
# still gains digits.
TOLERANCE = 1e-9
FINE = 1e-13
# Cables stiffer than this many loads are made stiff in stages (see solve_in_stages).
STIFF, STAGE = 2000.0, 10.0

_jit = njit(cache=True, nogil=True, error_model="numpy")


@_jit
def rotate_less(q, v, out):
    """(R(q) - I) v for a unit quaternion: exact for small rotations."""
    cx = q[2] * v[2] - q[3] * v[1]
    cy = q[3] * v[0] - q[1] * v[2]
    cz = q[1] * v[1] - q[2] * v[0]
    out[0] = 2.0 * (q[0] * cx + q[2] * cz - q[3] * cy)
    out[1] = 2.0 * (q[0] * cy + q[3] * cx - q[1] * cz)
    out[2] = 2.0 * (q[0] * cz + q[1] * cy - q[2] * cx)


@_jit
def turn(rotvec, q, out):
    """out = exp(rotvec) q, of unit length."""
    angle = math.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    half = 0.5 * angle
    s = 0.5 if half < 1e-8 else math.sin(half) / angle
    w, x, y, z = math.cos(half), s * rotvec[0], s * rotvec[1], s * rotvec[2]
    a, b, c, d = q[0], q[1], q[2], q[3]
    out[0] = w * a - x * b - y * c - z * d
    out[1] = w * b + x * a + y * d - z * c
    out[2] = w * c - x * d + y * a + z * b
    out[3] = w * d + x * c - y * b + z * a
    norm = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for k in range(4):
        out[k] /= norm


@_jit
def place_joints(screws, values, length, origin, deviation, current):
    """Deviation (7,) of a jointed platform, and its joints as they stand there.

    The platform moves by E_1 E_2 ... E_n, E_j along or about joint j as it stands at the
    commanded pose (product of exponentials); ``screws`` and ``current`` are (n, 7): kind (0
    slide, 1 hinge), axis, point.
    """
    n = screws.shape[0]
    moved, step, shift = np.zeros(3), np.empty(3), np.empty(3)
    q, q_next = np.array([1.0, 0.0, 0.0, 0.0]), np.empty(4)
    identity, own = np.array([1.0, 0.0, 0.0, 0.0]), np.empty(4)
    for j in range(n):
        current[j, 0] = screws[j, 0]
        axis = screws[j, 1:4]
        rotate_less(q, axis, shift)
        for k in range(3):
            current[j, 1 + k] = axis[k] + shift[k]
            step[k] = screws[j, 4 + k] - origin[k]
        rotate_less(q, step, shift)
        for k in range(3):
            current[j, 4 + k] = screws[j, 4 + k] + shift[k] + moved[k]
        if screws[j, 0] == 0.0:
            for k in range(3):
                moved[k] += current[j, 1 + k] * values[j]
            continue
        for k in range(3):
            step[k] = axis[k] * (values[j] / length)
        turn(step, identity, own)
        for k in range(3):
            step[k] = origin[k] - screws[j, 4 + k]
        rotate_less(own, step, shift)
        rotate_less(q, shift, step)
        for k in range(3):
            moved[k] += shift[k] + step[k]
        quat_product(q, own, q_next)
        for k in range(4):
            q[k] = q_next[k]
    for k in range(3):
        deviation[k] = moved[k]
    for k in range(4):
        deviation[3 + k] = q[k]


@_jit
def quat_product(p, q, out):
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]


@_jit
def _free_columns(arm, length, columns):
    """Derivative (6, 3) of a platform point by translation and by scaled rotation vector."""
    for k in range(6):
        for c in range(3):
            columns[k, c] = 0.0
    for k in range(3):
        columns[k, k] = 1.0
    columns[3, 1], columns[3, 2] = -arm[2] / length, arm[1] / length
    columns[4, 0], columns[4, 2] = arm[2] / length, -arm[0] / length
    columns[5, 0], columns[5, 1] = -arm[1] / length, arm[0] / length


@_jit
def _joint_columns(point, current, length, columns):
    """Derivative (n, 3) of a platform point, given in the base frame, by the joints."""
    for j in range(current.shape[0]):
        ax, ay, az = current[j, 1], current[j, 2], current[j, 3]
        if current[j, 0] == 0.0:
            columns[j, 0], columns[j, 1], columns[j, 2] = ax, ay, az
            continue
        dx = point[0] - current[j, 4]
        dy = point[1] - current[j, 5]
        dz = point[2] - current[j, 6]
        columns[j, 0] = (ay * dz - az * dy) / length
        columns[j, 1] = (az * dx - ax * dz) / length
        columns[j, 2] = (ax * dy - ay * dx) / length


@_jit
def _add_bending(force, arm, columns, current, length, hessian):
    """Second order of a point's path: -force . d2x, the geometric part of the stiffness."""
    n = hessian.shape[0]
    if current.shape[0] == 0:
        dot = force[0] * arm[0] + force[1] * arm[1] + force[2] * arm[2]
        for i in range(3):
            for j in range(3):
                bend = 0.5 * (force[j] * arm[i] + force[i] * arm[j])
                if i == j:
                    bend -= dot
                hessian[3 + i, 3 + j] -= bend / (length * length)
        return
    for i in range(n):
        if current[i, 0] == 0.0:
            continue
        ax, ay, az = current[i, 1] / length, current[i, 2] / length, current[i, 3] / length
        for j in range(i, n):
            cx, cy, cz = columns[j, 0], columns[j, 1], columns[j, 2]
            bend = (
                force[0] * (ay * cz - az * cy)
                + force[1] * (az * cx - ax * cz)
                + force[2] * (ax * cy - ay * cx)
            )
            hessian[i, j] -= bend
            if i != j:
                hessian[j, i] -= bend


@_jit
def _add_force(force, columns, gradient):
    for k in range(gradient.shape[0]):
        gradient[k] -= (
            force[0] * columns[k, 0] + force[1] * columns[k, 1] + force[2] * columns[k, 2]
        )


@_jit
def _add_moment(moment, current, length, gradient):
    if current.shape[0] == 0:
        for k in range(3):
            gradient[3 + k] -= moment[k] / length
        return
    for j in range(current.shape[0]):
        if current[j, 0] == 1.0:
            for k in range(3):
                gradient[j] -= moment[k] * current[j, 1 + k] / length


@_jit
def _add_stiffness(stiffness, columns, hessian):
    """hessian += columns stiffness columns^T."""
    for a in range(hessian.shape[0]):
        p0 = p1 = p2 = 0.0
        for k in range(3):
            c = columns[a, k]
            p0 += stiffness[0, k] * c
            p1 += stiffness[1, k] * c
            p2 += stiffness[2, k] * c
        for b in range(a + 1):
            entry = p0 * columns[b, 0] + p1 * columns[b, 1] + p2 * columns[b, 2]
            hessian[a, b] += entry
            if a != b:
                hessian[b, a] += entry


@_jit
def _anchor(body, pose, deviation, start, arm, move):
    """Anchor point at the commanded pose, its arm now, and how far it has moved."""
    rotate_less(pose[3:7], body, move)
    for k in range(3):
        arm[k] = body[k] + move[k]
        start[k] = pose[k] + arm[k]
    rotate_less(deviation[3:7], arm, move)
    for k in range(3):
        arm[k] += move[k]
        move[k] += deviation[k]


@_jit
def _columns_at(start, arm, move, current, length, point, columns):
    if current.shape[0] == 0:
        _free_columns(arm, length, columns)
        return
    for k in range(3):
        point[k] = start[k] + move[k]
    _joint_columns(point, current, length, columns)


@_jit
def evaluate(
    cables, load, pose, deviation, current, length, guess, gradient, hessian, states, slopes, work
):
    """Gradient of the energy (minus the wrench) and stiffness at a deviation; returns energy.

    Args:
        cables: (m, N_COLUMNS).
        load: (N_LOAD,).
        pose: (7,) commanded pose.
        deviation: (7,) from it.
        current: (n, 7) joints as they stand, (0, 7) for a free platform.
        length: the robot's length [m].
        guess: (m, 3) warm start of the catenaries.
        gradient: (d,) [N], filled.
        hessian: (d, d) [N/m], filled.
        states: (m, N_STATE), filled.
        slopes: (m, d) [N/m], derivative of the tensions, filled.
        work: (N_WORK, 3) scratch.

    Returns:
        energy [J]; nan where a law has none in closed form; inf where a cable's own
        equations could not be solved.
    """
    n = gradient.shape[0]
    gradient[:] = 0.0
    hessian[:] = 0.0
    force, slope, start, arm, move, point = work[12], work[13], work[14], work[15], work[16], work[17]
    stiffness, columns, body = work[18:21], work[21:27], work[27]
    energy = 0.0
    up = load[UP : UP + 3]
    for i in range(cables.shape[0]):
        _anchor(cables[i, ANCHOR : ANCHOR + 3], pose, deviation, start, arm, move)
        if not cable_pull(
            cables[i], start, move, up, guess[i], work, force, stiffness, slope, states[i]
        ):
            return np.inf
        energy += states[i, ENERGY]
        if states[i, SLACK] == 1.0 and states[i, TENSION] == 0.0:
            slopes[i] = 0.0
            continue
        _columns_at(start, arm, move, current, length, point, columns)
        for a in range(n):
            slopes[i, a] = (
                slope[0] * columns[a, 0] + slope[1] * columns[a, 1] + slope[2] * columns[a, 2]
            )
        _add_force(force, columns, gradient)
        _add_stiffness(stiffness, columns, hessian)
        _add_bending(force, arm, columns, current, length, hessian)
    # the weight acts at the centre of mass, the external force at the platform origin
    for which in range(2):
        if which == 0:
            body[:] = load[CENTRE_OF_MASS : CENTRE_OF_MASS + 3]
            dead = load[FORCE_OF_WEIGHT : FORCE_OF_WEIGHT + 3]
        else:
            body[:] = 0.0
            dead = load[EXTERNAL_FORCE : EXTERNAL_FORCE + 3]
        _anchor(body, pose, deviation, start, arm, move)
        _columns_at(start, arm, move, current, length, point, columns)
        _add_force(dead, columns, gradient)
        _add_bending(dead, arm, columns, current, length, hessian)
        energy -= dead[0] * move[0] + dead[1] * move[1] + dead[2] * move[2]
    moment = load[EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3]
    if moment[0] != 0.0 or moment[1] != 0.0 or moment[2] != 0.0:
        _add_moment(moment, current, length, gradient)
        energy = np.nan  # a constant moment has no potential in three dimensions
    return energy


@_jit
def cholesky(a, shift, out):
    """Lower factor of a + shift I; False where that is not positive definite."""
    n = a.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            if i == j:
                total += shift
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                out[i, i] = math.sqrt(total)
            else:
                out[i, j] = total / out[j, j]
    return True


@_jit
def _solve_factored(factor, b, out):
    n = factor.shape[0]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for back in range(n):
        i = n - 1 - back
        total = out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]


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
    if gradient.shape[0] == 6:
        return max(_norm(gradient[:3]), _norm(gradient[3:]))
    return _norm(gradient)


@_jit
def _advance(deviation, values, step, length, screws, pose, trial, trial_values, current):
    """The state one step on."""
    if screws.shape[0] == 0:
        for k in range(3):
            trial[k] = deviation[k] + step[k]
        turn(step[3:] / length, deviation[3:], trial[3:])
        return
    for k in range(screws.shape[0]):
        trial_values[k] = values[k] + step[k]
    place_joints(screws, trial_values, length, pose[:3], trial, current)


@_jit
def _newton_step(gradient, hessian, shift, radius, factor, step):
    """Solve (H + shift I) step = -gradient, shift the least that makes H definite."""
    n = step.shape[0]
    top = largest_diagonal(hessian)
    if top == 0.0:
        top = _norm(gradient) / radius
    while not cholesky(hessian, shift, factor):
        shift = max(4.0 * shift, 1e-6 * top + 1e-300)
    _solve_factored(factor, gradient, step)
    span = _norm(step)
    scale = -1.0 if span <= radius else -radius / span
    for k in range(n):
        step[k] *= scale
    return shift


@_jit
def _escape(hessian, top, radius, step):
    """Softest direction, as a step; UNSTABLE where it is downhill, SINGULAR where it is flat."""
    eigenvalues, vectors = np.linalg.eigh(hessian)
    for k in range(step.shape[0]):
        step[k] = 0.1 * radius * vectors[k, 0]
    return UNSTABLE if eigenvalues[0] < -SINGULAR_PART * top else SINGULAR


@_jit
def _holds_without_idle(
    cables, load, pose, deviation, current, length, guess, states, scale, gradient, hessian,
    other_states, slopes, factor, work,
):  # fmt: skip
    """Whether the equilibrium is stable without the cables whose tension is mere rounding.

    A cable that is exactly as long as its rest length resists on one side only.
    """
    idle = False
    for i in range(cables.shape[0]):
        if states[i, SLACK] == 0.0 and states[i, TENSION] < IDLE * scale:
            idle = True
    if not idle:
        return True
    rest = cables.copy()
    for i in range(cables.shape[0]):
        if states[i, SLACK] == 0.0 and states[i, TENSION] < IDLE * scale:
            rest[i, GAP] = -rest[i, REST]
            rest[i, RADIUS] = 0.0
    evaluate(
        rest, load, pose, deviation, current, length, guess.copy(), gradient, hessian,
        other_states, slopes, work,
    )  # fmt: skip
    return cholesky(hessian, -SINGULAR_PART * largest_diagonal(hessian), factor)


@_jit
def solve_one(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, enough,
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

    Returns:
        (outcome, evaluations, residual/scale)
    """
    n = gradient.shape[0]
    step, factor = np.empty(n), np.zeros((n, n))
    trial, trial_values = np.empty(7), np.empty(n)
    trial_gradient, trial_hessian = np.empty(n), np.empty((n, n))
    trial_states, trial_slopes = np.empty_like(states), np.empty_like(slopes)
    trial_guess = np.empty_like(guess)
    current, work = np.empty_like(screws), np.empty((N_WORK, 3))
    largest = 20.0 * radius
    deviation[:] = start
    values[:] = start_values
    if screws.shape[0] > 0:
        place_joints(screws, values, length, pose[:3], deviation, current)
    energy = evaluate(
        cables, load, pose, deviation, current, length, guess, gradient, hessian, states, slopes,
        work,
    )  # fmt: skip
    count, escapes, idle, shift = 1, 0, 0, 0.0
    if not math.isfinite(residual_size(gradient)) or energy == np.inf:
        return CABLE_LAW, count, np.inf
    while count < limit:
        size = residual_size(gradient)
        forced = False
        if size <= enough * scale or (idle >= 2 and size <= TOLERANCE * scale):
            top = largest_diagonal(hessian)
            firm = cholesky(hessian, -SINGULAR_PART * top, factor)
            if firm and _holds_without_idle(
                cables, load, pose, deviation, current, length, guess, states, scale,
                trial_gradient, trial_hessian, trial_states, trial_slopes, factor, work,
            ):  # fmt: skip
                return CONVERGED, count, size / scale
            if firm:
                return SINGULAR, count, size / scale
            kind = _escape(hessian, top, radius, step)
            if kind == SINGULAR or escapes >= 4:
                return kind, count, size / scale
            escapes += 1
            idle = 0
            forced = True
        else:
            shift = _newton_step(gradient, hessian, shift, radius, factor, step)
        _advance(deviation, values, step, length, screws, pose, trial, trial_values, current)
        trial_guess[:] = guess
        trial_energy = evaluate(
            cables, load, pose, trial, current, length, trial_guess,
            trial_gradient, trial_hessian, trial_states, trial_slopes, work,
        )  # fmt: skip
        count += 1
        trial_size = residual_size(trial_gradient)
        fell, expected = 0.0, 0.0
        for k in range(n):
            fell -= 0.5 * (gradient[k] + trial_gradient[k]) * step[k]
            expected -= 0.5 * gradient[k] * step[k]
        span = _norm(step)
        rounding = 1e-14 * (abs(energy) + scale * span)
        if math.isfinite(energy) and math.isfinite(trial_energy) and abs(fell) > rounding:
            fell = energy - trial_energy
        falls = fell > 1e-3 * expected
        if not falls and size < 1e-3 * scale:
            falls = trial_size < 0.9 * size
        if trial_energy == np.inf or not math.isfinite(trial_size):
            falls, forced = False, False
        if falls or forced:
            idle = idle + 1 if trial_size > 0.5 * size and size <= TOLERANCE * scale else 0
            energy = trial_energy
            deviation[:] = trial
            values[:] = trial_values
            guess[:] = trial_guess
            gradient[:] = trial_gradient
            hessian[:] = trial_hessian
            states[:] = trial_states
            slopes[:] = trial_slopes
            shift *= 0.1
            if shift < 1e-9 * largest_diagonal(hessian):
                shift = 0.0
            if span > 0.8 * radius and fell > 0.7 * expected:
                radius = min(2.5 * radius, largest)
            if _norm(deviation[:3]) > reach:
                return FALLING, count, trial_size / scale
        else:
            idle += 1 if size <= TOLERANCE * scale else 0
            radius = 0.3 * min(radius, span)
            if radius < 1e-16 * length and size > TOLERANCE * scale:
                return STALLED, count, size / scale
    return ITERATIONS, count, residual_size(gradient) / scale


@_jit
def solve_in_stages(
    cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
    guess, gradient, hessian, states, slopes, deviation, values, softened, staged,
):  # fmt: skip
    """Like solve_one, from soft to stiff: a stiff robot's energy is a narrow curved valley.

    Cables stiffer than STIFF loads start as soft as that and are made STAGE times stiffer
    until they are themselves; each stage starts from the equilibrium of the one before.
    """
    top = 0.0
    for i in range(cables.shape[0]):
        top = max(top, cables[i, EA])
    factor, total = 1.0, 0
    while staged and top * factor > STIFF * scale:
        factor /= STAGE
    while factor < 0.99:
        softened[:] = cables
        for i in range(cables.shape[0]):
            softened[i, EA] *= factor
        _o, count, _r = solve_one(
            softened, load, pose, screws, start, start_values, length, scale, radius, reach,
            limit, guess, gradient, hessian, states, slopes, deviation, values, 1e-3,
        )  # fmt: skip
        total += count
        start, start_values = deviation.copy(), values.copy()
        factor *= STAGE
    outcome, count, residual = solve_one(
        cables, load, pose, screws, start, start_values, length, scale, radius, reach, limit,
        guess, gradient, hessian, states, slopes, deviation, values, FINE,
    )  # fmt: skip
    return outcome, total + count, residual


@_jit
def solve_batch(
    cables, load, poses, screws, starts, start_values, length, scale, radius, reach, limit,
    outcome, count, residual, gradient, hessian, states, slopes, deviation, values, guess, staged,
):  # fmt: skip
    """Independent poses, each from its own start; all outputs are filled."""
    softened = np.empty_like(cables[0])
    for i in range(poses.shape[0]):
        outcome[i], count[i], residual[i] = solve_in_stages(
            cables[i], load[i], poses[i], screws[i], starts[i], start_values[i], length, scale[i],
            radius, reach[i], limit, guess[i], gradient[i], hessian[i], states[i], slopes[i],
            deviation[i], values[i], softened, staged,
        )  # fmt: skip


@_jit
def evaluate_batch(
    cables, load, poses, screws, deviation, values, length,
    gradient, hessian, states, slopes, energy, guess,
):  # fmt: skip
    """Wrench and stiffness at given deviations; all outputs are filled."""
    work = np.empty((N_WORK, 3))
    for i in range(poses.shape[0]):
        current = np.empty_like(screws[i])
        if screws.shape[1] > 0:
            place_joints(screws[i], values[i], length, poses[i, :3], deviation[i], current)
        energy[i] = evaluate(
            cables[i], load[i], poses[i], deviation[i], current, length, guess[i],
            gradient[i], hessian[i], states[i], slopes[i], work,
        )  # fmt: skip
