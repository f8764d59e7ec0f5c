"""Sensitivities to where cables begin and end, and to their rest lengths.

A cable's pull depends on its rest length and on where its anchor point B is as seen from its exit
point A. So the derivatives by A, by B and by l0 all follow from one evaluation of each cable
(:mod:`seecr.compiled.rates`): with F its force on the platform and K = -dF/dB,

    dF = -K (dB - dA) + dF/dl0 dl0,   dM = (B - p) x dF + (dB in the platform) x F,

where dA and dB move the points, and M is the moment about the platform's origin p.
"""

from __future__ import annotations

import numpy as np

from seecr.compiled.columns import RADIUS, WEIGHT
from seecr.compiled.rates import wrench_by_ends_batch
from seecr.pose import Array
from seecr.statics.tables import Tables


def are_by_point(tables: Tables) -> bool:
    """Whether the stiffness of all cables is minus the derivative of their force.

    Of heavy cables over pulleys it is the symmetric part of that.
    """
    heavy, over = tables.cables[..., WEIGHT] > 0.0, tables.cables[..., RADIUS] > 0.0
    return not bool(np.any(heavy & over))


def wrench_by_rest(rates: Array, poses: Array) -> tuple[Array, Array]:
    """Derivatives of the wrench (n, 6, m) [N, N m] and tension (n, m) by each rest length."""
    n, m = rates.shape[:2]
    still = np.zeros((m, 3))
    return wrench_by_ends(rates, poses, still, still, np.ones((n, m)))


def wrench_by_ends(
    rates: Array, poses: Array, exit_moves: Array, anchor_moves: Array, longer: Array
) -> tuple[Array, Array]:
    """Change of the wrench (n, 6, m) by each cable, and of its own tension (n, m).

    Args:
        rates: (n, m, N_RATES) of the cables at the poses (n, 7), see
            :func:`seecr.statics.batch.rates_of_cables`.
        exit_moves: (m, 3) how the exit points move, base axes. anchor_moves: (m, 3) the anchor
            points, platform axes.
        longer: (n, m) how much longer the cables become.
    """
    n, m = longer.shape
    wrench, tension = np.empty((n, 6, m)), np.empty((n, m))
    wrench_by_ends_batch(rates, poses, exit_moves, anchor_moves, longer, wrench, tension)
    return wrench, tension
