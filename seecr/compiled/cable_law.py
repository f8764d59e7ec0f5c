"""The law of one cable along itself: its tension as a function of its stretch.

All elastic parts of a cable act in series:
    stretch = l0 (eps + creep) + winch_side/EA T_winch + compliance T,   T = T(eps)

so a straight cable has a law in one unknown, its strain eps, which is solved to rounding.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import next_within
from seecr.compiled.columns import (
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    CUBIC,
    EA,
    ENERGY,
    EXIT,
    EXTRA,
    EXTRA_SLOPE,
    FRICTION,
    HYSTERESIS,
    HYSTERESIS_BEFORE,
    HYSTERESIS_NOW,
    HYSTERESIS_STRETCH,
    N_COLUMNS,
    PULL,
    PUSHES,
    QUADRATIC,
    RADIUS,
    REST,
    SLACK,
    STRAIN,
    STRETCH_BEFORE,
    STUCK,
    TENSION,
    WINCH_SIDE,
    WINCH_TENSION,
)
from seecr.compiled.jit import jit, jit_allocating, jit_inner

# A softening cable keeps this part of its stiffness.
LEAST = 0.01
# Most steps for the strain of a law: every other one may only halve a bracket, down to rounding.
_MOST = 200


@jit
def dahl(row, strain):
    """Hysteretic tension [N] and its slope at a strain, from the previous state.

    Dahl's model in closed form for a monotonic change of stretch (Dahl 1968, with exponent 1):
    z = s Z + (z0 - s Z) exp(-|d e| / e_c), with s the sign of the change of the stretch e = l0 eps.
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


@jit_inner
def _polynomial(ea, q, c, strain):
    """Tension, slope and energy per metre [N] of EA (eps + q eps^2 + c eps^3), kept stiff.

    The slope is never less than a hundredth of EA, and the tension is its integral, so that a
    softening cable still carries more when it is stretched further. The energy is the integral of
    the tension.
    """
    low, high = _soft_part(q, c)
    share, work = _bare(q, c, min(strain, low))
    slope = 1.0 + 2.0 * q * strain + 3.0 * c * strain**2
    if strain > low:
        # not as the polynomial plus a correction: far out the two would cancel
        soft = min(strain, high) - low
        work += (share + 0.5 * LEAST * soft) * soft
        share += LEAST * soft
    if low < strain < high:
        slope = LEAST
    if strain > high:
        there, stored = _bare(q, c, high)
        bare, held = _bare(q, c, strain)
        work += held - stored + (share - there) * (strain - high)
        share += bare - there
    return ea * share, ea * slope, ea * work


@jit_inner
def _bare(q, c, strain):
    """The polynomial eps + q eps^2 + c eps^3 and its integral."""
    share = strain * (1.0 + strain * (q + c * strain))
    return share, strain**2 * (0.5 + strain * (q / 3.0 + 0.25 * c * strain))


@jit_inner
def _soft_part(q, c):
    """The interval in which the slope 1 + 2 q eps + 3 c eps^2 is less than a hundredth."""
    low, high = np.inf, np.inf
    disc = q * q - 3.0 * c * (1.0 - LEAST)
    if disc > 0.0:
        # roots of 3 c e^2 + 2 q e + (1 - LEAST) = 0, in the form that does not cancel
        half = -(q + math.copysign(math.sqrt(disc), q))
        first, second = (1.0 - LEAST) / half, half / (3.0 * c) if c != 0.0 else np.inf
        first = first if first > 0.0 else np.inf
        second = second if second > 0.0 else np.inf
        low, high = min(first, second), max(first, second)
    return low, high


@jit_inner
def stored_per_metre(row, strain):
    """Energy [N] per metre of cable at a strain; nan if its law has none.

    Hysteresis and friction dissipate energy, and of a user's law only the slope is known.
    """
    if not has_energy(row):
        return np.nan
    return _polynomial(row[EA], row[QUADRATIC], row[CUBIC], strain)[2]


@jit_inner
def has_energy(row):
    """Whether the energy of the law depends only on the current state, not on the path to it."""
    lost = row[HYSTERESIS] != 0.0 or row[FRICTION] != 0.0
    return not lost and row[EXTRA] == 0.0 and row[EXTRA_SLOPE] == 0.0


@jit_inner
def tension_of_strain(row, strain):
    """Tension [N], its slope dT/d eps [N] and its hysteretic part, at strain >= 0."""
    ea = row[EA]
    z, z_slope = dahl(row, strain)
    q, c = row[QUADRATIC], row[CUBIC]
    tension = ea * strain
    slope = ea
    if q != 0.0 or c != 0.0:
        tension, slope, _work = _polynomial(ea, q, c, strain)
    tension += z + row[EXTRA] + row[EXTRA_SLOPE] * strain
    slope += z_slope + row[EXTRA_SLOPE]
    return tension, slope, z


