"""Cells of a column that were filled in: one number again and again among others that differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import TENSION
from seecr.pose import Array

# A number that stands in so many rows or more, so many times as often as any other, is no rounded
# reading: rounding makes neighbours repeat about as often. Eleven of one and two of the next, if
# both were as probable, come once in ninety times, and then only where the model expects changes.
_LEAST_ROWS, _TIMES = 8, 5


def filled_in(
    read: Array, expected: Array, seen: NDArray[np.bool_], least: Array
) -> NDArray[np.bool_]:
    """(n, 6 + m) cells that repeat a number though the model expects changes beyond ``least``.

    Args:
        read, expected: (n, 6 + m) positions, angles and tensions. seen: which count.
        least: (6 + m,) mean distances from their median that instruments would see.
    """
    odd = np.zeros_like(seen)
    for k, rows in enumerate(seen.T):
        values, count = np.unique(read[rows, k], return_counts=True)
        if len(values) < 2:  # columns of one number alone are another matter
            continue
        often, next_often = np.sort(count)[-1], np.sort(count)[-2]
        same = rows & (read[:, k] == values[np.argmax(count)])
        if often < max(_LEAST_ROWS, _TIMES * next_often + 1):
            continue
        there = expected[same, k]
        if np.abs(there - np.median(there)).mean() > least[k]:
            odd[:, k] = same
    # a slack cable pulls with nothing, but never all of them
    pulls = odd[:, TENSION]
    slack = (read[:, TENSION] == 0.0) & ~(read[:, TENSION] == 0.0).all(axis=1, keepdims=True)
    pulls &= ~slack
    return odd
