"""The shapes that a smooth function is made of: monomials of places, and waves over them."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array

# Places from which a process at more places is interpolated.
_CENTRES = 300


def monomials(place: Array, degree: int = 3, smooth: float = 1.0) -> Array:
    """(n, k) monomials up to some degree of places (n, d), each axis scaled to [-1, 1].

    Axes along which nothing moves are left out.

    Args:
        smooth: each degree is so many times as large as the one before.
    """
    unit = _unit(place)
    columns = [np.ones(len(place))]
    for power in range(1, degree + 1):
        for axes in combinations_with_replacement(range(unit.shape[1]), power):
            columns.append(smooth**power * np.prod(unit[:, axes], axis=1))
    return np.stack(columns, axis=1)


def waves(place: Array, length: float) -> Array:
    """(n, k) shapes of a function of places (n, d) that has forgotten itself after some distance.

    Their sum with coefficients c ~ N(0, 1) is a Gaussian process of variance 1 with the covariance
    exp(-d^2/(2 length^2)), but for the last hundredth of its variance (Rasmussen and Williams,
    Gaussian Processes for Machine Learning, 2006, 4.1; Nystrom's method, 8.1, for many places).

    Args:
        length: the distance, where half of each axis' range is 1.
    """
    unit = _unit(place)
    some = unit[np.unique(np.linspace(0, len(unit) - 1, min(len(unit), _CENTRES)).astype(int))]
    power, axes = np.linalg.eigh(_alike(some, some, length))
    power, axes = power[::-1], axes[:, ::-1]
    count = int(np.searchsorted(np.cumsum(power), 0.99 * power.sum())) + 1
    return np.asarray(_alike(unit, some, length) @ axes[:, :count] / np.sqrt(power[:count]))


def _alike(a: Array, b: Array, length: float) -> Array:
    square = np.sum((a[:, None] - b[None]) ** 2, axis=-1)
    return np.asarray(np.exp(-0.5 * square / length**2))


def _unit(place: Array) -> Array:
    """(n, d) places, each axis scaled to [-1, 1], without axes along which nothing moves."""
    middle = 0.5 * (place.max(axis=0) + place.min(axis=0))
    half = 0.5 * np.ptp(place, axis=0)
    moves: NDArray[np.bool_] = half > 1e-3 * max(float(half.max()), 1e-300)
    return np.asarray(((place - middle) / np.where(moves, half, 1.0))[:, moves])
