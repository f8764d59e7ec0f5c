"""A cable with weight: an elastic catenary (Irvine, Cable Structures, 1981, section 1.2).

Its unknowns are the two components of its pull and the length of its free part. They are solved to
rounding, with exact derivatives.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.algebra import solve_3x3
from seecr.compiled.cable_law import (
    has_energy,
    is_linear,
    pulley_geometry,
    stored_per_metre,
    strain_of_tension,
    tension_of_stretch,
    winch_tension,
)
from seecr.compiled.columns import (
    COMPLIANCE,
    CREEP,
    CREEP_RATE,
    EA,
    RADIUS,
    REST,
    WEIGHT,
    WINCH_SIDE,
)
from seecr.compiled.jit import jit, jit_inner, jit_merged


@jit
def catenary_span(h, v, w, length, ea):
    """Span of an elastic catenary whose lower end is pulled by (h, v) towards the upper one.

    Returns horizontal and vertical span and their derivatives xh, xv, zv, xl, zl by h, v and
    unstretched length. The form is such that nothing cancels as w goes to zero (Irvine 1981, 1.2).
    """
    top = v + w * length
    t_low, t_top = math.sqrt(h * h + v * v), math.sqrt(h * h + top * top)
    rise = length * (v + top) / (t_top + t_low)  # (t_top - t_low)/w
    grow = _change_of_angle(v, h, w, length)
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


@jit_inner
def _change_of_angle(v, h, w, length):
    """(asinh(top/h) - asinh(v/h))/w as a logarithm, in the form whose terms do not cancel."""
    top = v + w * length
    t_low, t_top = math.sqrt(h * h + v * v), math.sqrt(h * h + top * top)
    rise = length * (v + top) / (t_top + t_low)
    # the first two forms hold for either sign of their end, and only cancel where it is steep
    if v >= -h:
        return math.log1p(w * (length + rise) / (v + t_low)) / w
    if top <= h:
        return math.log1p(w * (length - rise) / (t_top - top)) / w
    return math.log((top + t_top) * (t_low - v) / (h * h)) / w


@jit_inner
def _change_of_sine(v, top, h, w, length):
    """(top/T_top - v/T_low)/w, from (a T_b - b T_a) = h^2 (a^2 - b^2)/(a T_b + b T_a)."""
    t_low, t_top = math.sqrt(h * h + v * v), math.sqrt(h * h + top * top)
    if (v >= 0.0 and top > 0.0) or (v < 0.0 and top < 0.0):
        both = (top * t_low + v * t_top) * t_top * t_low
        return h * h * (top + v) * length / both
    return (top / t_top - v / t_low) / w


@jit_inner
def _sag_energy(h, v, w, length):
    """Energy [J] that sag releases, h^2 (sinh D - D)/(2 w) with D = asinh(top/h) - asinh(v/h).

    It is the trapezium rule's error in the integral of the tension, T'' = w^2 h^2/T^3.
    """
    grow = _change_of_angle(v, h, w, length)
    turned = w * grow
    if turned > 1.0:
        top = v + w * length
        both = math.sqrt(h * h + v * v) * math.sqrt(h * h + top * top)
        return 0.5 * (_change_of_sine(v, top, h, w, length) * both - h * h * grow)
    # series of (sinh D - D)/(D^3/6), starting with its smallest term
    square, share = turned * turned, 1.0
    for k in (17, 15, 13, 11, 9, 7, 5):
        share = 1.0 + share * square / (k * (k - 1))
    return h * h * grow * square * share / 12.0


@jit_inner
def catenary_energy(row, unknown, fall, raised):
    """Potential energy [J] of a hanging cable; the force is minus its gradient by the anchor point.

    It is the elastic energy, E = int T^2/(2 EA) ds, and the weight's, both in the complementary
    form E = h x + v z - int (T + T^2/(2 EA)) ds (our own derivation), which is stationary in h and
    v where x and z are the catenary's spans; large terms are cancelled by hand. Everything else in
    series with the tension T at the exit point is added: each metre paid out by it contributes T +
    T^2/(2 EA).

    It is nan for a law without one, and over a pulley, where the pull has no potential: cable that
    reaches the free span brings its height along, w r sin psi per metre. For cable paid out by the
    wheel's rotation, d(psi), that is the work of an unstretched cable's weight on the wheel. But
    the stretch S(T, psi) of arc and series is that of a weightless cable, so that on a closed path
    the pull does the work w r int sin psi dS.

    Args:
        row, unknown: the cable, and its pull (h, v) [N] and unstretched length [m], solved.
        fall: [m] height of the exit point above the anchor point.
        raised: [m] height of the anchor point above that at the commanded pose, where a cable that
            hangs straight has no energy of its weight.
    """
    if row[RADIUS] > 0.0 or not has_energy(row):
        return np.nan
    h, v, length = unknown[0], unknown[1], unknown[2]
    w, ea, rest = row[WEIGHT], row[EA], row[REST]
    hanging = w * length
    middle, top = v + 0.5 * hanging, v + hanging
    stored = 0.5 * length / ea * (h * h + middle * middle - hanging * hanging / 12.0)
    stored += 0.5 * w * ((rest - length) * fall + rest * raised) - _sag_energy(h, v, w, length)
    pulled = h * h + top * top
    tension = math.sqrt(pulled)
    soft = rest * row[CREEP_RATE] + row[COMPLIANCE] + (row[WINCH_SIDE] - rest * row[CREEP]) / ea
    if not is_linear(row):
        # the curve's own stretch, rest (eps - T/EA), is one more element in series
        strain = strain_of_tension(row, tension)[0]
        soft -= rest * (strain - tension / ea) / ea
        stored += rest * (stored_per_metre(row, strain) - 0.5 * pulled / ea)
    return stored + 0.5 * soft * pulled / (1.0 + tension / ea)


@jit_merged
def _other_stretch(row, tension):
    """Unstretched length [m] equivalent to all stretch but the catenary's own T/EA, and its slope.

    It is taken at the upper end: a cable with this additional stretch is equivalent to one that is
    longer by stretch/(1 + T/EA) before the catenary stretches it again.
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


