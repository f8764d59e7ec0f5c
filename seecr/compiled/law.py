"""The compiled law of one cable: where its end is, what it pulls with, how stiff it is.

A cable is a row of a table (:data:`COLUMNS`). It runs from its exit point A, over a swivelling
pulley of radius r where there is one, to its anchor point B. All that is elastic about it acts
in series:

    stretch = l0 (eps + creep) + winch_side/EA T_winch + compliance T,   T = T(eps)

so that a straight cable is a law in one unknown, its strain eps, and a cable with weight is an
elastic catenary (Irvine, Cable Structures, 1981, section 1.2) in two, the components of its
force. Everything is solved to rounding, with exact derivatives.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

COLUMNS = (
    "exit_x", "exit_y", "exit_z",  # A in the base frame [m]
    "anchor_x", "anchor_y", "anchor_z",  # B in the platform frame [m]
    "rest_length",  # paid-out rest length l0 from A on, wrap included [m]
    "gap",  # geometric length at the commanded pose less the rest length [m], kept exact
    "ea",  # E S [N]
    "quadratic", "cubic",  # T = EA (eps + quadratic eps^2 + cubic eps^3)
    "pulley_radius",  # [m]
    "compliance",  # of the exit point along the cable [m/N]
    "winch_side",  # length of elastic cable behind the exit point [m]
    "weight",  # per metre of cable [N/m]
    "creep", "creep_rate",  # creep strain = creep + creep_rate T
    "hysteresis", "hysteresis_stretch",  # Dahl: amplitude [N], stretch over which it turns [m]
    "stretch_before", "hysteresis_before",  # state the Dahl law starts from
    "friction",  # exponent of the capstan at the exit point
    "winch_tension_stuck",  # tension behind the exit point if the cable does not slip [N]
    "extra", "extra_slope",  # a user's law, linearised: T += extra + extra_slope eps
)  # fmt: skip
N_COLUMNS = len(COLUMNS)

(
    EXIT, _EY, _EZ, ANCHOR, _BY, _BZ, REST, GAP, EA, QUADRATIC, CUBIC, RADIUS, COMPLIANCE,
    WINCH_SIDE, WEIGHT, CREEP, CREEP_RATE, HYSTERESIS, HYSTERESIS_STRETCH, STRETCH_BEFORE,
    HYSTERESIS_BEFORE, FRICTION, STUCK, EXTRA, EXTRA_SLOPE,
) = range(N_COLUMNS)  # fmt: skip

# Columns of what a law returns beside force and stiffness (see cable_state).
TENSION, STRAIN, HYSTERESIS_NOW, WINCH_TENSION, ENERGY, SLACK = range(6)
N_STATE = 6

# A softening cable keeps this part of its stiffness.
LEAST = 0.01

_jit = njit(cache=True, nogil=True, error_model="numpy")


@_jit
def dahl(row, strain):
    """Hysteretic tension [N] and its slope at a strain, from the state before.

    Dahl's model in closed form for a monotone change of stretch (Dahl 1968, with exponent 1):
    z = s Z + (z0 - s Z) exp(-|d e| / e_c), s the sign of the change of the stretch e = l0 eps.
    """
    amplitude = row[HYSTERESIS]
    if amplitude == 0.0:
        return 0.0, 0.0
    change = strain * row[REST] - row[STRETCH_BEFORE]
    limit = amplitude if change >= 0.0 else -amplitude
    fade = math.exp(-abs(change) / row[HYSTERESIS_STRETCH])
    z = limit + (row[HYSTERESIS_BEFORE] - limit) * fade
    slope = abs(row[HYSTERESIS_BEFORE] - limit) * fade * row[REST] / row[HYSTERESIS_STRETCH]
    return z, slope


@_jit
def _polynomial(ea, q, c, strain):
    """Tension and slope of EA (eps + q eps^2 + c eps^3), kept from losing its stiffness.

    Where the slope would fall below a hundredth of EA it stays there, so that the tension is the
    integral of the slope: a softening cable still carries more when it is stretched further.
    """
    share = strain + q * strain**2 + c * strain**3
    low, high = np.inf, np.inf
    disc = q * q - 3.0 * c * (1.0 - LEAST)
    if disc > 0.0:
        # roots of 3 c e^2 + 2 q e + (1 - LEAST) = 0, in the form that does not cancel
        half = -(q + math.copysign(math.sqrt(disc), q))
        first, second = (1.0 - LEAST) / half, half / (3.0 * c) if c != 0.0 else np.inf
        first = first if first > 0.0 else np.inf
        second = second if second > 0.0 else np.inf
        low, high = min(first, second), max(first, second)
    if strain > low:
        top = min(strain, high)
        share += LEAST * (top - low)
        share -= (top - low) + q * (top**2 - low**2) + c * (top**3 - low**3)
    firm = strain <= low or strain >= high
    slope = 1.0 + 2.0 * q * strain + 3.0 * c * strain**2 if firm else LEAST
    return ea * share, ea * slope


@_jit
def tension_of_strain(row, strain):
    """Tension [N], its slope dT/d eps [N] and the hysteretic part of it, at strain >= 0."""
    ea = row[EA]
    z, z_slope = dahl(row, strain)
    q, c = row[QUADRATIC], row[CUBIC]
    tension = ea * strain
    slope = ea
    if q != 0.0 or c != 0.0:
        tension, slope = _polynomial(ea, q, c, strain)
    tension += z + row[EXTRA] + row[EXTRA_SLOPE] * strain
    slope += z_slope + row[EXTRA_SLOPE]
    return tension, slope, z


@_jit
def winch_tension(row, tension):
    """Tension behind the exit point [N] and its slope, for capstan friction (Euler-Eytelwein).

    The cable sticks on the exit point while the ratio of the tensions stays within
    exp(+-friction), and slips at that ratio otherwise.
    """
    if row[FRICTION] == 0.0:
        return tension, 1.0
    grip = math.exp(row[FRICTION])
    stuck = row[STUCK]
    if stuck > tension * grip:
        return tension * grip, grip
    if stuck < tension / grip:
        return tension / grip, 1.0 / grip
    return stuck, 0.0


@_jit
def is_linear(row):
    """Whether the straight law has a closed form."""
    return (
        row[QUADRATIC] == 0.0
        and row[CUBIC] == 0.0
        and row[HYSTERESIS] == 0.0
        and row[FRICTION] == 0.0
        and row[EXTRA] == 0.0
        and row[EXTRA_SLOPE] == 0.0
    )


@_jit
def series_length(row, strain):
    """Stretch [m] that goes with a strain, and its slope, tension and tension slope."""
    tension, slope, z = tension_of_strain(row, strain)
    if tension < 0.0:
        tension, slope = 0.0, 0.0
    behind, behind_slope = winch_tension(row, tension)
    soft = row[REST] * row[CREEP_RATE] + row[COMPLIANCE]
    length = row[REST] * (strain + row[CREEP]) + soft * tension
    length += row[WINCH_SIDE] / row[EA] * behind
    rate = row[REST] + (soft + row[WINCH_SIDE] / row[EA] * behind_slope) * slope
    return length, rate, tension, slope, z


@_jit
def straight_law(row, stretch, state):
    """Tension and dT/dL of a straight cable stretched by ``stretch`` [m]; fills ``state``.

    The rest of the robot sees a taut cable at zero stretch as taut: its stiffness is there
    for the first step of the solver, which starts from exactly that pose.
    """
    state[ENERGY] = 0.0
    soft = row[REST] + row[EA] * (row[REST] * row[CREEP_RATE] + row[COMPLIANCE])
    soft += row[WINCH_SIDE]
    elastic = stretch - row[REST] * row[CREEP]
    if is_linear(row):
        state[HYSTERESIS_NOW] = 0.0
        state[STRAIN] = elastic / soft
        if elastic < 0.0:
            state[TENSION], state[WINCH_TENSION], state[SLACK] = 0.0, 0.0, 1.0
            return 0.0, 0.0
        tension = row[EA] * (elastic / soft)
        state[TENSION], state[WINCH_TENSION] = tension, tension
        state[SLACK] = 0.0
        state[ENERGY] = 0.5 * tension * elastic
        return tension, row[EA] / soft
    state[ENERGY] = np.nan
    length, rate, tension, slope, z = series_length(row, 0.0)
    if stretch < length:
        state[TENSION], state[WINCH_TENSION], state[SLACK] = 0.0, 0.0, 1.0
        state[STRAIN], state[HYSTERESIS_NOW] = min(elastic / soft, 0.0), 0.0
        return 0.0, 0.0
    strain = _solve_strain(row, stretch, max(elastic / soft, 0.0))
    length, rate, tension, slope, z = series_length(row, strain)
    state[TENSION], state[STRAIN], state[HYSTERESIS_NOW] = tension, strain, z
    state[WINCH_TENSION] = winch_tension(row, tension)[0]
    state[SLACK] = 1.0 if tension <= 0.0 else 0.0
    return tension, slope / rate


@_jit
def _solve_strain(row, stretch, guess):
    """Strain at which the series has the given stretch: Newton kept inside a bracket."""
    low, high = 0.0, max(2.0 * guess, 1e-6)
    for _ in range(200):
        if series_length(row, high)[0] >= stretch:
            break
        low, high = high, 2.0 * high
    strain = min(max(guess, low), high)
    for _ in range(100):
        length, rate, _t, _s, _z = series_length(row, strain)
        error = length - stretch
        if error > 0.0:
            high = strain
        else:
            low = strain
        if abs(error) <= 2e-16 * (abs(stretch) + row[REST] * strain):
            break
        following = strain - error / rate
        if not (low < following < high):
            following = 0.5 * (low + high)
        if following == strain:
            break
        strain = following
    return strain


@_jit
def catenary_span(h, v, w, length, ea):
    """Span of an elastic catenary whose lower end is pulled by (h, v) towards the upper one.

    Returns horizontal and vertical span and their derivatives xh, xv, zv, xl, zl by h, v and
    unstretched length. Written so that nothing cancels as w goes to zero (Irvine 1981, 1.2).
    """
    top = v + w * length
    t_low, t_top = math.sqrt(h * h + v * v), math.sqrt(h * h + top * top)
    rise = length * (v + top) / (t_top + t_low)  # (t_top - t_low)/w
    # asinh(top/h) - asinh(v/h) as a logarithm, each form where its terms do not cancel
    # the first two hold for either sign of their end, and cancel only where it is steep
    if v >= -h:
        grow = math.log1p(w * (length + rise) / (v + t_low)) / w
    elif top <= h:
        grow = math.log1p(w * (length - rise) / (t_top - top)) / w
    else:
        grow = math.log((top + t_top) * (t_low - v) / (h * h)) / w
    turn = _change_of_sine(v, top, h, w, length)
    stretch = length / ea
    x = h * (grow + stretch)
    z = rise + 0.5 * (v + top) * stretch
    xh = grow - turn + stretch
    xv = -h * rise / (t_top * t_low)
    zv = turn + stretch
    xl = h / t_top + h / ea
    zl = top / t_top + top / ea
    return x, z, xh, xv, zv, xl, zl


@_jit
def _change_of_sine(v, top, h, w, length):
    """(top/T_top - v/T_low)/w, from (a T_b - b T_a) = h^2 (a^2 - b^2)/(a T_b + b T_a)."""
    t_low, t_top = math.sqrt(h * h + v * v), math.sqrt(h * h + top * top)
    if (v >= 0.0 and top > 0.0) or (v < 0.0 and top < 0.0):
        both = (top * t_low + v * t_top) * t_top * t_low
        return h * h * (top + v) * length / both
    return (top / t_top - v / t_low) / w


@_jit
def strain_of_tension(row, tension):
    """Strain at which the cable itself pulls with a tension: Newton kept inside a bracket.

    Returns strain, slope dT/d eps [N] and the hysteretic part of the tension.
    """
    strain = tension / row[EA]
    if is_linear(row):
        return strain, row[EA], 0.0
    low, high, reach = strain, strain, abs(strain) + 1e-6
    for _ in range(60):
        if tension_of_strain(row, low)[0] <= tension:
            break
        low -= reach
        reach *= 2.0
    for _ in range(60):
        if tension_of_strain(row, high)[0] >= tension:
            break
        high += reach
        reach *= 2.0
    for _ in range(100):
        t, slope, _z = tension_of_strain(row, strain)
        if t > tension:
            high = strain
        else:
            low = strain
        if abs(t - tension) <= 2e-16 * abs(tension):
            break
        following = strain - (t - tension) / slope
        if not (low < following < high):
            following = 0.5 * (low + high)
        if following == strain:
            break
        strain = following
    _t, slope, z = tension_of_strain(row, strain)
    return strain, slope, z


@_jit
def _other_stretch(row, tension):
    """Unstretched length [m] that all but the catenary's own T/EA would add, and its slope.

    At the tension of the upper end. A cable that stretches by it as the straight one does
    is one that is longer by stretch/(1 + T/EA) before the catenary stretches it again.
    """
    ea, rest = row[EA], row[REST]
    behind, behind_slope = winch_tension(row, tension)
    stretch = rest * (row[CREEP] + row[CREEP_RATE] * tension) + row[COMPLIANCE] * tension
    stretch += row[WINCH_SIDE] / ea * behind
    rate = rest * row[CREEP_RATE] + row[COMPLIANCE] + row[WINCH_SIDE] / ea * behind_slope
    strain, slope, _z = strain_of_tension(row, tension)
    stretch += rest * (strain - tension / ea)
    rate += rest * (1.0 / slope - 1.0 / ea)
    grown = 1.0 + tension / ea
    return stretch / grown, (rate - stretch / (grown * ea)) / grown


@_jit
def _catenary_equations(row, unknown, across, rise, error, jacobian):
    """Where the catenary over its pulley ends, against where it should, with derivatives.

    Unknowns: horizontal and vertical pull at the anchor, unstretched length of the free part.
    """
    h, v, length = unknown[0], unknown[1], unknown[2]
    w, ea, r = row[WEIGHT], row[EA], row[RADIUS]
    x, z, xh, xv, zv, xl, zl = catenary_span(h, v, w, length, ea)
    top = v + w * length
    t = math.sqrt(h * h + top * top)
    sine, cosine = h / t, top / t
    psi = math.atan2(h, top)
    psi_h, psi_v, psi_l = top / t**2, -h / t**2, -w * h / t**2
    t_h, t_v, t_l = sine, cosine, w * cosine
    other, other_rate = _other_stretch(row, t)
    arc, squeeze = r * (math.pi - psi), 1.0 / (1.0 + t / ea)
    error[0] = x + r + r * cosine - across
    error[1] = z - r * sine - rise
    error[2] = length - row[REST] - other + arc * squeeze
    by_t = -other_rate - arc * squeeze**2 / ea
    by_psi = -r * squeeze
    jacobian[0, 0], jacobian[0, 1] = xh - r * sine * psi_h, xv - r * sine * psi_v
    jacobian[0, 2] = xl - r * sine * psi_l
    jacobian[1, 0], jacobian[1, 1] = xv - r * cosine * psi_h, zv - r * cosine * psi_v
    jacobian[1, 2] = zl - r * cosine * psi_l
    jacobian[2, 0] = by_t * t_h + by_psi * psi_h
    jacobian[2, 1] = by_t * t_v + by_psi * psi_v
    jacobian[2, 2] = 1.0 + by_t * t_l + by_psi * psi_l
    return t


@_jit
def _first_guess(row, across, rise, unknown):
    """Jonkman's start for a catenary (NREL/CP-500-45891, 2009, eqs 2-46, 2-47)."""
    w = row[WEIGHT]
    length = row[REST] * (1.0 + row[CREEP])
    if row[RADIUS] > 0.0:
        whole, free, tx, tz = pulley_geometry(across, -rise, row[RADIUS])
        length = max(length - (whole - free), 0.1 * length)
        across, rise = free * tx, -free * tz
    chord2 = across * across + rise * rise
    if length * length <= chord2:
        # taut: pull along the chord with the elastic stretch, or the nearly taut catenary
        chord = math.sqrt(chord2)
        soft = length + row[WINCH_SIDE] + row[EA] * (row[COMPLIANCE] + row[REST] * row[CREEP_RATE])
        pull = row[EA] * (chord - length) / soft
        pull = max(pull, 0.5 * w * length / math.sqrt(24.0 * 0.05))
        unknown[0] = pull * across / chord
        if abs(unknown[0]) < 1e-9 * w * length:
            unknown[0] = 1e-9 * w * length
        unknown[1] = pull * rise / chord - 0.5 * w * length
    else:
        flat = max(abs(across), 1e-9 * length)
        lam = math.sqrt(max(3.0 * ((length * length - rise * rise) / (flat * flat) - 1.0), 0.04))
        unknown[0] = 0.5 * w * flat / lam * (1.0 if across >= 0.0 else -1.0)
        unknown[1] = 0.5 * w * (rise / math.tanh(lam) - length)
    unknown[2] = length


