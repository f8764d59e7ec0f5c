"""The last digits: Newton's method on MuJoCo's inverse dynamics, from the settled pose."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from crosscheck.settle.newton import minimise, neutral_stiffness, stiffness
from crosscheck.settle.physics import Physics
from seecr.pose import Array, pose_difference

_MAX_ITERATIONS = 30


@dataclass(frozen=True)
class Polished:
    """Result of the polish; the physics is left in the polished state.

    Attributes:
        residual: residual force relative to the load.
        iterations: number of Newton steps.
        moved_m: distance [m] from the start.
        moved_rad: rotation [rad] from the start.
        smallest_eigenvalue: of the stiffness there [N/m], rotations times the robot's length.
        softest: (d,) its unit eigenvector.
        neutral: a smaller eigenvalue [N/m] is rounding, not stiffness.
        wall_s: time taken [s].
    """

    residual: float
    iterations: int
    moved_m: float
    moved_rad: float
    smallest_eigenvalue: float
    softest: Array
    neutral: float
    wall_s: float

    @property
    def unstable(self) -> bool:
        """Whether the energy decreases in some direction from there."""
        return self.smallest_eigenvalue < -self.neutral


def polish(physics: Physics) -> Polished:
    """Newton steps until the residual force is mere rounding.

    There is no motion in directions without stiffness (a platform on one cable may rotate about
    it).
    """
    began = time.perf_counter()
    physics.update()
    start = physics.pose()
    size, iterations = minimise(physics, physics.rounding(), _MAX_ITERATIONS)
    physics.update()
    moved = pose_difference(physics.pose(), start)
    value, softest = _softest(physics)
    return Polished(
        residual=size,
        iterations=iterations,
        moved_m=float(np.linalg.norm(moved[:3])),
        moved_rad=float(np.linalg.norm(moved[3:])),
        smallest_eigenvalue=value,
        softest=softest,
        neutral=neutral_stiffness(physics),
        wall_s=time.perf_counter() - began,
    )


def _softest(physics: Physics) -> tuple[float, Array]:
    """Smallest eigenvalue of the stiffness [N/m] and its direction (d,), a unit vector.

    A cable whose tension is mere rounding resists on one side at most: without it, the platform may
    be free to move to the other. If it would be unstable without them, such cables are included.
    """
    tensions = physics.tensions()
    firm = tensions > 10.0 * physics.rounding() * physics.force_scale
    value, direction = _least(physics, stiffness(physics, firm))
    if value < -neutral_stiffness(physics) and np.any((tensions > 0.0) & ~firm):
        value, direction = _least(physics, stiffness(physics, tensions > 0.0))
    return value, direction


def _least(physics: Physics, matrix: Array) -> tuple[float, Array]:
    """Smallest eigenvalue of a stiffness (d, d) by motions of the platform, and its direction.

    Joints are no measure of these: a hinge beside the platform's origin also moves it. Of K v =
    value M v, M has the products of the motions of each joint.
    """
    products = physics.motion_products()
    if products is None:
        values, vectors = np.linalg.eigh(matrix)
        return float(values[0]), np.asarray(vectors[:, 0])
    from scipy.linalg import eigh  # takes a while to import

    values, vectors = eigh(matrix, products, subset_by_index=(0, 0))
    direction = vectors[:, 0] / np.linalg.norm(vectors[:, 0])
    return float(values[0]), np.asarray(direction)
