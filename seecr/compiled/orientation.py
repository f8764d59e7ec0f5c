"""The balance of platforms on straight cables, and orientations in which cables hold one.

A straight cable's direction does not depend on its tension, so no cable law is needed here.
Functions share scratch arrays, those of make_turning_space.
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
    quaternion_product,
    rotated_less,
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
from seecr.compiled.joint_kinematics import (
    N_CURRENT,
    bring,
    joint_columns,
    make_placing_space,
    onto_joints_gradient,
    turning_basis,
)
from seecr.compiled.newton import advance


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
def balance_straight(cables, load, pose, place, length, space):
    """Fill the pulls (m, d), weight (d,), spans (m,) and arms (m + 1, 3), the last the weight's.

    The balance is pulls^T tau = weight.
    """
    current, columns, own, pulls, weight, spans = space[0:6]
    arms, per, m = space[23], 1.0 / length, cables.shape[0]
    px, py, pz = pose[0] + place[0], pose[1] + place[1], pose[2] + place[2]
    qw, qx, qy, qz = quaternion_product(
        place[3], place[4], place[5], place[6], pose[3], pose[4], pose[5], pose[6]
    )
    if current.shape[0] > 0:
        joint_columns(current, px, py, pz, per, columns)
    for i in range(m + 1):
        if i < m:
            a, b, c = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        else:
            a, b, c = load[CENTRE_OF_MASS], load[CENTRE_OF_MASS + 1], load[CENTRE_OF_MASS + 2]
        dx, dy, dz = rotated_less(qw, qx, qy, qz, a, b, c)
        a, b, c = a + dx, b + dy, c + dz
        arms[i, 0], arms[i, 1], arms[i, 2] = a, b, c
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
def left_of(space, tension, left):
    """Residual (d,) [N] of the balance; returns its norm."""
    pulls, weight = space[3], space[4]
    for k in range(left.shape[0]):
        left[k] = -weight[k]
        for i in range(tension.shape[0]):
            left[k] += pulls[i, k] * tension[i]
    return norm(left)


@jit_inner
def _turned_arm(axis, a, b, c):
    """Its velocity e x arm when it turns about a base axis e."""
    if axis == 0:
        return 0.0, -c, b
    return (c, 0.0, -a) if axis == 1 else (-b, a, 0.0)


@jit_inner
def _add_rate(part, per, a, b, c, da, db, dc, fx, fy, fz, vx, vy, vz, out):
    """Add a part of the rates (6,) of a force f at an arm, from the velocities of both."""
    out[0] += part * vx
    out[1] += part * vy
    out[2] += part * vz
    out[3] += part * per * (db * fz - dc * fy + b * vz - c * vy)
    out[4] += part * per * (dc * fx - da * fz + c * vx - a * vz)
    out[5] += part * per * (da * fy - db * fx + a * vy - b * vx)


@jit_inner
def rates_of_rotations(load, length, scale, tension, space):
    """The rates of a free platform by its rotations, at the state that the balance is of.

    The direction u of a cable of span s turns by (e x a - u (u . (e x a))) / s.
    """
    pulls, spans, rates, arms, m = space[3], space[5], space[13], space[23], tension.shape[0]
    per = 1.0 / length
    for axis in range(3):
        for k in range(6):
            rates[axis, k] = 0.0
        for i in range(m):
            a, b, c = arms[i, 0], arms[i, 1], arms[i, 2]
            da, db, dc = _turned_arm(axis, a, b, c)
            x, y, z = pulls[i, 0], pulls[i, 1], pulls[i, 2]
            along, one = x * da + y * db + z * dc, 1.0 / spans[i]
            vx, vy, vz = one * (da - along * x), one * (db - along * y), one * (dc - along * z)
            part = tension[i] / scale
            _add_rate(part, per, a, b, c, da, db, dc, x, y, z, vx, vy, vz, rates[axis])
        a, b, c = arms[m, 0], arms[m, 1], arms[m, 2]
        da, db, dc = _turned_arm(axis, a, b, c)
        x, y, z = load[FORCE_OF_WEIGHT], load[FORCE_OF_WEIGHT + 1], load[FORCE_OF_WEIGHT + 2]
        _add_rate(-1.0 / scale, per, a, b, c, da, db, dc, x, y, z, 0.0, 0.0, 0.0, rates[axis])


@jit_allocating
def make_turning_space(m, d, joints, turns):
    """Scratch arrays, made once per batch."""
    n = turns + m
    return (
        np.zeros((joints, N_CURRENT)), np.zeros((joints, 6)), np.empty(6), np.empty((m, d)),
        np.empty(d), np.empty(m), np.empty(d), np.empty(7), np.empty(d), np.empty(d), np.empty(d),
        np.empty((d, d)), np.empty((d, d)), np.empty((n, d)), np.empty((n, n)), np.empty((n, n)),
        np.empty(n), np.empty(n), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
        np.empty((m + 1, 3)),
    )  # fmt: skip


@jit_allocating
def straight_balance_batch(
    cables, load, poses, screws, rows, away, length, matrices, loads
):  # fmt: skip
    """The balance of platforms on straight cables at k displaced poses: matrix tau = load.

    ``rows`` (k,) says which of the n rows each displacement (k, d) [m] is for, rotations times the
    length. Fills matrices (k, d, m) and loads (k, d) [N], torques over the length. Cables and loads
    have n rows, or one where all are alike.
    """
    m, d = cables.shape[1], loads.shape[1]
    own_cables, own_load = cables.shape[0] > 1, load.shape[0] > 1
    joints, still, values = screws.shape[1], np.zeros(7), np.zeros(d)
    space = make_turning_space(m, d, joints, joints)  # nothing is turned
    place, trial_values = space[7], space[8]
    still[3] = 1.0
    for r in range(rows.shape[0]):
        row = rows[r]
        advance(
            still, values, away[r], length, screws[row], poses[row], place, trial_values, space[0]
        )
        cable, pushed = cables[row if own_cables else 0], load[row if own_load else 0]
        balance_straight(cable, pushed, poses[row], place, length, space)
        for k in range(d):
            loads[r, k] = space[4][k]
            for i in range(m):
                matrices[r, k, i] = space[3][i, k]


# Orientations in which cables hold a platform at a given position, one position at a time.
#
# With fewer cables than degrees of freedom, W(R) tau = -w is solved for the orientation R and the
# tensions together (Carricato and Merlet 2013), by the method of Levenberg and Marquardt with
# limits on the tensions: it also goes on where the linearised equations have no solution within
# the limits. The balance is that of straight cables, as above; a cable law is needed only for the
# stability. Derivatives are exact for free platforms, else by finite
# differences along the few rotations, in each of which the joints keep the platform's origin.

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
        turns: independent rotations about the origin. scale: (n,) [N]. low, high: (n, m) [N].
        starts: (n, k, 7) deviations. start_values: (n, k, d) joint values; on joints only their
            rotations count.
        farther: try all starts, and turn on to where tensions are farther inside; otherwise the
            first orientation that holds will do.
        best, best_values, margins: (n, 7), (n, d), (n,) [N] the best so far, updated; minus
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
