"""From a state of a true robot down to rest: Newton's method on MuJoCo's energy and forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.settle.polish import neutral_stiffness, stiffness
from crosscheck.twin.world import World
from seecr.pose import Array, pose_difference

_MAX_ITERATIONS = 300
_TOLERANCE = 1e-11
# Longest step, in the robot's own lengths.
_REACH = 0.5
_NUDGE, _NUDGES = 1e-3, 3


@dataclass(frozen=True)
class Descent:
    """How it ended; the world is left there.

    Attributes:
        balanced: MuJoCo's forces balance, and no way leads further down.
        free: some motion changes no force: where it stops along it is arbitrary.
        residual: unbalanced force relative to the load.
        iterations: steps taken.
    """

    balanced: bool
    free: bool
    residual: float
    iterations: int

    @property
    def at_rest(self) -> bool:
        """In a stable equilibrium."""
        return self.balanced and not self.free


def descend(world: World, judge: bool = True, limit: int = _MAX_ITERATIONS) -> Descent:
    """Go downhill from the world's present state until MuJoCo's forces balance.

    Args:
        world: left where it ends.
        judge: look whether it is stable there, and go on if it is not.
        limit: steps to take at most.
    """
    total = 0
    for nudge in range(1 + _NUDGES):
        size, iterations = _minimise(world, limit - total)
        total += iterations
        fine = size <= max(_TOLERANCE, 10.0 * world.rounding())
        if not (fine and judge):
            return Descent(fine, False, size, total)
        value, softest, neutral = _softest(world)
        if value >= -neutral:
            return Descent(True, value <= neutral, size, total)
        if nudge < _NUDGES:
            world.move(_NUDGE * world.length * softest / world.metre)
    return Descent(False, False, size, total)


def _softest(world: World) -> tuple[float, Array, float]:
    """Smallest eigenvalue of the stiffness [N/m], its vector (d,), and what counts as zero.

    A cable whose tension is rounding hinders on one side at most: without it, the platform may
    be free to move to the other. Where it would be unstable, such cables prop it up.
    """
    world.update()
    tensions = world.tensions()
    firm = tensions > 1e-9 * world.force_scale
    neutral = neutral_stiffness(world)
    for taut in (firm, tensions > 0.0):
        matrix = stiffness(world, taut)
        zero = neutral + 1e-9 * float(np.max(np.abs(matrix)))
        if _damped_step(world, matrix, np.zeros(len(matrix)), -zero) is not None:
            return np.inf, np.zeros(len(matrix)), zero
        values, vectors = np.linalg.eigh(matrix)
        if values[0] >= -zero or np.array_equal(firm, tensions > 0.0):
            break
    return float(values[0]), np.asarray(vectors[:, 0]), zero


def _minimise(world: World, limit: int) -> tuple[float, int]:
    force = world.residual() / world.metre
    size = float(np.linalg.norm(force)) / world.force_scale
    goal = max(0.01 * _TOLERANCE, world.rounding())
    damping = 0.0
    for iteration in range(limit):
        if size <= goal:
            return size, iteration
        world.update()
        matrix = stiffness(world, world.tensions() > 0.0)
        while True:
            step = _damped_step(world, matrix, force, damping)
            better = None if step is None else _try(world, step, size)
            if better is not None:
                break
            # with all cables slack there is no stiffness to compare with, only the load
            stiff = float(np.max(np.abs(matrix))) + world.force_scale / world.length
            damping = max(10.0 * damping, 1e-8 * stiff)
            if not damping < 1e6 * stiff:
                return size, iteration
        force, size = better, float(np.linalg.norm(better)) / world.force_scale
        damping = 0.1 * damping if damping > 1e-12 * float(np.max(matrix)) else 0.0
    return size, limit


def _damped_step(world: World, matrix: Array, force: Array, damping: float) -> Array | None:
    """Solve (matrix + damping) step = force cable by cable; None if not positive definite."""
    d, own = world.n_platform, world.cable_dofs
    h = own.shape[1]
    try:
        blocks = matrix[own[:, :, None], own[:, None, :]] + damping * np.eye(h)
        np.linalg.cholesky(blocks)
        right = np.concatenate([matrix[own, :d], force[own][..., None]], axis=2)
        solved = np.linalg.solve(blocks, right)
        joint = np.einsum("khd,khe->de", matrix[own, :d], solved)
        schur = matrix[:d, :d] + damping * np.eye(d) - joint[:, :d]
        np.linalg.cholesky(schur)
    except np.linalg.LinAlgError:
        return None
    step = np.zeros(len(force))
    step[:d] = np.linalg.solve(schur, force[:d] - joint[:, d])
    step[own] = solved[..., d] - solved[..., :d] @ step[:d]
    return step


def _try(world: World, step: Array, size: float) -> Array | None:
    """Force after the longest of the shortened steps that goes downhill; None if none does."""
    start, pose = world.data.qpos.copy(), world.pose()
    energy = world.energy()
    longest = float(np.max(np.abs(step[: world.n_platform])))
    part = min(1.0, _REACH * world.length / longest) if longest > 0 else 1.0
    for _ in range(6):
        world.move(part * step / world.metre)
        now = world.energy()
        moved = pose_difference(world.pose(), pose)
        gain = now - energy - float(world.wrench[3:] @ moved[3:])
        force = world.residual() / world.metre
        smaller = float(np.linalg.norm(force)) / world.force_scale < size
        rounding = 1e-12 * (abs(energy) + world.force_scale * world.length)
        if (gain < 0.0 and (smaller or gain < -rounding)) or (gain <= rounding and smaller):
            return np.asarray(force)
        world.data.qpos[:] = start
        part *= 0.3
    world.update()
    return None
