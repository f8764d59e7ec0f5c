"""Tensions that balance a load and exceed their limits by as little as possible, summed.

With at most two more cables than degrees of freedom they are tau = tau_p + N nu with nu in a plane.
The sum is convex and linear between the lines on which a tension is at a limit, so it is least
where two of these cross: all crossings are tried.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.jit import jit_allocating, jit_inner
from seecr.compiled.margin import null_space

# Lines that cross at less than this angle [rad] are parallel.
_PARALLEL = 1e-9
# Sums that differ by less than this part are equal.
_SAME = 1e-12


@jit_inner
def _exceeding(particular, null, x, y, low, high, tension):
    """Fill tensions (m,) at a point of the plane; returns by how much they exceed their limits."""
    total = 0.0
    for i in range(particular.shape[0]):
        tension[i] = particular[i] + null[i, 0] * x + null[i, 1] * y
        total += max(low[i] - tension[i], 0.0) + max(tension[i] - high[i], 0.0)
    return total


@jit_inner
def _crossing(null, first, second, to_first, to_second):
    """Where two lines null[i] . nu = to_i cross; whether they do."""
    a, b, c, d = null[first, 0], null[first, 1], null[second, 0], null[second, 1]
    size = np.sqrt((a * a + b * b) * (c * c + d * d))
    cross = a * d - b * c
    if not abs(cross) > _PARALLEL * size:
        return False, 0.0, 0.0
    return True, (to_first * d - to_second * b) / cross, (to_second * a - to_first * c) / cross


@jit_allocating
def least_beyond(matrix, load, low, high, tension):
    """Fill the tensions (m,) [N] that exceed their limits least; False if W is singular.

    Args:
        matrix: (d, m), m - d from 0 to 2. load: (d,). low, high: (m,) [N].
    """
    d, m = matrix.shape
    own, particular = np.empty((m, m - d)), np.empty(m)
    if not null_space(matrix, load, np.empty((m, d + 1)), particular, own):
        return False
    # of a line or a point, the coordinates that are not there are lines of their own through zero
    n, more = m + 2 - (m - d), m - d
    null, ends = np.zeros((n, 2)), np.zeros((n, 2))
    for i in range(m):
        for k in range(more):
            null[i, k] = own[i, k]
        ends[i, 0], ends[i, 1] = low[i] - particular[i], high[i] - particular[i]
    for k in range(more, 2):
        null[m + k - more, k] = 1.0
    best, at_x, at_y = np.inf, 0.0, 0.0
    # from the last cable on: of equal sums the first cables exceed their limits
    for i in range(n - 1, -1, -1):
        for j in range(i - 1, -1, -1):
            for side in range(4):
                to_i, to_j = ends[i, side % 2], ends[j, side // 2]
                if not (np.isfinite(to_i) and np.isfinite(to_j)):
                    continue
                crosses, x, y = _crossing(null, i, j, to_i, to_j)
                if crosses:
                    total = _exceeding(particular, null, x, y, low, high, tension)
                    if total < (1.0 - _SAME) * best:
                        best, at_x, at_y = total, x, y
    _exceeding(particular, null, at_x, at_y, low, high, tension)
    return best < np.inf
