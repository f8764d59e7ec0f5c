"""The periodogram of readings at uneven times, in a time that grows with their number.

Sums of sines and cosines come from the fast Fourier transform of readings spread onto an even
grid: Press and Rybicki, The Astrophysical Journal 338, 277 (1989). SciPy's ``lombscargle`` holds
a matrix of readings by frequencies, which for 15,000 rows is 16 GB.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from seecr.pose import Array

# Cells of the grid in the shortest period: a reading stands in the two next to it, by which the
# shortest period loses two parts in a hundred of its power, and longer ones less.
_CELLS = 16


def periodogram(t_s: Array, values: Array, step_Hz: float, count: int) -> Array:
    """Lomb and Scargle's periodogram at ``step_Hz``, 2 ``step_Hz`` ... ``count`` ``step_Hz``.

    Args:
        t_s: (n,) times [s]. values: (n,) of mean zero.
        step_Hz: of the frequencies, at most one over the span of the times.
        count: of the frequencies.

    Returns:
        (count,) power, in the normalisation of :func:`scipy.signal.lombscargle`.
    """
    size = fft.next_fast_len(_CELLS * count, real=True)
    place = (t_s - t_s.min()) * step_Hz * size
    once = _sums(place, values, size)[1 : count + 1]
    twice = _sums(place, np.ones(len(values)), size)[2 : 2 * count + 1 : 2]
    # the time from which sines and cosines are independent, as half the angle of the sum at twice
    # the frequency
    turned = once * np.exp(-0.5j * np.angle(twice))
    half, off = 0.5 * len(values), 0.5 * np.abs(twice)
    cosines, sines = half + off, np.maximum(half - off, 1e-9 * half)
    return np.asarray(0.5 * (turned.real**2 / cosines + turned.imag**2 / sines))


def _sums(place: Array, values: Array, size: int) -> Array:
    """Sums of values times exp(-i w t), by multiples of the step."""
    below = np.floor(place).astype(np.int64)
    above = place - below
    grid = np.bincount(below % size, values * (1.0 - above), size)
    grid += np.bincount((below + 1) % size, values * above, size)
    return np.asarray(fft.rfft(grid))
