"""Margins of a robot with effects at given poses, and whether they mean that a pose is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.commands.data import Commands
from seecr.compiled.columns import EXTERNAL_FORCE, EXTERNAL_MOMENT
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.holding.balance import balance_of, bends
from seecr.holding.distribution import tension_limits
from seecr.holding.inside import farthest_inside
from seecr.inverse.correction import margins_in_place
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, effects_of
from seecr.prediction.model import GivenEffects, model_given
from seecr.statics.tables import Tables, assemble
from seecr.workspace.zones import load_scale, margins_from, tension_margin, wrenches_of


def margins_at(
    robot: Robot, poses: Array, lowest: ArrayLike, highest: ArrayLike,
    wrenches: ArrayLike | None, effects: GivenEffects,
) -> Array:  # fmt: skip
    """Margins (n,) [N]; robots with too few cables are solved for the orientation.

    Theirs are those of the best orientation found, and minus infinity if there is none.
    """
    acting = effects_of(effects, robot)
    if robot.n_cables >= robot.n_dof:
        if acting:
            return margins_with(robot, poses, acting, lowest, highest, wrenches)
        return tension_margin(robot, poses, lowest=lowest, highest=highest, wrenches=wrenches)
    if wrenches is not None:
        raise InputError(
            f"{robot.name} has fewer cables than degrees of freedom, so it holds no set of "
            "wrenches; expected none"
        )
    return margins_in_place(robot, poses, acting, lowest, highest)


def margins_with(
    robot: Robot,
    poses: Array,
    effects: GivenEffects,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
) -> Array:
    """Margins (n,) [N] like :func:`seecr.tension_margin`, of a robot with effects."""
    low, high = tension_limits(robot, lowest, highest)
    told = Commands(poses, lengths=robot.commanded_lengths(poses), told=True)
    tables = assemble(Experiment(robot, told).setup(effects_of(effects, robot)))
    some = np.zeros((1, 6)) if wrenches is None else wrenches_of(wrenches)
    if bends(tables):
        every = [farthest_inside(_pushed(tables, one), low, high).margins for one in some]
        return np.asarray(np.min(every, axis=0))
    matrices, load = balance_of(tables, low)
    # load of -W tau = w: the signs are those of the gradient
    loads = load[:, None]
    if robot.joints and wrenches is not None:
        # of a wrench only that along the joints must be balanced
        loads = np.stack([balance_of(_pushed(tables, one), low)[1] for one in some], axis=1)
    elif wrenches is not None:
        loads = loads + some * np.where(robot.hinges, 1.0 / robot.length, 1.0)
    return margins_from(matrices, np.ascontiguousarray(loads), low, high, load_scale(robot))


def _pushed(tables: Tables, wrench: Array) -> Tables:
    """The same tables with an additional external wrench (6,) [N, N m] at the platform's origin."""
    load = tables.load.copy()
    load[:, EXTERNAL_FORCE : EXTERNAL_FORCE + 3] += wrench[:3]
    load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] += wrench[3:]
    return replace(tables, load=load)


def is_held(robot: Robot, margin: Array) -> NDArray[np.bool_]:
    """Whether margins [N] mean that a pose can be held, to within rounding."""
    return np.asarray(margin >= -1e-9 * load_scale(robot))


def read_once(effects: GivenEffects, robot: Robot) -> GivenEffects:
    """The same effects, but a model's file is read: every part of a map needs it."""
    return model_given(effects, robot) if isinstance(effects, str | Path) else effects
