"""A scheme of control in MuJoCo, with time: from pose to pose, and feedback where it holds.

Between poses winches are told lengths that go evenly from those of the last pose to those that are
fed forward for the next. While the platform is held there, sensors are read at a rate, each reading
is used some periods later, and the controller is the one that seecr.control runs at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from crosscheck.controlled.machine import Machine
from seecr.arguments import silent
from seecr.controlled.belief import Belief
from seecr.controlled.loop import Loop, Tuning, can_be_told, loop_of
from seecr.controlled.plant import SensorNoise
from seecr.controlled.schemes import Scheme
from seecr.pose import Array, moved_by, pose_difference

# Samples of a trace in a period of the slowest vibration.
_SAMPLES = 12


@dataclass(frozen=True)
class Timing:
    """How fast it goes.

    Attributes:
        speed: [m/s] of the winch that turns most, between poses. hold: [s] at each pose.
        rate: [Hz] of the sensors.
    """

    speed: float = 0.05
    hold: float = 5.0
    rate: float = 10.0


@dataclass(eq=False)
class Trace:
    """What happened, at k instants.

    Attributes:
        t: (k,) [s]. row: (k,) of the pose that it goes to. held: (k,) whether it is held there.
        told, paid: (k, m) [m] told lengths, and what winches have reached of them. pose: (k, 7).
        read: (k, 7) what the tracker reads, but for noise. tensions: (k, m) [N].
        ends: index of the last instant of each pose.
        ticks: errors (j, 6 + m) of the j readings that a feedback got, for each pose.
        speeds: of each pose, the platform's in the end [m/s], rotations times the robot's length.
    """

    t: Array
    row: Array
    held: Array
    told: Array
    paid: Array
    pose: Array
    read: Array
    tensions: Array
    ends: Array
    ticks: list[Array]
    speeds: Array


@dataclass(eq=False)
class _Log:
    rows: list[tuple[object, ...]] = field(default_factory=list)

    def note(self, machine: Machine, t: float, row: int, held: bool, told: Array) -> None:
        seen = machine.read()[0]
        self.rows.append((t, row, held, told, machine.told, machine.pose, seen, machine.tensions))


def run_in_time(
    scheme: Scheme, belief: Belief, machine: Machine, tuning: Tuning, timing: Timing,
    noise: SensorNoise, tell: Callable[[int], object] = silent,
) -> Trace:  # fmt: skip
    """Move a machine from its reference pose through the wanted poses of a belief, in their order.

    Rows for which the scheme has no command are left out: the trace has none of them. It ends where
    the state is no longer finite.
    """
    commands, found = scheme.forward.commands(belief)
    told = belief.robot.rest_lengths + commands.change(belief.robot)
    loop = loop_of(scheme, belief, commands, tuning)
    random = np.random.default_rng(noise.seed)
    clock = _Clock(machine, timing, _Log())
    ends, ticks, speeds, at = [], [], [], machine.told.copy()
    for row in np.flatnonzero(found).tolist():
        first = told[row] if loop is None else told[row] + loop.change(loop.start)[row]
        clock.move(row, at, first)
        at = first
        if loop is None:
            clock.hold(row, at, timing.hold)
            ticks.append(np.zeros((0, 6 + len(at))))
        else:
            at, errors = _fed_back(loop, clock, row, told[row], random, noise)
            ticks.append(errors)
        ends.append(len(clock.log.rows) - 1)
        speeds.append(machine.speed)
        tell(1)
        if not np.isfinite(machine.data.qpos).all():
            break
    parts = [np.array(part) for part in zip(*clock.log.rows, strict=True)]
    t, which, held, said, paid, pose, seen, pulls = parts
    last = np.array(ends), ticks, np.array(speeds)
    return Trace(t, which, held, said, paid, pose, seen, pulls, *last)


def _fed_back(
    loop: Loop, clock: _Clock, row: int, forward: Array, random: np.random.Generator,
    noise: SensorNoise,
) -> tuple[Array, Array]:  # fmt: skip
    """The last told lengths (m,), and the errors (k, 6 + m) read while a pose is held."""
    state, rows, errors = loop.start.copy(), np.array([row]), []
    tuning, timing = loop.tuning, clock.timing
    size = noise.of(len(forward))
    told = forward + loop.change(state)[row]
    for _ in range(max(1, round(timing.hold * timing.rate))):
        clock.hold(row, told, 1.0 / timing.rate)
        pose, pulls = clock.machine.read()
        off = random.normal(size=len(size)) * size
        pose = moved_by(pose[None], off[None, :6])
        if not np.isfinite(pose).all():
            break
        errors.append(loop.error((pose, pulls[None] + off[None, 6:]), rows)[0])
        if len(errors) > tuning.delay:
            state[row] -= tuning.gain * (loop.gains[row] @ errors[-1 - tuning.delay])
            further = forward + loop.change(state)[row]
            if not can_be_told(loop.belief.robot, further[None])[0]:
                break
            told = further
    return told, np.array(errors)


class _Clock:
    """A machine whose time passes, and what is noted of it."""

    def __init__(self, machine: Machine, timing: Timing, log: _Log) -> None:
        self.machine, self.timing, self.log, self.t = machine, timing, log, 0.0
        machine.settle()
        self.frame = min(machine.period / _SAMPLES, 1.0 / timing.rate)

    def move(self, row: int, before: Array, after: Array) -> None:
        """Go evenly from told lengths (m,) [m] to others."""
        seconds = float(np.abs(after - before).max()) / self.timing.speed
        frames = max(1, int(np.ceil(seconds / self.frame)))
        for k in range(frames):
            self._pass(row, False, before + (k + 1) / frames * (after - before), seconds / frames)

    def hold(self, row: int, told: Array, seconds: float) -> None:
        """Stay at told lengths."""
        frames = max(1, round(seconds / self.frame))
        for _ in range(frames):
            self._pass(row, True, told, seconds / frames)

    def _pass(self, row: int, held: bool, told: Array, seconds: float) -> None:
        self.machine.go(told, seconds)
        self.t += seconds
        self.log.note(self.machine, self.t, row, held, told)


def ring(machine: Machine, pose: Array, told: Array, shape: Array, size: float = 1e-5) -> float:
    """The frequency [Hz] at which the platform swings that is let go beside where it rests.

    It is that of passes through the middle, without damping, over ten periods.

    Args:
        machine: whose damping is none. pose: (7,) at rest with told lengths (m,) [m].
        shape: (6,) [m, rad] the motion of a vibration. size: of the motion, relative to it.
    """
    machine.place(moved_by(pose[None], size * shape[None])[0], told)
    weight = np.concatenate([np.ones(3), np.full(3, machine.true.robot.length**2)])
    times, last = [], None
    for k in range(1, 40 * 64 * 64):
        machine.go(told, machine.step_s)
        now = float((weight * shape) @ pose_difference(machine.pose, pose))
        if last is not None and last < 0.0 <= now:
            times.append(machine.step_s * (k - now / (now - last)))
        last = now
        if len(times) == 11:
            return float(10.0 / (times[-1] - times[0]))
    return float("nan")
