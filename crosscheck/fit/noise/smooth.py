"""Monomials of places: the shapes that a smooth function is made of."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from seecr.pose import Array


def monomials(place: Array, degree: int = 3, smooth: float = 1.0) -> Array:
    """(n, k) monomials up to some degree of places (n, d), each axis scaled to [-1, 1].

    Axes along which nothing moves are left out.

    Args:
        smooth: each degree is so many times as large as the one before.
    """
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    half = 0.5 * np.ptp(place, axis=0)
    moves = half > 1e-3 * max(float(half.max()), 1e-300)
    unit = ((place - middle) / np.where(moves, half, 1.0))[:, moves]
    columns = [np.ones(len(place))]
    for power in range(1, degree + 1):
        for axes in combinations_with_replacement(range(unit.shape[1]), power):
            columns.append(smooth**power * np.prod(unit[:, axes], axis=1))
    return np.stack(columns, axis=1)
