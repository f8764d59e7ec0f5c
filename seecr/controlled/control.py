"""Controllers that believe one robot and turn the winches of another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seecr.arguments import finite, silent, whole
from seecr.controlled.belief import Belief, TensionLimits, readings_by_told
from seecr.controlled.loop import Loop, Tuning, largest_gain, run, spectral_radius
from seecr.controlled.plant import Plant, SensorNoise
from seecr.controlled.result import Control, Controlled
from seecr.controlled.schemes import READS, Scheme
from seecr.counted import counted, some
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.base import unfed
from seecr.errors import InputError
from seecr.prediction.experiment import effects_of
from seecr.statics.starts import Commanded, commands_from
from seecr.tensions.distribution import tension_limits

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects

_EXACT = SensorNoise()


def control(
    robot: GivenRobot,
    poses: Commanded,
    *,
    scheme: str | Scheme | Sequence[str | Scheme] = ("geometric", "elastic"),
    believes: GivenEffects = (),
    true: GivenEffects = (),
    gain: float = 0.5,
    rate: float = 10.0,
    delay: float = 0.0,
    steps: int = 200,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    aim: str | ArrayLike = "minimum",
    prefer: str = "pose",
    stiff: str = "least",
    holding: Sequence[str] | None = None,
    any_orientation: bool = False,
    reads: Sequence[str] = READS,
    noise: SensorNoise = _EXACT,
    unstable: bool = False,
    progress: Callable[[str], object] = silent,
) -> Control:
    """What a robot does under schemes of control whose model of it may be wrong.

    Quasi-static: at each step the winches turn, the true robot comes to rest, with its history, and
    its sensors read. A feedback is linearised about where it settles: it does if the spectral
    radius is below one.

    Args:
        robot: as described, or its MJCF.
        poses: (n, 7) wanted, or :class:`seecr.Commands`, or ``crosscheck.Measurements``.
        scheme: "geometric", "elastic", "stiffness", "pose_feedback", "tension_feedback", sums such
            as "elastic+pose_feedback", or several of them; or :class:`Scheme` of one's own.
        believes: what the controller knows of the robot: a model, its file, or effects with values.
        true: the same of what the robot really is.
        gain: of the feedbacks; one takes away a whole error at once where the model is right.
        rate: [Hz] of the sensors. delay: [s] until a reading is used, rounded up to whole steps.
        steps: most steps of a loop at each pose.
        lowest, highest, aim, prefer: of tensions and of poses that cannot be held, as of
            :func:`seecr.correct`; which tensions are within the limits is told of every scheme.
        stiff: for "stiffness", "least", or "x", "y", "z", "rx", "ry" or "rz" for the stiffness
            against a force or moment along one axis.
        holding: names of the winches that hold tensions in "tension_feedback"; all by default.
        any_orientation: positions alone are wanted, see :func:`seecr.correct`; orientations are
            then not fed back.
        reads: what the robot's sensors read.
        noise: of these readings.
        unstable: also run loops that hold nowhere, to see what they do.
        progress: called with the name of each scheme when it is done.

    Returns:
        of each scheme errors [m, rad], tensions [N] and winch travel [m] at n poses, and whether
        its loop settles. Some ms per pose and scheme.

    Raises:
        InputError: an unknown scheme, one that needs other readings, a gain or delay that holds
            nowhere even where the model is right, winches that hold tensions and leave the
            platform free, or a robot without winches.

    Example:
        ``seecr.control(robot, poses, scheme="elastic+pose_feedback", steps=5).schemes``
    """
    robot = robot_of(robot)
    commands = commands_from(poses, robot)
    if commands.lengths is not None:
        raise InputError("control needs wanted poses (n, 7); got lengths")
    many = [scheme] if isinstance(scheme, str | Scheme) else list(scheme)
    schemes = [Scheme.named(one) if isinstance(one, str) else one for one in many]
    if not schemes:
        raise InputError("control needs a scheme; got none")
    ends = tension_limits(robot, lowest, highest)
    held_by = _winches(robot, holding)
    limits = TensionLimits(lowest, highest, aim, stiff, held_by, any_orientation, prefer)
    belief = Belief(robot, effects_of(believes, robot), commands, limits)
    acting = effects_of(true, robot)
    reads = [kind for kind in reads if not (any_orientation and kind == "orientation")]
    tuning = _tuning(gain, rate, delay, steps, reads)
    for one in schemes:
        one.check(belief, reads)
        if one.feedbacks and not unstable:
            _check_holds(one, belief, tuning)
    results: dict[str, Controlled] = {}
    for one in schemes:
        plant = Plant(robot, acting, commands, noise)
        course = run(one, belief, plant, tuning)
        seen = belief.rests_at(course.told), plant.read(course.solution)
        results[one.name] = Controlled.of(one, course, seen, ends, tuning)
        progress(one.name)
    both = {effect.name: effect for effect in (*belief.effects, *acting)}
    return Control(robot, results, tuple(schemes), belief, tuning, unfed(both.values(), commands))


def _winches(robot: Robot, names: Sequence[str] | None) -> tuple[int, ...] | None:
    """Indices of cables by name."""
    if names is None:
        return None
    known = [name for name in robot.cable_names if name not in robot.passive_names]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        raise InputError(
            f"tension_feedback: expected cables of {robot.name} that hold tensions, of "
            f"{some(known, len(known))}; got {some(unknown) or 'none'}"
        )
    return tuple(sorted({robot.cable_names.index(name) for name in names}))


def _tuning(gain: float, rate: float, delay: float, steps: int, reads: Sequence[str]) -> Tuning:
    """The checked numbers of a feedback."""
    for name, value, unit in (("gain", gain, ""), ("rate", rate, " [Hz]")):
        if not float(finite(value, name)) > 0.0:
            raise InputError(f"{name}: expected a number above 0{unit}, got {value:g}")
    if not float(finite(delay, "delay")) >= 0.0:
        raise InputError(f"delay: expected a number from 0 on [s], got {delay:g}")
    unknown = [one for one in reads if one not in READS]
    if unknown:
        raise InputError(f"reads: expected some of {some(READS)}, got {some(unknown)}")
    # a delay of exactly so many periods is not one more by rounding
    late = int(np.ceil(delay * rate - 1e-9))
    seen = [kind in reads for kind in READS[:2] for _ in range(3)]
    return Tuning(float(gain), late, whole(steps, "steps", 1), tuple(seen))


def _check_holds(scheme: Scheme, belief: Belief, tuning: Tuning) -> None:
    """That the scheme's loop holds at some pose of the believed robot, if that holds any.

    Raises:
        InputError: it holds nowhere, or its winches leave the platform free.
    """
    rows = np.flatnonzero(belief.correction.held & belief.held.solved)
    if len(rows) == 0:
        return
    loop = Loop(scheme, belief, tuning)
    by_told = readings_by_told(belief.robot, belief.effects, belief.held)[rows]
    values = loop.eigenvalues(by_told, rows, loop.rest)
    radii = np.array([spectral_radius(one, tuning.gain, tuning.delay) for one in values])
    if not np.any(radii < 1.0):
        gains = [largest_gain(one, tuning.delay) for one in values]
        raise InputError(_holds_nowhere(scheme, tuning, max(gains)))


def _holds_nowhere(scheme: Scheme, tuning: Tuning, most: float) -> str:
    late = f" and a delay of {counted(tuning.delay, 'step')}" if tuning.delay else ""
    return (
        f"scheme {scheme.name}: a gain of {tuning.gain:g}{late} holds at none of these poses, even "
        f"where the robot is as believed; expected a gain below {most:.3g}, or less delay"
    )
