"""A cable robot brought to rest by MuJoCo: an answer that shares nothing with seecr's statics.

In stage 1 (:mod:`crosscheck.settle.relaxation`) the platform moves from the commanded pose by its
own dynamics until it rests, which shows that the equilibrium is stable and reached from there.
Stage 2 (:mod:`crosscheck.settle.newton`) adds digits without leaving that equilibrium. Both are
reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.settle.newton import Polished, polish
from crosscheck.settle.physics import Physics
from crosscheck.settle.relaxation import Observer, Rest, SettleStatus, come_to_rest
from seecr.description.mjcf import quiet_mujoco
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply, quat_rotate
from seecr.result import Record

# Largest relative residual after the polish, unless rounding alone leaves more.
_POLISHED = 1e-9
# A polish that moves the platform by more than this, in lengths, has gone to another equilibrium.
_MOVED = 1e-2
# Points checked between two poses that a free motion should join.
_STATIONS = 9
# A screw whose rotation [rad] is smaller is a translation to rounding, and its axis is undefined.
_STRAIGHT = 1e-7
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
        residual: residual force after the polish relative to the load (torques over length).
        settled_pose: (7,) after stage 1 alone.
        settled_residual: as ``residual``, after stage 1 alone; also given on failure.
        rounding: the relative residual due to rounding alone.
        smallest_eigenvalue: of the stiffness [N/m]; at or below ``neutral``, which is rounding, the
            platform may move freely.
        moved_m: distance [m] by which the polish moved it.
        steps, simulated_s: of MuJoCo in stage 1, and their time [s].
        settle_s, polish_s: [s] that both stages took.
        nudges: how often the platform was pushed off an unstable equilibrium.
    """

    status: SettleStatus
    pose: Array
    qpos: Array
    tensions: Array
    slack: NDArray[np.bool_]
    energy: float
    residual: float
    settled_pose: Array
    settled_residual: float
    rounding: float
    smallest_eigenvalue: float
    neutral: float
    moved_m: float
    steps: int
    simulated_s: float
    settle_s: float
    polish_s: float
    nudges: int

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


class SettlingBatch(tuple[Settling, ...]):
    """Settlings in the order of their poses; any attribute of one, stacked: ``batch.pose``.

    ``batch.pose`` is (n, 7), ``batch.tensions`` (n, m), ``batch.status`` (n,) of
    :class:`SettleStatus`, ``batch.settled`` (n,) bool, and so on.
    """

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        known = name in Settling.__dataclass_fields__ or hasattr(Settling, name)
        if name.startswith("_") or not known:
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


