"""What callers give: a robot or a model as a file's path, or as what was read from it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from seecr.effects import Term, Terms
from seecr.mjcf import load_robot
from seecr.model import Model, load_model
from seecr.robot import Robot

GivenRobot: TypeAlias = Robot | str | Path
"""A robot, or the path of its MJCF."""

GivenModel: TypeAlias = Model | Iterable[Term] | str | Path
"""A model, its effects alone, or the path of its TOML; ``()`` is the plain model."""


def robot_of(given: GivenRobot) -> Robot:
    """The robot, read if need be.

    Raises:
        RobotError: no such file, or no cable robot in it.
    """
    return load_robot(given) if isinstance(given, str | Path) else given


def model_of(given: GivenModel, robot: Robot) -> tuple[Terms, tuple[str, ...]]:
    """The model's effects and what its file says about them, read if need be.

    Raises:
        InputFileError: no such file, or no model of this robot in it.
    """
    model = load_model(given, robot) if isinstance(given, str | Path) else given
    if isinstance(model, Model):
        return model.terms, model.notes
    return Terms(model), ()
