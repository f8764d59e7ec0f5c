"""A cable robot brought to rest by MuJoCo: an answer that shares nothing with seecr's statics.

Stage 1 (:mod:`crosscheck.settle.relax`) lets the platform move from the commanded pose by its own
dynamics until it rests, which shows that the equilibrium is stable and reached from there.
Stage 2 (:mod:`crosscheck.settle.polish`) adds digits without leaving that equilibrium. Both are
reported.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.settle.physics import Physics
from crosscheck.settle.polish import Polished, polish
from crosscheck.settle.relax import Observer, Rest, come_to_rest
from crosscheck.settle.settling import SettleStatus, Settling, SettlingBatch
from seecr.pose import Array, pose_difference

# Relative residual after the polish; where rounding leaves more, that is the limit.
_POLISHED = 1e-9
# A polish that moves the platform by more of its length has gone to another equilibrium.
_MOVED = 1e-2
# An unstable equilibrium is left by this much of the length, up to this often.
_NUDGE = 1e-3
_NUDGES = 3


class Settler:
    """Settles one robot in MuJoCo, pose after pose. It can be pickled; one thread at a time.

    Attributes:
        physics: the robot in MuJoCo.
        ea: (m,) [N] k_c = E S of each cable.
        tolerance: unbalanced force, relative to the load, at which stage 1 is at rest.
        max_steps: of MuJoCo in stage 1.
    """

    def __init__(
        self,
        source: str | Path | mujoco.MjModel,
        *,
        ea: Array | float | None = None,
        tolerance: float = 1e-8,
        max_steps: int = 40_000,
    ) -> None:
        """Compile the robot.

        Args:
            source: MJCF file, or a model compiled from one (it is copied).
            ea: (m,) or one number [N]; None takes stiffness times rest length of the MJCF.
            tolerance: of stage 1; rounding of very stiff cables may raise it.
            max_steps: after which stage 1 gives up.

        Raises:
            InputFileError: the file is not one platform on cables.
        """
        self.physics = Physics(source)
        own = self.physics.stiffness * self.physics.rest_lengths
        self.ea = np.array(np.broadcast_to(own if ea is None else ea, own.shape), dtype=float)
        self.tolerance = tolerance
        self.max_steps = max_steps

    def clone(self) -> Settler:
        """Another one of the same robot, for another thread."""
        return _rebuild(*self._parts())

    def __reduce__(self) -> tuple[Callable[..., Settler], tuple[Any, ...]]:
        """Pickle what it was made from: MuJoCo's state does not travel."""
        return _rebuild, self._parts()

    def _parts(self) -> tuple[Any, ...]:
        return self.physics.source, self.ea, self.tolerance, self.max_steps

    def settle(
        self,
        pose: Array,
        rest_lengths: Array,
        *,
        ea: Array | None = None,
        wrench: Array | None = None,
        gravity: Array | None = None,
        observe: Observer | None = None,
    ) -> Settling:
        """Bring the platform to rest from a pose.

        Args:
            pose: (7,) where it starts at rest, the commanded pose.
            rest_lengths: (m,) [m].
            ea: (m,) [N]; None takes the settler's.
            wrench: (6,) [N, N m], constant, at the platform's origin in the base frame.
            gravity: (3,) [m/s^2]; None takes the MJCF's.
            observe: called with the physics after each step of stage 1.

        Raises:
            CrosscheckError: a wrong shape, or numbers that are no lengths or stiffnesses.
        """
        physics = self.physics
        self._prepare(pose, rest_lengths, ea, wrench, gravity)
        rest = self._rest(observe)
        for nudges in range(1 + _NUDGES):
            if rest.status is not SettleStatus.SETTLED:
                return _failure(physics, rest, nudges)
            settled_pose = physics.pose()
            polished = polish(physics)
            if not polished.unstable or nudges == _NUDGES:
                break
            physics.move(_NUDGE * physics.length * polished.softest / physics.metre)
            physics.update()
            rest = self._rest(observe).after(rest)
        return _result(physics, rest, polished, settled_pose, nudges)

    def stays(
        self,
        pose: Array,
        rest_lengths: Array,
        *,
        position_m: float = 1e-6,
        rotation_rad: float = 1e-5,
        ea: Array | None = None,
        wrench: Array | None = None,
        gravity: Array | None = None,
    ) -> tuple[bool, Settling]:
        """Whether MuJoCo, started from a pose (7,), comes to rest there.

        For two stable equilibria: each physics should stay in the other's. Returns the
        settling too.
        """
        settling = self.settle(pose, rest_lengths, ea=ea, wrench=wrench, gravity=gravity)
        if not settling.settled:
            return False, settling
        away = pose_difference(settling.pose, pose)
        near = np.linalg.norm(away[:3]) <= position_m and np.linalg.norm(away[3:]) <= rotation_rad
        return bool(near), settling

    def energy(
        self,
        pose: Array,
        rest_lengths: Array,
        *,
        ea: Array | None = None,
        wrench: Array | None = None,
        gravity: Array | None = None,
    ) -> float:
        """Potential energy [J] in MuJoCo at a pose (7,), see :meth:`Physics.energy`."""
        self._prepare(pose, rest_lengths, ea, wrench, gravity)
        return self.physics.energy()

    def _prepare(
        self,
        pose: Array,
        rest_lengths: Array,
        ea: Array | None,
        wrench: Array | None,
        gravity: Array | None,
    ) -> None:
        self.physics.set_cables(rest_lengths, self.ea if ea is None else ea)
        self.physics.set_load(wrench, gravity)
        self.physics.place(pose)

    def _rest(self, observe: Observer | None) -> Rest:
        tolerance = max(self.tolerance, 10.0 * self.physics.rounding())
        return come_to_rest(self.physics, tolerance, self.max_steps, observe)


