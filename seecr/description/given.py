"""Robots as callers give them: loaded, or as a path or name to load from."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.errors import InputError

__all__ = ["GivenRobot", "robot_of"]

GivenRobot: TypeAlias = Robot | str | Path
"""A robot, the path of its MJCF, or the name of a shipped one."""


def robot_of(given: GivenRobot) -> Robot:
    """The robot, loaded if a path or name is given.

    Raises:
        RobotError: there is no such file, or it holds no cable robot.
        InputError: neither a robot nor a path or name.
    """
    if isinstance(given, Robot):
        return given
    if isinstance(given, str | Path):
        return load_robot(given)
    raise InputError(
        "expected a robot, the path of its MJCF or the name of a shipped one, got "
        f"{type(given).__name__}"
    )
