"""Effects of users' own in a twin, by their own law: MuJoCo has no means for what nobody foretold.

MuJoCo brings the robot to rest with all other hidden effects. What an own effect adds is the
difference that its law makes in SEECR's prediction, with the same other effects on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.twin.measure import Truth
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.pose import Array, quat_conjugate, quat_multiply
from seecr.prediction.experiment import predict


def simulated(effects: Sequence[Effect]) -> tuple[list[Effect], list[Effect]]:
    """Effects that MuJoCo simulates, and those that act by their own law."""
    own = [effect for effect in effects if effect.name not in TRUE_EFFECTS]
    return [effect for effect in effects if effect not in own], own


def with_laws(
    truth: Truth, robot: Robot, commands: Commands, known: Sequence[Effect], own: Sequence[Effect]
) -> Truth:
    """MuJoCo's answers with ``known`` effects, and what own ones change in them."""
    before = predict(robot, commands, known)
    after = predict(robot, commands, [*known, *own])
    was, now = before.readings, after.readings
    there = np.hstack([truth.position, truth.quat_wxyz])
    poses = (np.hstack([one.position, one.quat_wxyz]) for one in (was, now))
    read = _moved(there, *poses)
    return replace(
        truth,
        pose=_moved(truth.pose, before.pose, after.pose),
        tensions=truth.tensions + after.tensions - before.tensions,
        at_rest=truth.at_rest & before.solved & after.solved,
        position=read[:, :3],
        quat_wxyz=read[:, 3:],
        tension_readings=truth.tension_readings + now.tensions - was.tensions,
    )


def _moved(poses: Array, before: Array, after: Array) -> Array:
    """Poses (n, 7) shifted and turned in the base frame as others are from before to after."""
    turn = quat_multiply(after[:, 3:], quat_conjugate(before[:, 3:]))
    place = poses[:, :3] + after[:, :3] - before[:, :3]
    return np.hstack([place, quat_multiply(turn, poses[:, 3:])])