@_jit
def _solve3(a, b, out):
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


@_jit
def _size(error, length):
    return max(abs(error[0]), abs(error[1]), abs(error[2])) / length


@_jit
def solve_catenary(row, across, rise, unknown, error, jacobian, work):
    """Find the pull of a catenary with the given span; True when found to rounding.

    ``unknown`` is the start where its third entry is positive (a warm start), else a first
    guess is made. On return ``jacobian`` is that of the equations at the solution.
    """
    scale = row[REST]
    if not unknown[2] > 0.0:
        _first_guess(row, across, rise, unknown)
    trial = work[0]
    step = work[1]
    _catenary_equations(row, unknown, across, rise, error, jacobian)
    size = _size(error, scale)
    for _ in range(200):
        if size < 1e-15:
            return True
        _solve3(jacobian, error, step)
        damping = 1.0
        better = False
        for _ in range(40):
            for k in range(3):
                trial[k] = unknown[k] - damping * step[k]
            # without a pulley the pull is towards the exit point; the length is positive
            if row[RADIUS] == 0.0:
                trial[0] = max(trial[0], 0.1 * unknown[0])
            trial[2] = max(trial[2], 0.5 * unknown[2])
            _catenary_equations(row, trial, across, rise, error, jacobian)
            following = _size(error, scale)
            if following < size:
                better = True
                break
            damping *= 0.5
        if not better:
            _catenary_equations(row, unknown, across, rise, error, jacobian)
            return size < 1e-12
        unknown[0], unknown[1], unknown[2] = trial[0], trial[1], trial[2]
        size = following
    return size < 1e-12