@jit
def winch_tension(row, tension):
    """Tension behind the exit point [N] and its slope, for capstan friction (Euler-Eytelwein).

    The cable sticks at the exit point while the ratio of the tensions is within exp(+-friction),
    and otherwise slips at that ratio.
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


@jit_inner
def is_linear(row):
    """Whether the straight law has a closed form."""
    return row[QUADRATIC] == 0.0 and row[CUBIC] == 0.0 and has_energy(row)


@jit_inner
def series_length(row, strain):
    """Stretch [m] at a strain, its slope, tension, slope of the tension, and hysteretic part."""
    tension, slope, z = tension_of_strain(row, strain)
    if tension < 0.0:
        tension, slope = 0.0, 0.0
    behind, behind_slope = winch_tension(row, tension)
    soft = row[REST] * row[CREEP_RATE] + row[COMPLIANCE]
    length = row[REST] * (strain + row[CREEP]) + soft * tension
    length += row[WINCH_SIDE] / row[EA] * behind
    rate = row[REST] + (soft + row[WINCH_SIDE] / row[EA] * behind_slope) * slope
    return length, rate, tension, slope, z


@jit_inner
def straight_law(row, stretch, state):
    """Tension and dT/dL of a straight cable stretched by ``stretch`` [m]; fills ``state``.

    A cable at exactly zero stretch counts as taut, so that it has its stiffness in the solver's
    first step, which starts at that pose.
    """
    state[ENERGY] = 0.0
    soft = row[REST] + row[EA] * (row[REST] * row[CREEP_RATE] + row[COMPLIANCE])
    soft += row[WINCH_SIDE]
    elastic = stretch - row[REST] * row[CREEP]
    if is_linear(row):
        state[HYSTERESIS_NOW] = 0.0
        state[STRAIN] = elastic / soft
        if elastic < 0.0 and row[PUSHES] == 0.0:
            state[TENSION], state[WINCH_TENSION], state[SLACK] = 0.0, 0.0, 1.0
            return 0.0, 0.0
        tension = row[PULL] + row[EA] * (elastic / soft)
        state[TENSION], state[WINCH_TENSION] = tension, tension
        state[SLACK] = 0.0
        state[ENERGY] = 0.5 * (tension + row[PULL]) * elastic
        return tension, row[EA] / soft
    length, rate, tension, slope, z = series_length(row, 0.0)
    if stretch < length:
        state[ENERGY] = 0.0 if has_energy(row) else np.nan
        state[TENSION], state[WINCH_TENSION], state[SLACK] = 0.0, 0.0, 1.0
        state[STRAIN], state[HYSTERESIS_NOW] = min(elastic / soft, 0.0), 0.0
        return 0.0, 0.0
    strain = _solve_strain(row, stretch, max(elastic / soft, 0.0))
    length, rate, tension, slope, z = series_length(row, strain)
    state[TENSION], state[STRAIN], state[HYSTERESIS_NOW] = tension, strain, z
    state[WINCH_TENSION] = winch_tension(row, tension)[0]
    state[SLACK] = 1.0 if tension <= 0.0 else 0.0
    yields = row[REST] * row[CREEP_RATE] + row[COMPLIANCE] + row[WINCH_SIDE] / row[EA]
    state[ENERGY] = row[REST] * stored_per_metre(row, strain) + 0.5 * yields * tension**2
    return tension, slope / rate


@jit_inner
def tension_of_stretch(row, stretch):
    """Tension [N] of a straight cable stretched by ``stretch`` [m], all its parts together."""
    strain = _solve_strain(row, stretch, max(stretch / row[REST] - row[CREEP], 0.0))
    return max(series_length(row, strain)[2], 0.0)


@jit_inner
def _solve_strain(row, stretch, guess):
    """Strain at which the series has the given stretch: Newton's method inside a bracket."""
    low, high = 0.0, max(2.0 * guess, 1e-6)
    for _ in range(200):
        if series_length(row, high)[0] >= stretch:
            break
        low, high = high, 2.0 * high
    strain, before = min(max(guess, low), high), np.inf
    for _ in range(_MOST):
        length, rate, _t, _s, _z = series_length(row, strain)
        error = length - stretch
        if error > 0.0:
            high = strain
        else:
            low = strain
        if abs(error) <= 2e-16 * (abs(stretch) + row[REST] * strain):
            break
        following = next_within(low, high, strain, strain - error / rate, before)
        if following in (low, high):
            break
        before, strain = abs(following - strain), following
    return strain


