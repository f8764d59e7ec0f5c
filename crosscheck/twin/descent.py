"""Descent of a true robot to its equilibrium: Newton's method on MuJoCo's energy and forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.settle.newton import minimise, neutral_stiffness, stiffness
from crosscheck.twin.world import World
from seecr.pose import Array

_MAX_ITERATIONS = 300
_TOLERANCE = 1e-11
_NUDGE, _NUDGES = 1e-3, 3


@dataclass(frozen=True)
class Descent:
    """How a descent ended; the world is left there.

    Attributes:
        balanced: MuJoCo's forces balance, and no direction leads further down.
        free: some motion changes no force, so that the end point along it is arbitrary.
        residual: residual force relative to the load.
    """

    balanced: bool
    free: bool
    residual: float

    @property
    def at_rest(self) -> bool:
        """Whether it ended in a stable equilibrium."""
        return self.balanced and not self.free


def descend(world: World, judge: bool = True, limit: int = _MAX_ITERATIONS) -> Descent:
    """Go downhill from the world's present state until MuJoCo's forces balance.

    Args:
        world: left where it ends.
        judge: check stability there, and continue if it is unstable.
        limit: most steps.
    """
    total, goal = 0, max(0.01 * _TOLERANCE, world.rounding())
    for nudge in range(1 + _NUDGES):
        size, iterations = minimise(world, goal, limit - total)
        total += iterations
        fine = size <= max(_TOLERANCE, 10.0 * world.rounding())
        if not (fine and judge):
            return Descent(fine, False, size)
        value, softest, neutral = _softest(world)
        if value >= -neutral:
            return Descent(True, value <= neutral, size)
        if nudge < _NUDGES:
            world.move(_NUDGE * world.length * softest / world.metre)
    return Descent(False, False, size)


def _softest(world: World) -> tuple[float, Array, float]:
    """Smallest eigenvalue of the stiffness [N/m], its eigenvector (d,), and what counts as zero.

    A cable whose tension is mere rounding resists on one side at most: without it, the platform may
    be free to move to the other. If it would be unstable without them, such cables are included.
    """
    world.update()
    tensions = world.tensions()
    firm = tensions > 1e-9 * world.force_scale
    neutral = neutral_stiffness(world)
    for taut in (firm, tensions > 0.0):
        matrix = stiffness(world, taut)
        zero = neutral + 1e-9 * float(np.max(np.abs(matrix)))
        if world.solve(matrix, np.zeros(len(matrix)), -zero) is not None:
            return np.inf, np.zeros(len(matrix)), zero
        values, vectors = np.linalg.eigh(matrix)
        if values[0] >= -zero or np.array_equal(firm, tensions > 0.0):
            break
    return float(values[0]), np.asarray(vectors[:, 0]), zero
