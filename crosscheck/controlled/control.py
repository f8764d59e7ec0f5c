"""Schemes of control on a robot that moves in MuJoCo: from pose to pose, with time.

Between poses winches are told lengths that go evenly from those of the last pose to those that are
fed forward for the next. While the platform is held there, sensors are read at a rate, each reading
is used some periods later, and the controller is the one that seecr.control runs at rest. Each run
of the commands begins anew, at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.controlled.machine import Machine, Winches
from crosscheck.controlled.result import TimedControl, TimedScheme, Trace
from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenModel, GivenRobot, robot_of
from seecr.arguments import finite, silent
from seecr.controlled.belief import Belief
from seecr.controlled.control import control
from seecr.controlled.loop import Loop, Tuning, can_be_told, loop_of
from seecr.controlled.plant import SensorNoise
from seecr.controlled.schemes import READS, Scheme
from seecr.pose import Array, moved_by
from seecr.prediction.experiment import effects_of
from seecr.statics.starts import Commanded

# Samples of a trace in a period of the slowest vibration.
_SAMPLES = 12


@dataclass(frozen=True)
class Timing:
    """How fast it goes.

    Attributes:
        speed: [m/s] of the rope that is wound fastest, between poses. hold: [s] at each pose.
        rate: [Hz] of the sensors.
    """

    speed: float = 0.05
    hold: float = 5.0
    rate: float = 10.0


_WINCHES, _TIMING, _EXACT = Winches(), Timing(), SensorNoise()


def control_in_time(
    robot: GivenRobot, poses: Commanded, *,
    scheme: str | Scheme | Sequence[str | Scheme] = ("geometric", "elastic"),
    true: GivenModel = (), winches: Winches = _WINCHES, timing: Timing = _TIMING,
    progress: Callable[[int], object] = silent, believes: GivenModel = (), gain: float = 0.5,
    delay: float = 0.0, lowest: ArrayLike = 0.0, highest: ArrayLike = np.inf,
    aim: str | ArrayLike = "minimum", prefer: str = "pose", stiff: str = "least",
    holding: Sequence[str] | None = None,
    any_orientation: bool = False, reads: Sequence[str] = READS, noise: SensorNoise = _EXACT,
    unstable: bool = False,
) -> TimedControl:  # fmt: skip
    """What :func:`seecr.control` does, in MuJoCo with time.

    Winches lag and are not infinitely fast, cables damp, the platform has inertia, and sensors read
    at a rate. Slow commands come to rest where seecr says; fast ones overshoot and vibrate.

    Args:
        robot: as described, or its MJCF.
        poses: (n, 7) wanted, visited in their order from the reference pose on, or each run of
            :class:`seecr.Commands` or ``crosscheck.Measurements`` anew from there.
        scheme, true, believes, gain, delay, lowest, highest, aim, prefer, stiff, holding,
            any_orientation, reads, noise, unstable: see :func:`seecr.control`; true effects must be
            of winches, geometry, stiffness, load or tracker.
        winches: their lag, their speed, and damping. timing: how fast it goes.
        progress: called with 1 after each pose.

    Returns:
        of each scheme the motion over time, and where it comes to rest. About as long as the motion
        itself takes.

    Raises:
        InputError: as :func:`seecr.control`. CrosscheckError: effects that are not simulated with
            time, known loads, or numbers that are none of a machine.

    Example:
        ``crosscheck.control_in_time("robot.xml", poses, scheme="geometric").schemes``
    """
    for name, value in (
        ("bandwidth", winches.bandwidth), ("damping", winches.damping), ("speed", timing.speed),
        ("hold", timing.hold), ("rate", timing.rate),
    ):  # fmt: skip
        if not float(finite(value, name)) > 0.0:
            raise CrosscheckError(f"{name}: expected a number above 0, got {value:g}")
    if not winches.speed > 0.0:
        raise CrosscheckError(f"winch speed: expected a number above 0, got {winches.speed:g}")
    robot = robot_of(robot)
    acting = effects_of(true, robot)
    Machine(robot, acting, winches)  # refuses what it cannot move before anything is solved
    rest = control(
        robot, poses, scheme=scheme, true=acting, believes=believes, gain=gain, rate=timing.rate,
        delay=delay, lowest=lowest, highest=highest, aim=aim, prefer=prefer, stiff=stiff,
        holding=holding,
        any_orientation=any_orientation, reads=reads, noise=noise, unstable=unstable,
    )  # fmt: skip
    if rest.belief.commands.loads is not None:
        raise CrosscheckError(
            "crosscheck control moves robots without known loads; leave these columns out, or add "
            "platform_mass or external_wrench to the true model"
        )
    found = {}
    for one in rest.asked:
        machine = Machine(robot, acting, winches)
        trace = run_in_time(one, rest.belief, machine, rest.tuning, timing, noise, progress)
        rows = np.array([int(trace.row[end]) for end in trace.ends], dtype=np.int64)
        rates = rest[one.name].solution.frequencies[rows]
        found[one.name] = TimedScheme(trace, rest[one.name], rows, machine.period, rates)
    return TimedControl(rest, found)


def run_in_time(
    scheme: Scheme, belief: Belief, machine: Machine, tuning: Tuning, timing: Timing,
    noise: SensorNoise, tell: Callable[[int], object] = silent,
) -> Trace:  # fmt: skip
    """Move a machine through the wanted poses of a belief, in their order, each run anew.

    A run starts at the reference pose, or at its first row if the commands say so. Rows for which
    the scheme has no command are left out: the trace has none of them, nor of those of a run after
    the state is no longer finite.
    """
    commands, found = scheme.forward.commands(belief)
    robot, wanted = belief.robot, belief.commands
    told = robot.rest_lengths + commands.change(robot)
    loop = loop_of(scheme, belief, commands, tuning)
    random = np.random.default_rng(noise.seed)
    clock = _Clock(machine, timing)
    ends, ticks, speeds, at = [], [], [], robot.rest_lengths
    run = np.cumsum(wanted.starts)
    stands = wanted.starts_here[wanted.starts] & (not scheme.from_home)
    begun, lost = 0, False
    for row in np.flatnonzero(found).tolist():
        first = told[row] if loop is None else told[row] + loop.change(loop.start)[row]
        if run[row] != begun:
            begun, lost = run[row], False
            here = stands[begun - 1]
            at = first if here else robot.rest_lengths
            clock.begin(wanted.pose[row] if here else robot.reference_pose, at)
        if lost:
            continue
        clock.move(row, at, first)
        at = first
        if loop is None:
            clock.hold(row, at, timing.hold)
            ticks.append(np.zeros((0, 6 + len(at))))
        else:
            at, errors = _fed_back(loop, clock, row, told[row], random, noise)
            ticks.append(errors)
        ends.append(len(clock.notes) - 1)
        speeds.append(machine.speed)
        tell(1)
        lost = not np.isfinite(machine.data.qpos).all()
    last = np.array(ends, dtype=np.int64)
    return Trace(**clock.noted(), ends=last, ticks=ticks, speeds=np.array(speeds))


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

    def __init__(self, machine: Machine, timing: Timing) -> None:
        self.machine, self.timing, self.t, self.frame = machine, timing, 0.0, np.nan
        self.notes: list[tuple[object, ...]] = []

    def begin(self, pose: Array, told: Array) -> None:
        """Put the platform where a pose (7,) and told lengths (m,) [m] lead, at rest."""
        self.machine.place(pose, told)
        self.machine.settle()
        self.frame = min(self.machine.period / _SAMPLES, 1.0 / self.timing.rate)

    def move(self, row: int, before: Array, after: Array) -> None:
        """Go evenly from told lengths (m,) [m] to others."""
        wound = self.machine.true.robot.falls * np.abs(after - before)
        seconds = float(wound.max()) / self.timing.speed
        frames = max(1, int(np.ceil(seconds / self.frame)))
        for k in range(frames):
            self._pass(row, False, before + (k + 1) / frames * (after - before), seconds / frames)

    def hold(self, row: int, told: Array, seconds: float) -> None:
        """Stay at told lengths."""
        frames = max(1, round(seconds / self.frame))
        for _ in range(frames):
            self._pass(row, True, told, seconds / frames)

    def _pass(self, row: int, held: bool, told: Array, seconds: float) -> None:
        machine = self.machine
        machine.go(told, seconds)
        self.t += seconds
        seen = machine.read()[0]
        moment = self.t, row, held, told, machine.told, machine.pose, seen, machine.tensions
        self.notes.append(moment)

    def noted(self) -> dict[str, Any]:
        """The columns of a trace, also where nothing has happened."""
        n, m = len(self.notes), len(self.machine.told)
        shapes: dict[str, Any] = {
            "t": (float,), "row": (np.int64,), "held": (bool,), "told": (float, m),
            "paid": (float, m), "pose": (float, 7), "read": (float, 7), "tensions": (float, m),
        }  # fmt: skip
        return {
            name: np.array([note[k] for note in self.notes], dtype=dtype).reshape(n, *width)
            for k, (name, (dtype, *width)) in enumerate(shapes.items())
        }
