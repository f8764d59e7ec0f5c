"""The last digits: Newton on MuJoCo's inverse dynamics, from where the platform came to rest."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.physics import Physics
from seecr.pose import Array, pose_difference

Mask = NDArray[np.bool_]

# Differences across this much of the robot's length: central, so the truncation is its square.
DIFFERENCE = 2e-5
_MAX_ITERATIONS = 30


@dataclass(frozen=True)
class Polished:
    """What the polish did; the physics is left at the polished state.

    Attributes:
        residual: unbalanced force relative to the load.
        iterations: Newton steps taken.
        moved_m: distance [m] from where it started.
        moved_rad: rotation [rad] from where it started.
        smallest_eigenvalue: of the stiffness there [N/m], rotations as metres at the robot's
            length.
        softest: (d,) its unit eigenvector.
        neutral: below this an eigenvalue [N/m] is rounding, not stiffness.
        wall_s: time it took [s].
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
        """Whether the energy falls in some direction from there."""
        return self.smallest_eigenvalue < -self.neutral


def stiffness(physics: Physics, taut: Mask) -> Array:
    """Stiffness (d, d) [N/m] at the present qpos, rotations as metres at the robot's length.

    Central differences of MuJoCo's unbalanced force with the set of taut tendons held: a stiff
    cable is stretched by less than any useful difference, so plain differences would straddle
    taut and slack.

    Args:
        physics: in the state asked about.
        taut: (k,) tendons that pull; the others are left out.
    """
    step, data, n = DIFFERENCE * physics.length, physics.data, physics.n_dof
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
    # what cables with parts of their own do to the platform is what the platform does to them
    d = physics.n_platform
    matrix[:d, d:] = matrix[d:, :d].T
    return np.asarray(0.5 * (matrix + matrix.T))


def polish(physics: Physics) -> Polished:
    """Newton steps on the unbalanced force until rounding is all that is left.

    The step is halved until the unbalanced force falls; directions without stiffness (a
    platform on one cable may turn about it) are left alone.
    """
    began = time.perf_counter()
    physics.update()
    start = physics.pose()
    force = physics.residual()
    size, iterations = physics.relative(force), 0
    while iterations < _MAX_ITERATIONS and size > 0.0:
        better = _step(physics, size)
        if better is None:
            break
        force, before, size = better, size, physics.relative(better)
        iterations += 1
        if size <= physics.rounding() and size > 0.5 * before:
            break
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
    """Smallest eigenvalue of the stiffness [N/m] and its unit vector (d,).

    A cable whose tension is only rounding hinders on one side at most: without it, the platform
    may be free to move to the other. Where it would be unstable, such cables prop it up.
    """
    tensions = physics.tensions()
    firm = tensions > 10.0 * physics.rounding() * physics.force_scale
    values, vectors = np.linalg.eigh(stiffness(physics, firm))
    if values[0] < -neutral_stiffness(physics) and np.any((tensions > 0.0) & ~firm):
        values, vectors = np.linalg.eigh(stiffness(physics, tensions > 0.0))
    return float(values[0]), np.asarray(vectors[:, 0])


def neutral_stiffness(physics: Physics) -> float:
    """Stiffness [N/m] that rounding of the forces can pretend in a difference."""
    return 10.0 * physics.rounding() * physics.force_scale / (DIFFERENCE * physics.length)


def _taut(physics: Physics) -> Mask:
    return physics.tensions() > 0.0


def _step(physics: Physics, size: float) -> Array | None:
    """Unbalanced force after one step; None if no step lowers it.

    Where a slack cable is about to become taut, the step that ignores it runs into it, and
    halving that step creeps. The cables taut at either end then decide together.
    """
    physics.update()
    start, taut = physics.data.qpos.copy(), _taut(physics)
    change = _newton_step(physics, taut)
    better = _shorten(physics, change, size)
    if better is not None and physics.relative(better) < 0.5 * size:
        return better
    reached = physics.data.qpos.copy()
    met = _taut_after(physics, start, change) & ~taut
    if np.any(met):
        other = _shorten(physics, _newton_step(physics, taut | met), size)
        if other is not None and (
            better is None or physics.relative(other) < physics.relative(better)
        ):
            return other
    physics.data.qpos[:] = reached
    return better


def _taut_after(physics: Physics, start: Array, change: Array) -> Mask:
    """Cables (m,) taut after a full step from a state, to which the platform returns."""
    physics.data.qpos[:] = start
    physics.move(change)
    physics.update()
    taut = _taut(physics)
    physics.data.qpos[:] = start
    physics.update()
    return taut


def _newton_step(physics: Physics, taut: Mask) -> Array:
    """Generalised displacement (d,) that balances the forces if these cables stay taut."""
    with physics.frozen_slack(taut):
        force = physics.residual() / physics.metre
    values, vectors = np.linalg.eigh(stiffness(physics, taut))
    stiff = np.abs(values) > neutral_stiffness(physics)
    along = vectors.T @ force
    return np.asarray(vectors[:, stiff] @ (along[stiff] / values[stiff])) / physics.metre


def _shorten(physics: Physics, change: Array, size: float) -> Array | None:
    """Unbalanced force after the longest of the halved steps that lowers it; None if none does."""
    start = physics.data.qpos.copy()
    for _ in range(8):
        physics.move(change)
        force = physics.residual()
        if physics.relative(force) < size:
            return force
        physics.data.qpos[:] = start
        change = 0.5 * change
    return None
