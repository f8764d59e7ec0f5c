"""Loops of integral feedback with a delay, linearised: do they settle, and how fast.

The state x of a controller changes by the error of a reading that is d steps old,
x(k+1) = x(k) - g M x(k-d). It falls apart into one such loop for each eigenvalue of M.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.pose import Array

Complex = NDArray[np.complex128]

# Eigenvalues smaller than this are zero but for rounding: an exact model has eigenvalue one.
_NEUTRAL = 1e-9


def loop_eigenvalues(matrix: Array, states: Array) -> Complex:
    """Eigenvalues (r,) of a loop M (k, k) for the states that its controller ever has.

    Args:
        matrix: M. states: (k, k) whose columns span these states.
    """
    left, sizes, _right = np.linalg.svd(states)
    basis = left[:, sizes > _NEUTRAL * max(float(sizes.max(initial=0.0)), 1e-300)]
    return np.asarray(np.linalg.eigvals(basis.T @ matrix @ basis), dtype=complex)


def spectral_radius(eigenvalues: Complex, gain: float, delay: int) -> float:
    """The factor by which errors change per step in the end: below one the loop settles.

    It is the largest root of z^(d+1) - z^d + g lambda = 0, over all eigenvalues.

    Args:
        eigenvalues: (r,) of M. gain: g. delay: d, in steps.
    """
    largest = 0.0
    for value in eigenvalues:
        polynomial = np.zeros(delay + 2, dtype=complex)
        polynomial[:2] = 1.0, -1.0
        polynomial[-1] += gain * value
        largest = max(largest, float(np.abs(np.roots(polynomial)).max(initial=0.0)))
    return largest


def largest_gain(eigenvalues: Complex, delay: int) -> float:
    """The gain below which the loop settles; zero if it does with none.

    A root leaves the unit circle at z = exp(i theta), where g lambda = z^d (1 - z). Its argument
    gives theta = (pi/2 - |arg lambda|)/(d + 1/2), and its size g = 2 sin(theta/2)/|lambda|. For
    lambda = 1 that is 2 sin(pi/(4 d + 2)) (Levin and May, Theoretical Population Biology 9, 1976).
    """
    room = 0.5 * np.pi - np.abs(np.angle(eigenvalues))
    size = np.abs(eigenvalues)
    if np.any(size <= _NEUTRAL) or np.any(room <= 0.0):
        return 0.0
    return float(np.min(2.0 * np.sin(room / (2 * delay + 1)) / size, initial=np.inf))


def largest_delay(eigenvalues: Complex, gain: float) -> int | None:
    """The most steps of delay with which a gain holds; None if it holds with none, or any do.

    The bound of :func:`largest_gain`, solved for the delay.
    """
    if len(eigenvalues) == 0 or not gain < largest_gain(eigenvalues, 0):
        return None
    room = 0.5 * np.pi - np.abs(np.angle(eigenvalues))
    most = 0.5 * (room / np.arcsin(0.5 * gain * np.abs(eigenvalues)) - 1.0)
    return int(np.ceil(np.min(most))) - 1