@_jit
def pulley_geometry(across, rise, radius):
    """Length and leaving direction of a straight cable over its swivelling pulley.

    In the pulley's own vertical plane, seen from the exit point A: the anchor is ``across``
    [m] away horizontally and ``rise`` [m] above (negative: below). The cable enters at A from
    below, runs over the top, and leaves along the tangent at the angle psi, measured at the
    centre from the horizontal direction upwards (contracts: pulley).

    Returns:
        total length (arc and free part), free length, and the direction from the pulley to the
        anchor, (sin psi, -cos psi).
    """
    dx, dz = across - radius, rise
    distance = math.sqrt(dx * dx + dz * dz)
    free = math.sqrt(max(distance * distance - radius * radius, 0.0))
    # angle(d) + acos(r/D), from its sine and cosine
    psi = math.atan2(dz, dx) + math.atan2(free, radius)
    return free + radius * (math.pi - psi), free, math.sin(psi), -math.cos(psi)


@_jit
def geometric_length(row, anchor, up):
    """Length [m] from A over the pulley to the anchor (3,), for a straight cable."""
    dx, dy, dz = anchor[0] - row[0], anchor[1] - row[1], anchor[2] - row[2]
    if row[RADIUS] == 0.0:
        return math.sqrt(dx * dx + dy * dy + dz * dz)
    rise = dx * up[0] + dy * up[1] + dz * up[2]
    across = math.sqrt(max(dx * dx + dy * dy + dz * dz - rise * rise, 0.0))
    return pulley_geometry(across, rise, row[RADIUS])[0]