@jit_merged
def _catenary_equations(row, unknown, across, rise, error, jacobian):
    """Errors of the ends of a catenary over its pulley, with derivatives.

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


@jit_inner
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
        # taut: the pull along the chord by elastic stretch, or that of a nearly taut catenary
        chord = math.sqrt(chord2)
        soft = length + row[WINCH_SIDE] + row[EA] * (row[COMPLIANCE] + row[REST] * row[CREEP_RATE])
        pull = row[EA] * (chord - length) / soft
        if not is_linear(row):
            pull = tension_of_stretch(row, chord - length + row[REST] * row[CREEP])
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


@jit_inner
def _size(error, length):
    return max(abs(error[0]), abs(error[1]), abs(error[2])) / length


@jit_inner
def solve_catenary(row, across, rise, most, unknown, error, jacobian, work):
    """Find the pull of a catenary with the given span in so many steps; True if to rounding.

    ``unknown`` is a warm start if its third entry is positive; otherwise a first guess is made. On
    return ``jacobian`` is that of the equations at the solution.
    """
    scale = row[REST]
    if not unknown[2] > 0.0:
        _first_guess(row, across, rise, unknown)
    trial = work[0]
    step = work[1]
    _catenary_equations(row, unknown, across, rise, error, jacobian)
    size = _size(error, scale)
    for _ in range(most):
        if size < 1e-15:
            return True
        solve_3x3(jacobian, error, step)
        damping = 1.0
        better = False
        for _ in range(40):
            for k in range(3):
                trial[k] = unknown[k] - damping * step[k]
            # without a pulley the pull is towards the exit point; and the length is positive
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


# A catenary found by bracketing: slower than Newton's method, but it cannot fail to converge.
#
# For a cable that hangs nearly straight down and is barely slack, Newton's method on the whole
# system advances very slowly along a curved valley. One unknown at a time is safe: at a given
# horizontal pull h the vertical span grows with the vertical pull v, and with v solved for, the
# horizontal span grows with h (the complementary energy of a cable is convex). So both roots can
# be bracketed.

# Most steps to shrink a bracket to rounding, and most widenings of one.
_STEPS, _WIDER = 200, 2000


@jit_inner
def _inside(guess, low, high):
    return guess if low < guess < high else 0.5 * (low + high)


@jit_inner
def _vertical_pull(h, rise, w, length, ea, v):
    """Vertical pull [N] at the lower end of a cable that spans ``rise``, from a first guess."""
    low, high, reach = v, v, w * length + h
    for _ in range(_WIDER):
        if catenary_span(h, low, w, length, ea)[1] <= rise:
            break
        low, reach = low - reach, 2.0 * reach
    reach = w * length + h
    for _ in range(_WIDER):
        if catenary_span(h, high, w, length, ea)[1] >= rise:
            break
        high, reach = high + reach, 2.0 * reach
    for _ in range(_STEPS):
        _x, z, _xh, _xv, zv, _xl, _zl = catenary_span(h, v, w, length, ea)
        if z > rise:
            high = v
        else:
            low = v
        following = _inside(v - (z - rise) / zv, low, high)
        if following == v or not low < following < high:
            break
        v = following
    return v


@jit
def bracketed_pull(across, rise, w, length, ea):
    """Pull (h, v) [N] of a catenary at its lower end, by spans [m] to the upper, across > 0."""
    # logarithmic, since the pull of a cable that hangs in a loop is extremely small
    u, v = math.log(0.5 * w * length), 0.5 * w * (rise - length)
    low, high = u, u
    for _ in range(_WIDER):
        v = _vertical_pull(math.exp(low), rise, w, length, ea, v)
        if low < -700.0 or catenary_span(math.exp(low), v, w, length, ea)[0] <= across:
            break
        low -= 2.0
    for _ in range(_WIDER):
        v = _vertical_pull(math.exp(high), rise, w, length, ea, v)
        if catenary_span(math.exp(high), v, w, length, ea)[0] >= across:
            break
        high += 2.0
    for _ in range(_STEPS):
        h = math.exp(u)
        v = _vertical_pull(h, rise, w, length, ea, v)
        x, _z, xh, xv, zv, _xl, _zl = catenary_span(h, v, w, length, ea)
        if x > across:
            high = u
        else:
            low = u
        rate = h * (xh - xv * xv / zv)
        following = _inside(u - (x - across) / rate, low, high) if rate > 0.0 else np.nan
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == u or following in (low, high):
            break
        u = following
    return math.exp(u), v


@jit_inner
def guess_by_brackets(row, across, rise, unknown):
    """A start for :func:`solve_catenary`: exact, except for what is in series with the catenary."""
    length = row[REST] * (1.0 + row[CREEP])
    if row[RADIUS] > 0.0:
        whole, free, tx, tz = pulley_geometry(across, -rise, row[RADIUS])
        length = max(length - (whole - free), 0.1 * length)
        across, rise = free * tx, -free * tz
    h, v = bracketed_pull(across, rise, row[WEIGHT], length, row[EA])
    unknown[0], unknown[1], unknown[2] = h, v, length
