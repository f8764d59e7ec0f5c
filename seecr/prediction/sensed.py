"""From the platform's pose to what its tracker reads, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from seecr.commands import Commands
from seecr.description.joints import reachable
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.errors import InputError
from seecr.pose import Array, pose_add, pose_difference
from seecr.prediction.experiment import Experiment, effects_of
from seecr.statics.starts import Commanded, commands_from

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects

__all__ = ["placed", "tracked"]

# Most rounds of the search for a pose, and how exactly it must be read as wanted [m, rad].
_ROUNDS, _READ = 50, 1e-12


def tracked(robot: GivenRobot, commands: Commanded, effects: GivenEffects) -> Array:
    """Poses (n, 7) that a model's tracker reads when the platform is at the commanded poses.

    Args:
        robot: as described, or its MJCF.
        commands: poses (n, 7), or what has poses.
        effects: a model, its file, or effects with values.

    Raises:
        InputError: poses, robot or effects of a wrong type or shape.
    """
    robot = robot_of(robot)
    return _tracked(robot, commands_from(commands, robot), effects_of(effects, robot))


def placed(robot: GivenRobot, commands: Commanded, effects: GivenEffects) -> Commands:
    """Commands at whose poses a model's tracker reads the poses of ``commands``.

    These are what :func:`seecr.correct` takes to bring the platform to where its tracker reads the
    wanted poses, as ``seecr correct --as-read`` does.

    How a calibration shares an error between tracker and robot hardly matters for what is read, but
    matters much for where the platform is taken to be. Joints keep a platform from some poses: it
    is then read as nearly so as they allow.

    Args:
        robot: as described, or its MJCF.
        commands: poses (n, 7) to be read, or what has poses.
        effects: a model, its file, or effects with values.

    Raises:
        InputError: poses, robot or effects of a wrong type or shape, or no pose is read so.
    """
    robot = robot_of(robot)
    commands = commands_from(commands, robot)
    acting, at = effects_of(effects, robot), commands
    for _ in range(_ROUNDS):
        missed = pose_difference(commands.pose, _tracked(robot, at, acting))
        aimed = reachable(robot, pose_add(at.pose, missed))
        if np.abs(pose_difference(aimed, at.pose)).max(initial=0.0) < _READ:
            return at
        at = replace(at, pose=aimed)
    raise InputError("the model's tracker reads no pose as wanted; expected one near the robot's")


def _tracked(robot: Robot, commands: Commands, effects: Sequence[Effect]) -> Array:
    readings = Experiment(robot, commands).readings_at(effects, commands.pose)
    return np.concatenate([readings.position, readings.quat_wxyz], axis=1)