@_jit
def lengths_at(poses, anchors, exits, radii, up, out):
    """Straight lengths over the pulleys (n, m) [m] of cables at poses (n, 7)."""
    row, anchor = np.zeros(N_COLUMNS), np.empty(3)
    for i in range(exits.shape[0]):
        row[EXIT], row[EXIT + 1], row[EXIT + 2] = exits[i, 0], exits[i, 1], exits[i, 2]
        row[RADIUS] = radii[i]
        a, b, c = anchors[i, 0], anchors[i, 1], anchors[i, 2]
        for n in range(poses.shape[0]):
            w, x, y, z = poses[n, 3], poses[n, 4], poses[n, 5], poses[n, 6]
            # b + 2 q x (q x b + w b)
            tx, ty, tz = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
            anchor[0] = poses[n, 0] + a + 2.0 * (y * tz - z * ty)
            anchor[1] = poses[n, 1] + b + 2.0 * (z * tx - x * tz)
            anchor[2] = poses[n, 2] + c + 2.0 * (x * ty - y * tx)
            out[n, i] = geometric_length(row, anchor, up)


@_jit
def cable_pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    """Force of a cable on its anchor point, its stiffness, and the gradient of its tension.

    Args:
        row: the cable (N_COLUMNS,).
        start: (3,) [m] its anchor point at the commanded pose, base frame.
        move: (3,) [m] how far the anchor point has moved from there. Kept apart, since the
            stretch of a stiff cable is lost in the rounding of absolute coordinates.
        up: (3,) unit vector against gravity.
        guess: (3,) where the catenary starts and ends up.
        work: (8, 3) scratch.
        force: (3,) [N], filled.
        stiffness: (3, 3) [N/m], minus the derivative of the force by ``move``, filled.
        gradient: (3,) [N/m], derivative of the reported tension by ``move``, filled.
        state: (N_STATE,), filled.

    Returns:
        False when the cable's own equations could not be solved.
    """
    if row[WEIGHT] > 0.0:
        return _catenary_pull(row, start, move, up, guess, work, force, stiffness, gradient, state)
    if row[RADIUS] > 0.0:
        return _pulley_pull(row, start, move, up, work, force, stiffness, gradient, state)
    return _straight_pull(row, start, move, force, stiffness, gradient, state)


