"""Schemes of control on a robot that moves in MuJoCo."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.controlled.machine import Machine, Winches
from crosscheck.controlled.result import TimedControl, TimedScheme
from crosscheck.controlled.timed import Timing, run_in_time
from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenModel, GivenRobot, robot_of
from seecr.arguments import finite, silent
from seecr.controlled.control import check_all_driven, control
from seecr.controlled.plant import SensorNoise
from seecr.controlled.schemes import READS, Scheme
from seecr.prediction.experiment import effects_of
from seecr.statics.starts import Commanded

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
        poses: (n, 7) wanted, visited in their order from the reference pose on.
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
    check_all_driven(robot)
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