@jit_inner
def strain_of_tension(row, tension):
    """Strain at which the cable itself has a given tension: Newton's method inside a bracket.

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
    before = np.inf
    for _ in range(_MOST):
        t, slope, _z = tension_of_strain(row, strain)
        if t > tension:
            high = strain
        else:
            low = strain
        if abs(t - tension) <= 2e-16 * abs(tension):
            break
        following = next_within(low, high, strain, strain - (t - tension) / slope, before)
        if following in (low, high):
            break
        before, strain = abs(following - strain), following
    _t, slope, z = tension_of_strain(row, strain)
    return strain, slope, z


# Straight cables over swivelling pulleys: their length, and where they leave the pulley.


@jit
def pulley_geometry(across, rise, radius):
    """Total and free length of a cable over its swivelling pulley, and (sin psi, -cos psi).

    In the pulley's own vertical plane, seen from the exit point A, the anchor point is ``across``
    [m] away horizontally and ``rise`` [m] above. The cable enters at A from below, runs over the
    top, and leaves along the tangent at the angle psi, measured at the centre from the horizontal
    direction upwards, in the direction returned.
    """
    dx, dz = across - radius, rise
    distance = math.sqrt(dx * dx + dz * dz)
    free = math.sqrt(max(distance * distance - radius * radius, 0.0))
    # angle(d) + acos(r/D), from its sine and cosine
    psi = math.atan2(dz, dx) + math.atan2(free, radius)
    return free + radius * (math.pi - psi), free, math.sin(psi), -math.cos(psi)


@jit
def geometric_length(row, anchor, up):
    """Length [m] of a straight cable from A over the pulley to the anchor point (3,)."""
    dx, dy, dz = anchor[0] - row[0], anchor[1] - row[1], anchor[2] - row[2]
    if row[RADIUS] == 0.0:
        return math.sqrt(dx * dx + dy * dy + dz * dz)
    rise = dx * up[0] + dy * up[1] + dz * up[2]
    across = math.sqrt(max(dx * dx + dy * dy + dz * dz - rise * rise, 0.0))
    return pulley_geometry(across, rise, row[RADIUS])[0]


@jit_inner
def length_in_plane(row, across, rise):
    """Straight length over the pulley, from the plane's coordinates [m]."""
    if row[RADIUS] == 0.0:
        return math.sqrt(across * across + rise * rise)
    return pulley_geometry(across, rise, row[RADIUS])[0]


@jit_allocating
def lengths_at(poses, anchors, exits, radii, up, out):
    """Straight lengths (n, m) [m] of cables over the pulleys, at poses (n, 7)."""
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


# An exit point whose compliance upwards differs from that sideways, compiled.
#
# A frame moves its exit points by C p under the pull p = -force of a cable on its anchor point, C
# = c (I - z z^T) + c_up z z^T with the vertical z. The isotropic part, c p, is along the cable and
# lengthens it by c T (column COMPLIANCE, in series with all else). The remainder lifts the exit
# point by s = (c_up - c) z.p, one unknown per cable:
#
#     s - (c_up - c) z . p(move - s z) = 0,
#
# where p(move) is the pull of the cable from an exit point that is not lifted. The slope 1 + (c_up
# - c) z.K z is positive, since K, with c in series, is no stiffer than 1/c.


@jit_inner
def along(up, vector):
    """Component of a vector (3,) along the vertical."""
    return up[0] * vector[0] + up[1] * vector[1] + up[2] * vector[2]


@jit_inner
def lowered(move, lift, up, out):
    """``out`` = displacement of the anchor point as seen from the lifted exit point."""
    for k in range(3):
        out[k] = move[k] - lift * up[k]


@jit_inner
def lift_slope(more, up, stiffness):
    """Slope of the equation for the lift."""
    total = 0.0
    for i in range(3):
        total += up[i] * along(up, stiffness[i])
    return 1.0 + more * total


@jit_inner
def soften(more, up, stiffness, gradient, column):
    """Stiffness (3, 3) and gradient (3,) of a cable with its yielding exit point, in place.

    By Sherman and Morrison: K (I + e z z^T K)^-1 = K - e/(1 + e z.K z) (K z)(K z)^T.
    """
    share = more / lift_slope(more, up, stiffness)
    for i in range(3):
        column[i] = along(up, stiffness[i])
    slope = along(up, gradient)
    for i in range(3):
        gradient[i] -= share * slope * column[i]
        for j in range(3):
            stiffness[i, j] -= share * column[i] * column[j]
