"""A cable robot brought to rest by MuJoCo: an answer that shares nothing with seecr's statics.

In stage 1 (:mod:`crosscheck.settle.relax`) the platform moves from the commanded pose by its own
dynamics until it rests, which shows that the equilibrium is stable and reached from there. Stage 2
(:mod:`crosscheck.settle.polish`) adds digits without leaving that equilibrium. Both are reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.settle.physics import Physics
from crosscheck.settle.polish import Polished, polish
from crosscheck.settle.relax import Observer, Rest, SettleStatus, come_to_rest
from seecr.description.mjcf import quiet_mujoco
from seecr.pose import Array
from seecr.result import Record

# Largest relative residual after the polish, unless rounding alone leaves more.
_POLISHED = 1e-9
# A polish that moves the platform by more than this, in lengths, has gone to another equilibrium.
_MOVED = 1e-2
# Push off an unstable equilibrium [robot's length], and how often it is repeated.
_NUDGE = 1e-3
_NUDGES = 3


@dataclass(frozen=True, eq=False)
class Settling:
    """One platform at rest, or why not: on failure every number of the answer is NaN.

    Attributes:
        status: how it ended.
        pose: (7,) after the polish.
        qpos: (nq,) MuJoCo's coordinates of that pose.
        tensions: (m,) [N] after the polish.
        slack: (m,) whether each cable has no tension; all False on failure.
        energy: potential energy [J], see :meth:`crosscheck.settle.physics.Physics.energy`.
        settled_pose: (7,) after stage 1 alone.
        rounding: the relative residual due to rounding alone.
        rest: result of stage 1, also on failure.
        polished: result of stage 2.
        nudges: how often the platform was pushed off an unstable equilibrium.
    """

    status: SettleStatus
    pose: Array
    qpos: Array
    tensions: Array
    slack: NDArray[np.bool_]
    energy: float
    settled_pose: Array
    rounding: float
    rest: Rest
    polished: Polished
    nudges: int

    @property
    def residual(self) -> float:
        """Residual force after the polish relative to the load (torques over length)."""
        return self.polished.residual

    @property
    def settled_residual(self) -> float:
        """As :attr:`residual`, after stage 1 alone; also given on failure."""
        return self.rest.residual

    @property
    def smallest_eigenvalue(self) -> float:
        """Of the stiffness [N/m]; at or below ``neutral`` the platform may move freely."""
        return self.polished.smallest_eigenvalue

    @property
    def neutral(self) -> float:
        """A smaller eigenvalue is rounding [N/m]."""
        return self.polished.neutral

    @property
    def steps(self) -> int:
        """Steps of MuJoCo in stage 1."""
        return self.rest.steps

    @property
    def simulated_s(self) -> float:
        """Simulated time of stage 1 [s]."""
        return self.rest.simulated_s

    @property
    def settled(self) -> bool:
        """Whether there is an answer."""
        return self.status is SettleStatus.SETTLED

    @property
    def free_to_move(self) -> bool:
        """Whether some motion changes no force, so that the end point along it is arbitrary.

        For example, two taut cables leave a platform free to rotate about the line through their
        anchor points if its centre of mass is on that line.
        """
        return self.settled and self.smallest_eigenvalue <= self.neutral

    @property
    def wall_s(self) -> float:
        """Time of both stages [s]."""
        return self.rest.wall_s + self.polished.wall_s


class SettlingBatch(tuple[Settling, ...]):
    """Settlings in the order of their poses; any attribute of one, stacked: ``batch.pose``.

    ``batch.pose`` is (n, 7), ``batch.tensions`` (n, m), ``batch.status`` (n,) of
    :class:`SettleStatus`, ``batch.settled`` (n,) bool, and so on.
    """

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not (name in _FIELDS or hasattr(Settling, name)):
            raise AttributeError(f"a settling has no {name}")
        values = [getattr(one, name) for one in self]
        if name == "status":
            stacked = np.empty(len(values), dtype=object)
            stacked[:] = values
            return stacked
        return np.array(values)

    def as_json(self) -> Record:
        """``mujoco`` of a case in ``results.json``: the answers for all poses, by quantity."""
        return {
            "settled_pose": self.settled_pose,
            "settled_residual": self.settled_residual,
            "pose": self.pose,
            "tensions_N": self.tensions,
            "slack": self.slack,
            "residual": self.residual,
            "smallest_eigenvalue_N_per_m": self.smallest_eigenvalue,
            "energy_J": self.energy,
            "steps": self.steps,
            "simulated_s": self.simulated_s,
            "status": self.status,
        }


_FIELDS = frozenset(Settling.__dataclass_fields__)


class Settler:
    """Settles one robot in MuJoCo, pose after pose; not thread-safe.

    Attributes:
        physics: the robot in MuJoCo.
        ea: (m,) [N] k_c = E S of each cable.
        tolerance: residual force, relative to the load, at which stage 1 ends.
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
        self.physics = Physics.of(source)
        own = self.physics.stiffness * self.physics.rest_lengths
        self.ea = np.array(np.broadcast_to(own if ea is None else ea, own.shape), dtype=float)
        self.tolerance = tolerance
        self.max_steps = max_steps

    @quiet_mujoco()
    def settle(
        self,
        pose: Array,
        rest_lengths: Array,
        *,
        observe: Observer | None = None,
    ) -> Settling:
        """Bring the platform to rest from a pose.

        Args:
            pose: (7,) where it starts without velocity, usually the commanded pose.
            rest_lengths: (m,) [m].
            observe: called with the physics after each step of stage 1.

        Raises:
            CrosscheckError: a wrong shape, or numbers that are not valid lengths or stiffnesses.
        """
        physics = self.physics
        self._prepare(pose, rest_lengths)
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

    @quiet_mujoco()
    def energy(self, pose: Array, rest_lengths: Array) -> float:
        """Potential energy [J] in MuJoCo at a pose (7,), see :meth:`Physics.energy`."""
        self._prepare(pose, rest_lengths)
        return self.physics.energy()

    def _prepare(self, pose: Array, rest_lengths: Array) -> None:
        self.physics.set_cables(rest_lengths, self.ea)
        self.physics.set_load()
        self.physics.place(pose)

    def _rest(self, observe: Observer | None) -> Rest:
        tolerance = max(self.tolerance, 10.0 * self.physics.rounding())
        return come_to_rest(self.physics, tolerance, self.max_steps, observe)


