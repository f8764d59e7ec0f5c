"""The periodogram of readings at uneven times, in a time that grows with their number.

Sums of sines and cosines come from the fast Fourier transform of readings that are spread onto an
even grid: Press and Rybicki, The Astrophysical Journal 338, 277 (1989). SciPy's ``lombscargle``
allocates a matrix of readings by frequencies, which for 15,000 rows is 16 GB.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from seecr.pose import Array

# Cells of the grid in the shortest period. A reading is spread to the two cells next to it, which
# costs the shortest period two percent of its power, and longer ones less.
_CELLS = 16


def periodogram(t_s: Array, values: Array, step_Hz: float, count: int) -> Array:
    """Lomb-Scargle periodogram at ``step_Hz``, 2 ``step_Hz`` ... ``count`` ``step_Hz``.

    Args:
        t_s: (n,) times [s]. values: (n,) values with mean zero.
        step_Hz: step of the frequencies, at most the inverse of the span of the times.
        count: number of frequencies.

    Returns:
        (count,) power, in the normalisation of :func:`scipy.signal.lombscargle`.
    """
    size = fft.next_fast_len(_CELLS * count, real=True)
    place = (t_s - t_s.min()) * step_Hz * size
    once = _sums(place, values, size)[1 : count + 1]
    twice = _sums(place, np.ones(len(values)), size)[2 : 2 * count + 1 : 2]
    # sines and cosines are orthogonal relative to a time that is half the angle of the sum at twice
    # the frequency
    turned = once * np.exp(-0.5j * np.angle(twice))
    half, off = 0.5 * len(values), 0.5 * np.abs(twice)
    cosines, sines = half + off, np.maximum(half - off, 1e-9 * half)
    return np.asarray(0.5 * (turned.real**2 / cosines + turned.imag**2 / sines))


def _sums(place: Array, values: Array, size: int) -> Array:
    """Sums of values times exp(-i w t) at multiples of the frequency step."""
    below = np.floor(place).astype(np.int64)
    above = place - below
    grid = np.bincount(below % size, values * (1.0 - above), size)
    grid += np.bincount((below + 1) % size, values * above, size)
    return np.asarray(fft.rfft(grid))
