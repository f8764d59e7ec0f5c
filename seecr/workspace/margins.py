"""Margins of a robot with effects at given poses, and whether they mean that a pose is held."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.inverse.correction import margins_in_place
from seecr.pose import Array
from seecr.prediction.experiment import effects_of
from seecr.prediction.model import GivenEffects, model_given
from seecr.workspace.zones import load_scale, tension_margin


def margins_at(
    robot: Robot, poses: Array, lowest: ArrayLike, highest: ArrayLike,
    wrenches: ArrayLike | None, effects: GivenEffects, thorough: bool = True,
) -> Array:  # fmt: skip
    """Margins (n,) [N]; robots with too few cables are solved for the orientation.

    Theirs are those of the best orientation found, and minus infinity if there is none, after a
    search that is ``thorough`` or not.
    """
    acting = effects_of(effects, robot)
    if robot.n_cables >= robot.n_dof:
        return tension_margin(
            robot, poses, lowest=lowest, highest=highest, wrenches=wrenches, effects=acting
        )
    if wrenches is not None:
        raise InputError(
            f"{robot.name} has fewer cables than degrees of freedom, so it holds no set of "
            "wrenches; expected none"
        )
    return margins_in_place(robot, poses, acting, lowest, highest, thorough)


def is_held(robot: Robot, margin: Array) -> NDArray[np.bool_]:
    """Whether margins [N] mean that a pose can be held, to within rounding."""
    return np.asarray(margin >= -1e-9 * load_scale(robot))


def read_once(effects: GivenEffects, robot: Robot) -> GivenEffects:
    """The same effects, but a model's file is read: every part of a map needs it."""
    return model_given(effects, robot) if isinstance(effects, str | Path) else effects