def settle_batch(settler: Settler, poses: Array, rest_lengths: Array) -> SettlingBatch:
    """Settle many poses, each from its own start pose, so that their order does not matter.

    Args:
        settler: the robot.
        poses: (n, 7) start poses.
        rest_lengths: (n, m) [m].
    """
    poses = np.asarray(poses, dtype=float)
    n = len(poses)
    if poses.shape != (n, 7) or np.shape(rest_lengths) != (n, settler.physics.n_cables):
        raise CrosscheckError(
            f"poses and rest_lengths: expected (n, 7) and (n, {settler.physics.n_cables}), "
            f"got {poses.shape} and {np.shape(rest_lengths)}"
        )
    rows = zip(poses, np.asarray(rest_lengths, dtype=float), strict=True)
    return SettlingBatch(settler.settle(pose, rest) for pose, rest in rows)


def _result(
    physics: Physics, rest: Rest, polished: Polished, settled_pose: Array, nudges: int
) -> Settling:
    status = _judge(physics, polished)
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
        settled_pose=settled_pose,
        rounding=physics.rounding(),
        rest=rest,
        polished=polished,
        nudges=nudges,
    )


def _judge(physics: Physics, polished: Polished) -> SettleStatus:
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
    m, nan = physics.n_cables, np.nan
    return Settling(
        status=status or rest.status,
        pose=np.full(7, nan),
        qpos=np.full(physics.model.nq, nan),
        tensions=np.full(m, nan),
        slack=np.zeros(m, dtype=bool),
        energy=nan,
        settled_pose=np.full(7, nan),
        rounding=physics.rounding(),
        rest=rest,
        polished=polished or Polished(nan, 0, nan, nan, nan, np.full(0, nan), nan, 0.0),
        nudges=nudges,
    )
