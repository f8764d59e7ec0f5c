"""Initial positions of the point masses of hanging cables; MuJoCo then finds their equilibrium.

With both ends held, the tension in the lowest segment determines the shape. It minimises a convex
function (the complementary energy), so Newton's method always finds it, however slack the cable is.
"""

from __future__ import annotations

import numpy as np

from seecr.pose import Array

_ITERATIONS, _SHORTENINGS = 100, 40


def hang(start: Array, end: Array, rest: Array, ea: Array, weight: Array, segments: int) -> Array:
    """Point masses (m, N - 1, 3) [m] of m chains, from start to end.

    Args:
        start: (m, 3) [m] upper ends.
        end: (m, 3) [m] lower ends, on the platform.
        rest: (m,) [m] unstretched lengths.
        ea: (m,) [N].
        weight: (3,) [N/m] of cable, upwards.
        segments: N.
    """
    part = rest / segments
    steps = np.arange(segments)[None, :, None] * part[:, None, None] * weight
    pull = _pull(start - end, part, ea, steps)
    force = pull[:, None] + steps
    size = np.linalg.norm(force, axis=2, keepdims=True)
    pieces = part[:, None, None] * (1.0 + size / ea[:, None, None]) * force / size
    # summed from the platform upwards; the last piece ends at the exit point
    return np.asarray((end[:, None] + np.cumsum(pieces, axis=1))[:, -2::-1])


def _pull(span: Array, part: Array, ea: Array, steps: Array) -> Array:
    """Tension (m, 3) [N] of the lowest segments, for spans (m, 3) [m] from there to the top."""
    n = steps.shape[1]
    chord = np.linalg.norm(span, axis=1)
    stretch = np.maximum(chord / (n * part) - 1.0, 0.0)
    weight = np.linalg.norm(steps[:, -1], axis=1) * n / max(n - 1, 1)
    along = (ea * stretch + 0.3 * weight) / chord
    pull = along[:, None] * span - 0.5 * steps[:, -1]
    for _ in range(_ITERATIONS):
        value, slope, curvature = _complementary(pull, span, part, ea, steps)
        step = -np.linalg.solve(curvature, slope[..., None])[..., 0]
        falls = np.einsum("mi,mi->m", slope, step)
        size = np.ones(len(pull))
        for _ in range(_SHORTENINGS):
            trial = pull + size[:, None] * step
            worse = _complementary(trial, span, part, ea, steps)[0] > value + 1e-4 * size * falls
            worse &= np.abs(size * falls) > 1e-14 * np.abs(value)
            if not np.any(worse):
                break
            size[worse] *= 0.5
        pull = trial
        if np.all(np.linalg.norm(slope, axis=1) < 1e-12 * n * part):
            break
    return np.asarray(pull)


def _complementary(
    pull: Array, span: Array, part: Array, ea: Array, steps: Array
) -> tuple[Array, Array, Array]:
    """Complementary energy (m,) [J], its gradient (m, 3) [m] and Hessian (m, 3, 3) [m/N]."""
    force = pull[:, None] + steps
    size = np.maximum(np.linalg.norm(force, axis=2), 1e-300)
    value = part * np.sum(size + size**2 / (2.0 * ea[:, None]), axis=1)
    value = value - np.einsum("mi,mi->m", pull, span)
    unit = force / size[..., None]
    slope = part[:, None] * np.sum((1.0 + size / ea[:, None])[..., None] * unit, axis=1) - span
    turn = np.eye(3) - unit[..., :, None] * unit[..., None, :]
    curvature = np.sum(turn / size[..., None, None], axis=1)
    curvature = curvature + (steps.shape[1] / ea)[:, None, None] * np.eye(3)
    return value, slope, part[:, None, None] * curvature