def _rebuild(
    source: str | Path | mujoco.MjModel, ea: Array, tolerance: float, max_steps: int
) -> Settler:
    return Settler(source, ea=ea, tolerance=tolerance, max_steps=max_steps)


def settle_batch(
    settler: Settler,
    poses: Array,
    rest_lengths: Array,
    *,
    jobs: int = 1,
    ea: Array | None = None,
    wrench: Array | None = None,
    gravity: Array | None = None,
) -> SettlingBatch:
    """Settle many poses, each from its own commanded pose, so that their order is irrelevant.

    Args:
        settler: the robot.
        poses: (n, 7).
        rest_lengths: (n, m) [m].
        jobs: processes. Threads would not help: a step takes MuJoCo 3 microseconds, too short to
            share Python's interpreter. A process takes half a second to start, 200 poses' worth,
            and a script that asks for them needs ``if __name__ == "__main__"``.
        ea: (m,) or (n, m) [N]; None takes the settler's.
        wrench: (6,) or (n, 6) [N, N m].
        gravity: (3,) or (n, 3) [m/s^2].
    """
    poses = np.asarray(poses, dtype=float)
    n = len(poses)
    if poses.shape != (n, 7) or np.shape(rest_lengths) != (n, settler.physics.n_cables):
        raise CrosscheckError(
            f"poses and rest_lengths: expected (n, 7) and (n, {settler.physics.n_cables}), "
            f"got {poses.shape} and {np.shape(rest_lengths)}"
        )
    inputs = {"ea": ea, "wrench": wrench, "gravity": gravity}
    each = {
        name: np.broadcast_to(value, (n, np.shape(value)[-1]))
        for name, value in inputs.items()
        if value is not None
    }
    each |= {"pose": poses, "rest_lengths": np.asarray(rest_lengths, dtype=float)}
    jobs = min(jobs, n)
    if jobs <= 1:
        return SettlingBatch(_settle_rows(settler, each))
    shares = [{name: rows[k::jobs] for name, rows in each.items()} for k in range(jobs)]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        parts = list(pool.map(_settle_rows, [settler.clone() for _ in shares], shares))
    return SettlingBatch(parts[i % jobs][i // jobs] for i in range(n))


def _settle_rows(settler: Settler, rows: dict[str, Array]) -> list[Settling]:
    names, n = list(rows), len(rows["pose"])
    return [settler.settle(**{name: rows[name][i] for name in names}) for i in range(n)]


def _result(
    physics: Physics, rest: Rest, polished: Polished, settled_pose: Array, nudges: int
) -> Settling:
    status = _verdict(physics, polished)
    if status is not SettleStatus.SETTLED:
        return _failure(physics, rest, nudges, status, polished)
    tensions = physics.tensions()
    return Settling(
        status=status,
        pose=physics.pose(),
        qpos=physics.data.qpos.copy(),
        tensions=tensions,
        slack=tensions == 0.0,
        energy=physics.energy(),
        smallest_eigenvalue=polished.smallest_eigenvalue,
        neutral=polished.neutral,
        residual=polished.residual,
        rounding=physics.rounding(),
        settled_pose=settled_pose,
        settled_residual=rest.residual,
        steps=rest.steps,
        time_step=rest.time_step,
        simulated_s=rest.simulated_s,
        settle_wall_s=rest.wall_s,
        polish_steps=polished.iterations,
        polish_wall_s=polished.wall_s,
        polish_moved_m=polished.moved_m,
        polish_moved_rad=polished.moved_rad,
        nudges=nudges,
    )


def _verdict(physics: Physics, polished: Polished) -> SettleStatus:
    moved = np.hypot(polished.moved_m, polished.moved_rad * physics.length)
    if moved > _MOVED * physics.length:
        return SettleStatus.POLISH_MOVED
    if polished.unstable:
        return SettleStatus.UNSTABLE
    if not polished.residual <= max(_POLISHED, 10.0 * physics.rounding()):
        return SettleStatus.POLISH_STALLED
    return SettleStatus.SETTLED


def _failure(
    physics: Physics,
    rest: Rest,
    nudges: int,
    status: SettleStatus | None = None,
    polished: Polished | None = None,
) -> Settling:
    m = physics.n_cables
    return Settling(
        status=status or rest.status,
        pose=np.full(7, np.nan),
        qpos=np.full(physics.model.nq, np.nan),
        tensions=np.full(m, np.nan),
        slack=np.zeros(m, dtype=bool),
        energy=np.nan,
        smallest_eigenvalue=polished.smallest_eigenvalue if polished else np.nan,
        neutral=polished.neutral if polished else np.nan,
        residual=polished.residual if polished else np.nan,
        rounding=physics.rounding(),
        settled_pose=np.full(7, np.nan),
        settled_residual=rest.residual,
        steps=rest.steps,
        time_step=rest.time_step,
        simulated_s=rest.simulated_s,
        settle_wall_s=rest.wall_s,
        polish_steps=polished.iterations if polished else 0,
        polish_wall_s=polished.wall_s if polished else 0.0,
        polish_moved_m=polished.moved_m if polished else np.nan,
        polish_moved_rad=polished.moved_rad if polished else np.nan,
        nudges=nudges,
    )