@_jit
def _straight_pull(row, start, move, force, stiffness, gradient, state):
    before2, growth, now2 = 0.0, 0.0, 0.0
    for k in range(3):
        d0 = start[k] - row[k]
        growth += move[k] * (2.0 * d0 + move[k])
        before2 += d0 * d0
        now2 += (d0 + move[k]) ** 2
    now = math.sqrt(now2)
    stretch = growth / (now + math.sqrt(before2)) + row[GAP]
    tension, rate = straight_law(row, stretch, state)
    for i in range(3):
        ui = (start[i] - row[i] + move[i]) / now
        force[i] = -tension * ui
        gradient[i] = rate * ui
        for j in range(3):
            uj = (start[j] - row[j] + move[j]) / now
            stiffness[i, j] = (rate - tension / now) * ui * uj
        stiffness[i, i] += tension / now
    return True


@_jit
def _plane(row, start, move, up, out):
    """Plane of a cable: out = horizontal direction (3,) away from A; returns across, rise."""
    rise = 0.0
    for k in range(3):
        out[k] = start[k] - row[k] + move[k]
        rise += out[k] * up[k]
    across = 0.0
    for k in range(3):
        out[k] -= rise * up[k]
        across += out[k] * out[k]
    across = math.sqrt(across)
    if across > 0.0:
        for k in range(3):
            out[k] /= across
        return across, rise
    # straight below the exit point every plane is as good: take one
    pick = 0 if abs(up[0]) < 0.9 else 1
    for k in range(3):
        out[k] = (1.0 if k == pick else 0.0) - up[pick] * up[k]
    return across, rise


