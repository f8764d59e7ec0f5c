"""A cable robot brought to rest by MuJoCo: an answer that shares nothing with seecr's statics.

In stage 1 (dynamic relaxation) the platform moves from the commanded pose by its own
dynamics until it rests, which shows that the equilibrium is stable and reached from there. Stage 2
(:mod:`crosscheck.settle.newton`) adds digits without leaving that equilibrium. Both are reported.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.settle.newton import Polished, polish
from crosscheck.settle.physics import Physics
from seecr.description.mjcf import quiet_mujoco
from seecr.pose import Array
from seecr.result import Record

# Stage 1 of a settling: MuJoCo's own dynamics with kinetic damping.
#
# The platform moves freely; whenever its kinetic energy has passed a peak it is stopped, and
# starts again from there (dynamic relaxation with kinetic damping: Day 1965, Cundall 1976). Each
# stop removes energy, so it ends in a minimum of it: a stable equilibrium. If there are several,
# the time step also influences which one: between stops the integrator conserves energy only
# approximately.
#
# The integrator is MuJoCo's `discrete`, implicit in the springs. So the time step need not resolve
# the cables' vibrations, only the swinging under the load.

Observer = Callable[[Physics], None]

# Time step over the robot's characteristic time sqrt(length m/F). On the DemoBot (0.4 kg, 0.058 m)
# these are 5 ms and 2 ms, the second for cables stiffer than 5e4 N/m, as measured there. In this
# form the same numbers hold for robots of any size, mass and load.
_TIME_STEP = 0.065
_TIME_STEP_STIFF = 0.026
_STIFF = 740.0
# A platform with little inertia in rotation swings faster than it travels.
_TIME_STEP_ROTATION = 0.3
# MuJoCo's implicit step treats the smallest forces as zero. If nothing moves at all, this relative
# residual counts as rest; above it the time step is halved, which makes MuJoCo notice smaller
# forces.
_AT_REST = 1e-7
# Number of peaks of kinetic energy without the residual force halving, after which the time step is
# halved: nearly rigid cables can alternate for ever between slack and taut at a long time step.
_PATIENCE = 40
_SHORTEST = 1e-4
# Steps between checks that need not be made at each step.
_STRIDE = 64
# After a state that is not finite, the run is repeated with shorter time steps.
_RETRIES = 3
_SHORTER = 8.0
# A platform that travels this many times the robot's size counts as fallen.
_FALL = 10.0


class SettleStatus(Enum):
    """How a settling ended; the value is the sentence that people read."""

    SETTLED = "MuJoCo came to rest in a stable equilibrium"
    DIVERGED = "MuJoCo's state became infinite or not a number, even with shorter time steps"
    TIME_LIMIT = "MuJoCo had not come to rest after the allowed number of steps"
    FELL = "nothing holds the platform: in MuJoCo it moved away by over ten times the robot's size"
    UNSTABLE = "MuJoCo repeatedly stopped at an unstable equilibrium, although pushed off it"
    POLISH_MOVED = "the polish left the equilibrium in which MuJoCo had come to rest"
    POLISH_STALLED = "the polish could not balance the forces down to rounding"


@dataclass(frozen=True)
class Rest:
    """Result of stage 1; the physics is left in its last state.

    Attributes:
        status: SETTLED, DIVERGED, TIME_LIMIT or FELL.
        residual: residual force relative to the load in that state, without velocity.
        steps: of MuJoCo, retries included.
        simulated_s: simulated time [s], retries included.
        time_step: the last [s].
        wall_s: time taken [s].
    """

    status: SettleStatus
    residual: float
    steps: int
    simulated_s: float
    time_step: float
    wall_s: float

    def after(self, first: Rest) -> Rest:
        """This result, with the cost of an earlier one added."""
        return replace(
            self,
            steps=self.steps + first.steps,
            simulated_s=self.simulated_s + first.simulated_s,
            wall_s=self.wall_s + first.wall_s,
        )


def time_step(physics: Physics) -> float:
    """Time step [s] for the robot, its load and its cables as they are set and placed."""
    load = max(physics.force_scale, float(np.sum(physics.tensions())))
    # Inertia of each coordinate, as a mass at the robot's length.
    mass = physics.inertia / physics.metre**2
    swing = float(np.sqrt(physics.length * physics.mass / load))
    turning = np.min(mass[physics.rotations], initial=np.inf)
    spin = float(np.sqrt(physics.length * turning / load))
    stiff = float(np.max(physics.stiffness)) * physics.length > _STIFF * load
    return min((_TIME_STEP_STIFF if stiff else _TIME_STEP) * swing, _TIME_STEP_ROTATION * spin)


@quiet_mujoco()
def come_to_rest(
    physics: Physics, tolerance: float, max_steps: int, observe: Observer | None = None
) -> Rest:
    """Let the platform move from where it is placed until it rests.

    Args:
        physics: robot, cables and load set, platform placed.
        tolerance: residual force relative to the load at which it rests.
        max_steps: after which to give up.
        observe: called after each step.
    """
    began = time.perf_counter()
    start = physics.data.qpos.copy()
    rest = Rest(SettleStatus.DIVERGED, np.nan, 0, 0.0, time_step(physics), 0.0)
    for retry in range(1 + _RETRIES):
        physics.model.opt.timestep = rest.time_step / (_SHORTER if retry else 1.0)
        physics.data.qpos[:] = start
        physics.data.qvel[:] = 0.0
        physics.data.time = 0.0
        before = rest
        status, residual, steps = _run(physics, tolerance, max_steps - before.steps, observe)
        data, wall = physics.data, time.perf_counter() - began
        simulated = before.simulated_s + float(data.time)
        step = float(physics.model.opt.timestep)
        rest = Rest(status, residual, before.steps + steps, simulated, step, wall)
        if status is not SettleStatus.DIVERGED:
            break
    return rest


def _run(
    physics: Physics, tolerance: float, max_steps: int, observe: Observer | None
) -> tuple[SettleStatus, float, int]:
    data, velocity, force = physics.data, physics.data.qvel, physics.data.qfrc_smooth
    unit, shortest = physics.mass_unit, _SHORTEST * physics.model.opt.timestep
    energy, options = physics.data.energy, physics.model.opt
    advance = _advance(physics)
    far = _fall_distance(physics)
    start = data.xpos[physics.body].copy()
    last, best, stalled = 0.0, np.inf, 0
    for step in range(1, max_steps + 1):
        advance()
        kinetic = energy[1]
        if observe is not None:
            observe(physics)
        if kinetic < last:
            velocity[:] = 0.0
            last = 0.0
            size = physics.relative(unit * force)
            # The step has moved on from where this force was: only the state that it left counts.
            if size < tolerance and (size := physics.relative(physics.residual())) < tolerance:
                return SettleStatus.SETTLED, size, step
            best, stalled = (size, 0) if size < 0.5 * best else (best, stalled + 1)
            if stalled == _PATIENCE:
                options.timestep = max(0.5 * options.timestep, shortest)
                best, stalled = size, 0
        elif kinetic > 0.0 or velocity.any():
            last = kinetic
        else:
            size = physics.relative(physics.residual())
            if size < max(tolerance, _AT_REST):
                return SettleStatus.SETTLED, size, step
            options.timestep = max(0.5 * options.timestep, shortest)
        if step % _STRIDE == 0:
            if not np.isfinite(data.qpos).all():
                return SettleStatus.DIVERGED, np.nan, step
            if np.linalg.norm(data.xpos[physics.body] - start) > far:
                return SettleStatus.FELL, physics.relative(physics.residual()), step
    if not np.isfinite(data.qpos).all():
        return SettleStatus.DIVERGED, np.nan, max_steps
    return SettleStatus.TIME_LIMIT, physics.relative(physics.residual()), max_steps


def _advance(physics: Physics) -> Callable[[], None]:
    """One MuJoCo step; forces such as a wrench are applied at the pose of that step."""
    model, data = physics.model, physics.data
    data.qfrc_applied[:] = 0.0
    if not physics.steers:
        step = mujoco.mj_step
        return lambda: step(model, data)

    def advance() -> None:
        mujoco.mj_step1(model, data)
        physics.push()
        mujoco.mj_step2(model, data)

    return advance


def _fall_distance(physics: Physics) -> float:
    """Distance [m] from the start beyond which the platform counts as fallen.

    The distance to the farthest exit point is the robot's size, stretched as if the softest cable
    carried the load alone.
    """
    ea = physics.stiffness * physics.rest_lengths
    exits = physics.exit_points() - physics.data.xpos[physics.body]
    size = float(np.max(np.linalg.norm(exits, axis=-1)))
    return _FALL * size * (1.0 + physics.force_scale / float(np.min(ea[ea > 0.0], initial=np.inf)))


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
        passive: Sequence[str] = (),
    ) -> None:
        """Compile the robot.

        Args:
            source: MJCF file, or a model compiled from one (it is copied).
            ea: (m,) or one number [N], of the driven cables; None takes stiffness times rest length
                of the MJCF.
            tolerance: of stage 1; rounding of very stiff cables may raise it.
            max_steps: after which stage 1 gives up.
            passive: names of lines that no winch drives, besides those that the file names.

        Raises:
            InputFileError: the file is not one platform on cables.
        """
        self.physics = Physics.of(source, passive)
        own = self.physics.stiffness * self.physics.rest_lengths
        of_all = ea is not None and np.ndim(ea) > 0
        given = np.array(np.broadcast_to(own if ea is None else ea, own.shape), dtype=float)
        self.ea = given if of_all else np.where(self.physics.driven, given, own)
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
    physics: Physics,
    rest: Rest,
    nudges: int,
    polished: Polished | None = None,
    settled_pose: Array | None = None,
) -> Settling:
    """The settling in the physics' present state; without numbers unless it is an answer."""
    nan = np.nan
    status = rest.status if polished is None else _judge(physics, polished)
    fine = status is SettleStatus.SETTLED

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
        settled_pose=np.full(7, nan) if settled_pose is None else known(settled_pose),
        rounding=physics.rounding(),
        rest=rest,
        polished=polished or Polished(nan, 0, nan, nan, nan, np.full(0, nan), nan, 0.0),
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
