"""Schemes of control: where MuJoCo comes to rest after slow commands, and where seecr says.

Each scheme moves a robot that is not as its controller believes from its reference pose to one near
it and holds it there, with lagging winches, damped cables and a tracker.
"""

from __future__ import annotations

import numpy as np

from crosscheck.controlled.control import Timing, control_in_time
from crosscheck.controlled.machine import Winches
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.pose import Array

SCHEMES = (
    "geometric", "elastic", "stiffness", "pose_feedback", "elastic+pose_feedback",
    "tension_feedback",
)  # fmt: skip
# Largest tension [weight], which the scheme stiffness needs.
_HIGHEST = 3.0
# Slow: a gain of 0.8 leaves 0.2 of an error per reading, and 24 of these nothing of a metre; the
# winches reach what they are told in a second, vibrations die out in half of one.
_TIMING, _WINCHES, _GAIN = Timing(speed=0.02, hold=16.0, rate=1.5), Winches(5.0, np.inf, 0.2), 0.8


def slow_control(robot: Robot, seed: int) -> tuple[Array, Array, Array]:
    """Poses (k, 7) in MuJoCo and of seecr, one for each scheme, and differences of tensions [N].

    The true robot's cables are softer by a tenth, and its platform is heavier by a twentieth.
    """
    random = np.random.default_rng([seed, len(SCHEMES)])
    wanted = robot.reference_pose.copy()
    wanted[:3] += 0.02 * robot.reach * random.uniform(-1.0, 1.0, 3)
    true = [
        Term.of(robot, "stiffness", factor=0.9),
        Term.of(robot, "platform_mass", added_kg=0.05 * robot.mass),
    ]
    found = control_in_time(
        robot, wanted, scheme=SCHEMES, true=true, winches=_WINCHES, timing=_TIMING, gain=_GAIN,
        highest=_HIGHEST * robot.weight,
    )  # fmt: skip
    there = [(one.trace, one.rest.solution) for one in found.schemes.values()]
    moved = np.array([trace.pose[-1] for trace, _ in there])
    rests = np.array([solution.pose[0] for _, solution in there])
    pulls = [np.abs(trace.tensions[-1] - solution.tensions[0]) for trace, solution in there]
    return moved, rests, np.max(pulls, axis=1)
