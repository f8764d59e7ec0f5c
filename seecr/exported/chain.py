"""Where the masses of a hanging cable start: near where they rest, so that MuJoCo finds it."""

from __future__ import annotations

import numpy as np

from seecr.pose import Array


def hanging(start: Array, end: Array, rest: float, ea: float, weight: Array, n: int) -> Array:
    """Point masses (n - 1, 3) [m] between n springs that hang from one point to another.

    The tension of the lowest spring decides the shape; SciPy finds the one that ends at the top.

    Args:
        start, end: (3,) [m] upper and lower end.
        rest: unstretched length [m]. ea: [N].
        weight: (3,) [N/m] of cable, upwards.
        n: number of springs.
    """
    from scipy.optimize import least_squares

    part = rest / n
    load = np.arange(n)[:, None] * part * weight

    def way(pull: Array) -> Array:
        """From the lower end up, spring by spring (n, 3) [m]."""
        force = pull + load
        size = np.linalg.norm(force, axis=1, keepdims=True)
        return np.asarray(np.cumsum(part * (1.0 / size + 1.0 / ea) * force, axis=0))

    span = start - end
    chord, heavy = float(np.linalg.norm(span)), rest * float(np.linalg.norm(weight))
    along = ea * max(chord / rest - 1.0, 0.0) + 0.3 * heavy
    guess = along * span / chord - 0.5 * rest * weight
    # in units of the guess: tensions are newtons or kilonewtons
    unit = float(np.linalg.norm(guess))
    found = least_squares(
        lambda x: (way(unit * x)[-1] - span) / chord, guess / unit, xtol=1e-14, ftol=1e-14,
        gtol=1e-14,
    )  # fmt: skip
    return np.asarray(end + way(unit * found.x)[-2::-1])