@_jit
def _lift(row, across, rise, e, up, f, k2, g2, force, stiffness, gradient):
    """From the cable's plane to the base frame: f = force, k2 = stiffness, g2 = gradient."""
    # turning the plane about the vertical through A: stiffness -f_across/across, sideways
    side = -f[0] / max(across, 1e-9 * row[REST])
    for i in range(3):
        force[i] = f[0] * e[i] + f[1] * up[i]
        gradient[i] = g2[0] * e[i] + g2[1] * up[i]
        for j in range(3):
            sideways = -e[i] * e[j] - up[i] * up[j]
            if i == j:
                sideways += 1.0
            stiffness[i, j] = (
                k2[0] * e[i] * e[j]
                + k2[1] * (e[i] * up[j] + up[i] * e[j])
                + k2[2] * up[i] * up[j]
                + side * sideways
            )


@_jit
def _pulley_pull(row, start, move, up, work, force, stiffness, gradient, state):
    e, f, k2, g2 = work[0], work[1], work[2], work[3]
    across, rise = _plane(row, start, move, up, e)
    length, free, tx, tz = pulley_geometry(across, rise, row[RADIUS])
    tension, rate = straight_law(row, length - row[REST], state)
    f[0], f[1] = -tension * tx, -tension * tz
    g2[0], g2[1] = rate * tx, rate * tz
    # moving across the tangent turns it by 1/free
    turn = tension / max(free, 1e-9 * row[REST])
    k2[0] = rate * tx * tx + turn * tz * tz
    k2[1] = (rate - turn) * tx * tz
    k2[2] = rate * tz * tz + turn * tx * tx
    _lift(row, across, rise, e, up, f, k2, g2, force, stiffness, gradient)
    return True