class Settler:
    """A robot that settles in MuJoCo, pose after pose; not thread-safe.

    Attributes:
        physics: the robot in MuJoCo.
        ea: (m,) [N] k_c = E S of each cable.
        tolerance: residual force, relative to the load, at which stage 1 ends.
        max_steps: of MuJoCo in stage 1.
        home, pretension: (m,) [m] rest lengths of the MJCF, and what they are longer than the
            straight lengths at its reference.
    """

    def __init__(
        self, path: str | Path, *, ea: Array | float | None = None, tolerance: float = 1e-8,
        max_steps: int = 40_000, passive: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Compile the robot.

        Args:
            path: MJCF file.
            ea: (m,) or one number [N], of the driven cables; None takes stiffness times rest length
                of the MJCF.
            tolerance: of stage 1; rounding of very stiff cables may raise it.
            max_steps: after which stage 1 gives up.
            passive: names of lines that no winch drives, besides those that the file names.

        Raises:
            InputError, RobotError, InputFileError: the file is not one platform on cables.
        """
        physics = self.physics = Physics.of(path, passive)
        own = physics.stiffness * physics.rest_lengths
        of_all = ea is not None and np.ndim(ea) > 0
        given = np.array(np.broadcast_to(own if ea is None else ea, own.shape), dtype=float)
        self.ea = given if of_all else np.where(physics.driven, given, own)
        self.tolerance, self.max_steps = tolerance, max_steps
        # the compiled model stands at its reference pose, its springs still as in the file
        self.home = physics.rest_lengths.copy()
        self.pretension = self.home - physics.data.ten_length

    def paid_out(self, poses: Array) -> Array:
        """Lengths (n, m) [m] paid out for commanded poses (n, 7), from MuJoCo's kinematics.

        Those of passive lines are as in the MJCF.
        """
        physics = self.physics
        lengths = np.empty((len(poses), physics.n_cables))
        for i, pose in enumerate(poses):
            physics.place(pose)
            lengths[i] = physics.data.ten_length
        return np.where(physics.driven, lengths + self.pretension, self.home)

    @quiet_mujoco()
    def settle(
        self, pose: Array, rest_lengths: Array, *, observe: Observer | None = None
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
                return _result(physics, rest, nudges)
            settled_pose = physics.pose()
            polished = polish(physics)
            if not polished.unstable or nudges == _NUDGES:
                break
            physics.move(_NUDGE * physics.length * polished.softest / physics.metre)
            physics.update()
            rest = self._rest(observe).after(rest)
        return _result(physics, rest, nudges, polished, settled_pose)

    @quiet_mujoco()
    def energy(self, pose: Array, rest_lengths: Array) -> float:
        """Potential energy [J] in MuJoCo at a pose (7,), see :meth:`Physics.energy`."""
        self._prepare(pose, rest_lengths)
        return self.physics.energy()

    def imbalance_between(self, pose_a: Array, pose_b: Array, rest_lengths: Array) -> float:
        """Largest residual force, relative to the load, on the screw motion from pose a to pose b.

        Zero up to rounding means that the platform is free to move from one to the other.
        """
        sizes = []
        for pose in screw_motion(pose_a, pose_b, _STATIONS):
            self._prepare(pose, rest_lengths)
            sizes.append(self.physics.relative(self.physics.residual()))
        return max(sizes)

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
    physics: Physics, rest: Rest, nudges: int, polished: Polished | None = None,
    settled_pose: Array | None = None,
) -> Settling:  # fmt: skip
    """The settling in the physics' present state; without numbers unless it is an answer."""
    status = rest.status if polished is None else _judge(physics, polished)
    fine, nan = status is SettleStatus.SETTLED, np.nan
    last = polished or Polished(nan, nan, nan, nan, np.full(0, nan), nan, 0.0)

    def known(values: Array) -> Array:
        return values.copy() if fine else np.full_like(values, nan)

    tensions = physics.tensions()
    return Settling(
        status=status,
        pose=known(physics.pose()),
        qpos=known(physics.data.qpos),
        tensions=known(tensions),
        slack=(tensions == 0.0) & fine,
        energy=physics.energy() if fine else nan,
        residual=last.residual,
        settled_pose=np.full(7, nan) if settled_pose is None else known(settled_pose),
        settled_residual=rest.residual,
        rounding=physics.rounding(),
        smallest_eigenvalue=last.smallest_eigenvalue,
        neutral=last.neutral,
        moved_m=last.moved_m,
        steps=rest.steps,
        simulated_s=rest.simulated_s,
        settle_s=rest.wall_s,
        polish_s=last.wall_s,
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


def screw_motion(pose_a: Array, pose_b: Array, k: int) -> Array:
    """Poses (k, 7) from pose a to pose b along the one screw that joins them (Chasles).

    Unlike separate interpolation of position and orientation, it is a rotation about a fixed axis
    if such a rotation leads from a to b.
    """
    change = pose_difference(pose_b, pose_a)
    shift, turn = change[:3], change[3:]
    angle = float(np.linalg.norm(turn))
    part = np.linspace(0.0, 1.0, k)[:, None]
    quats = quat_from_rotvec(part * turn)
    along, arm = shift, np.zeros(3)
    if angle > _STRAIGHT:
        axis = turn / angle
        along = (shift @ axis) * axis
        across = shift - along
        # From the axis to the platform: half the chord back, and sideways by the cotangent.
        arm = -0.5 * (across + np.cross(axis, across) / np.tan(0.5 * angle))
    positions = pose_a[:3] + part * along + quat_rotate(quats, arm) - arm
    turned = quat_multiply(quats, pose_a[3:])
    return np.concatenate([positions, turned], axis=1)
