"""MuJoCo's own dynamics with kinetic damping.

The platform moves freely; whenever its kinetic energy has passed a peak it is stopped, and
starts again from there (dynamic relaxation with kinetic damping: Day 1965, Cundall 1976). Each
stop removes energy, so it ends in a minimum of it: a stable equilibrium. If there are several,
the time step also influences which one: between stops the integrator conserves energy only
approximately.

The integrator is MuJoCo's `discrete`, implicit in the springs. So the time step need not resolve
the cables' vibrations, only the swinging under the load.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import mujoco
import numpy as np

from crosscheck.settle.physics import Physics
from seecr.description.mjcf import quiet_mujoco

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
        wall_s: time taken [s].
    """

    status: SettleStatus
    residual: float
    steps: int
    simulated_s: float
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
    began, start, steps, simulated = time.perf_counter(), physics.data.qpos.copy(), 0, 0.0
    physics.model.opt.timestep = time_step(physics)
    for _retry in range(1 + _RETRIES):
        physics.data.qpos[:] = start
        physics.data.qvel[:] = 0.0
        physics.data.time = 0.0
        status, residual, more = _run(physics, tolerance, max_steps - steps, observe)
        steps, simulated = steps + more, simulated + float(physics.data.time)
        if status is not SettleStatus.DIVERGED:
            break
        physics.model.opt.timestep /= _SHORTER
    return Rest(status, residual, steps, simulated, time.perf_counter() - began)


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