@_jit
def _catenary_pull(row, start, move, up, guess, work, force, stiffness, gradient, state):
    e, f, k2, g2 = work[0], work[1], work[2], work[3]
    across, rise = _plane(row, start, move, up, e)
    flat = max(across, 1e-9 * row[REST])
    jacobian = work[4:7]
    error, scratch = work[7], work[8:10]
    if not solve_catenary(row, flat, -rise, guess, error, jacobian, scratch):
        guess[2] = 0.0  # once more from a first guess of its own
        if not solve_catenary(row, flat, -rise, guess, error, jacobian, scratch):
            return False
    h, v, length = guess[0], guess[1], guess[2]
    top = v + row[WEIGHT] * length
    tension = math.sqrt(h * h + top * top)
    f[0], f[1] = -h, v
    # columns of the inverse Jacobian: change of the unknowns by across and by -rise
    by_across, by_drop = work[10], work[11]
    error[0], error[1], error[2] = 1.0, 0.0, 0.0
    _solve3(jacobian, error, by_across)
    error[0], error[1] = 0.0, 1.0
    _solve3(jacobian, error, by_drop)
    k2[0] = by_across[0]
    k2[1] = 0.5 * (-by_drop[0] - by_across[1])
    k2[2] = by_drop[1]
    w = row[WEIGHT]
    for k in range(2):
        column = by_across if k == 0 else by_drop
        change = (h * column[0] + top * (column[1] + w * column[2])) / tension
        g2[k] = change if k == 0 else -change
    _lift(row, flat, rise, e, up, f, k2, g2, force, stiffness, gradient)
    state[TENSION], state[ENERGY] = tension, np.nan
    state[WINCH_TENSION] = winch_tension(row, tension)[0]
    stretch = geometric_length_plane(row, across, rise) - row[REST]
    state[STRAIN], _slope, state[HYSTERESIS_NOW] = strain_of_tension(row, tension)
    state[SLACK] = 1.0 if stretch < 0.0 else 0.0
    return True


@_jit
def geometric_length_plane(row, across, rise):
    """Straight length over the pulley from the plane's coordinates [m]."""
    if row[RADIUS] == 0.0:
        return math.sqrt(across * across + rise * rise)
    return pulley_geometry(across, rise, row[RADIUS])[0]
