"""A catenary found by bracketing: slower than Newton's method, but it cannot fail to converge.

For a cable that hangs nearly straight down and is barely slack, Newton's method on the whole
system advances very slowly along a curved valley. One unknown at a time is safe: at a given
horizontal pull h the vertical span grows with the vertical pull v, and with v solved for, the
horizontal span grows with h (the complementary energy of a cable is convex). So both roots can be
bracketed.
"""

from __future__ import annotations

import math

import numpy as np

from seecr.compiled.catenary import catenary_span
from seecr.compiled.columns import CREEP, EA, RADIUS, REST, WEIGHT
from seecr.compiled.jit import jit, jit_inner
from seecr.compiled.pulley import pulley_geometry

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
    """Horizontal and vertical pull (h, v) [N] of a catenary at its lower end.

    Args:
        across, rise: spans [m] from the lower to the upper end, across > 0.
        w: weight per metre [N/m]. length: unstretched [m]. ea: E S [N].
    """
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
