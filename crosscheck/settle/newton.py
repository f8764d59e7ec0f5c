"""Newton's method of settling and of twins: on MuJoCo's forces, downhill in MuJoCo's energy."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.physics import Physics
from seecr.pose import Array, pose_difference

# Step of finite differences [robot's length]; central, so the error is of second order.
_DIFFERENCE = 2e-5
# Longest step [robot's length].
_REACH = 0.5
# Number of lengths at which a step is tried, and their ratio.
_TRIES, _SHORTER = 6, 0.3
# Relative increase of the energy that counts as rounding.
_ROUNDING = 1e-12


def minimise(physics: Physics, goal: float, limit: int) -> tuple[float, int]:
    """Go from the present state to an equilibrium, as exactly as rounding permits.

    Args:
        physics: left in the last state.
        goal: residual force relative to the load; below it the search stops as soon as a step does
            not halve the residual.
        limit: most steps.

    Returns:
        the residual force relative to the load, and the number of steps.
    """
    force = physics.residual() / physics.metre
    size = float(np.linalg.norm(force)) / physics.force_scale
    before, damping = np.inf, 0.0
    for iteration in range(limit):
        if size == 0.0 or (size <= goal and size > 0.5 * before):
            return size, iteration
        physics.update()
        matrix = stiffness(physics, physics.tensions() > 0.0)
        # if all cables are slack there is no stiffness to compare with, only the load
        largest = float(np.max(np.abs(matrix))) + physics.force_scale / physics.length
        better = None
        while better is None and damping < 1e6 * largest:
            step = physics.solve(matrix, force, damping, neutral_stiffness(physics))
            better = None if step is None else _try(physics, step, size)
            if better is None:
                if size <= goal:
                    return size, iteration
                damping = max(10.0 * damping, 1e-8 * largest)
        if better is None:
            return size, iteration
        force, before, size = better, size, float(np.linalg.norm(better)) / physics.force_scale
        damping = 0.1 * damping if damping > 1e-12 * largest else 0.0
    return size, limit


def stiffness(physics: Physics, taut: NDArray[np.bool_]) -> Array:
    """Stiffness (d, d) [N/m] at the present qpos, with rotations times the robot's length.

    Central differences of MuJoCo's residual force with a fixed set of taut tendons: a stiff cable
    stretches by less than any useful step, so that plain differences would mix taut and slack.

    Args:
        physics: in the state in question.
        taut: (k,) tendons that pull; the others are left out.
    """
    step, data, n = _DIFFERENCE * physics.length, physics.data, physics.n_dof
    start = data.qpos.copy()
    matrix = np.zeros((n, n))
    with physics.frozen_slack(taut):
        for dofs, rows, columns in physics.coupling:
            change = np.zeros(n)
            change[dofs] = step / physics.metre[dofs]
            forces = []
            for sign in (1.0, -1.0):
                data.qpos[:] = start
                physics.move(sign * change)
                forces.append(physics.residual() / physics.metre)
            matrix[rows, columns] = ((forces[1] - forces[0]) / (2.0 * step))[rows]
    data.qpos[:] = start
    physics.update()
    # cables with bodies of their own act on the platform as it acts on them
    d = physics.n_platform
    matrix[:d, d:] = matrix[d:, :d].T
    return np.asarray(0.5 * (matrix + matrix.T))


def neutral_stiffness(physics: Physics) -> float:
    """Stiffness [N/m] that rounding of the forces can simulate in a difference."""
    return 10.0 * physics.rounding() * physics.force_scale / (_DIFFERENCE * physics.length)


def _try(physics: Physics, step: Array, size: float) -> Array | None:
    """Force after the longest of the shortened steps that goes downhill; None if none does."""
    start, pose = physics.data.qpos.copy(), physics.pose()
    energy = physics.energy()
    longest = float(np.max(np.abs(step[: physics.n_platform])))
    part = min(1.0, _REACH * physics.length / longest) if longest > 0 else 1.0
    rounding = _ROUNDING * (abs(energy) + physics.force_scale * physics.length)
    for _ in range(_TRIES):
        physics.move(part * step / physics.metre)
        now = physics.energy()
        moved = pose_difference(physics.pose(), pose)
        gain = now - energy - float(physics.wrench[3:] @ moved[3:])
        force = physics.residual() / physics.metre
        smaller = float(np.linalg.norm(force)) / physics.force_scale < size
        if (gain < 0.0 and (smaller or gain < -rounding)) or (gain <= rounding and smaller):
            return np.asarray(force)
        physics.data.qpos[:] = start
        part *= _SHORTER
    physics.update()
    return None


# The last digits: Newton's method on MuJoCo's inverse dynamics, from the settled pose.

_MAX_ITERATIONS = 30


@dataclass(frozen=True)
class Polished:
    """Result of the polish; the physics is left in the polished state.

    Attributes:
        residual: residual force relative to the load.
        moved_m: distance [m] from the start.
        moved_rad: rotation [rad] from the start.
        smallest_eigenvalue: of the stiffness there [N/m], rotations times the robot's length.
        softest: (d,) its unit eigenvector.
        neutral: a smaller eigenvalue [N/m] is rounding, not stiffness.
        wall_s: time taken [s].
    """

    residual: float
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
    size, _steps = minimise(physics, physics.rounding(), _MAX_ITERATIONS)
    physics.update()
    moved = pose_difference(physics.pose(), start)
    value, softest = _softest(physics)
    return Polished(
        residual=size,
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
