"""What a controller believes: a robot with a model, and what follows from it for each wanted pose.

The true robot may be another one: see :mod:`seecr.controlled.plant`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.commands import Commands
from seecr.description.joints import motion_columns, values_of_pose
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.effects.edits import setup_with
from seecr.inverse.correction import correct
from seecr.inverse.result import Correction
from seecr.pose import Array, changes_between, moved_by
from seecr.prediction.experiment import Experiment, Prediction, read, sensors_among
from seecr.prediction.sensitivity import rates_of_reading, read_by_length
from seecr.tensions.balance import Rates, linearised

# Step of the central difference of lengths [robot's length, rad]: its error is of second order.
_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class TensionLimits:
    """Limits of tensions [N], where they should be within, and what stiffness is to be large.

    Attributes:
        lowest, highest, aim: as of :func:`seecr.correct`.
        stiff: "least" or the name of a direction, see :mod:`seecr.controlled.stiffest`.
        holding: indices of the winches that hold tensions; None for a loop around all lengths.
        any_orientation: positions alone are wanted. prefer: what to keep of poses that cannot be
            held, as of :func:`seecr.correct`.
    """

    lowest: ArrayLike = 0.0
    highest: ArrayLike = np.inf
    aim: str | ArrayLike = "minimum"
    stiff: str = "least"
    holding: tuple[int, ...] | None = None
    any_orientation: bool = False
    prefer: str = "pose"


@dataclass(frozen=True, eq=False)
class Belief:
    """A robot with the effects that its controller knows of, and the n wanted poses.

    Attributes:
        robot: as described. effects: of the believed model. commands: the wanted poses.
        limits: of the tensions.
    """

    robot: Robot
    effects: Sequence[Effect]
    commands: Commands
    limits: TensionLimits

    @cached_property
    def correction(self) -> Correction:
        """What :func:`seecr.correct` tells the winches for the wanted poses."""
        return self.corrected(self.limits.aim)

    def corrected(self, aim: str | ArrayLike) -> Correction:
        """The same with another aim of the tensions."""
        limits = self.limits
        return correct(
            self.robot, self.commands, effects=self.effects, lowest=limits.lowest,
            highest=limits.highest, aim=aim, any_orientation=limits.any_orientation,
            prefer=limits.prefer,
        )  # fmt: skip

    def aiming_at(self, poses: Array) -> Belief:
        """The same for other wanted poses (n, 7): the nearest ones to those that none can hold."""
        if np.array_equal(poses, self.commands.pose):
            return self
        return replace(self, commands=replace(self.commands, pose=poses))

    @cached_property
    def experiment(self) -> Experiment:
        """The wanted poses as commands to the believed robot."""
        return Experiment(self.robot, self.commands)

    def predicted(self, told: Array) -> Prediction:
        """Where the believed robot rests with told lengths (n, m) [m]."""
        commands = replace(self.commands, lengths=told, told=True)
        return Experiment(self.robot, commands).predict(self.effects)

    def rests_at(self, told: Array) -> Array:
        """Poses (n, 7) of the believed robot with told lengths; NaN where there are none."""
        found = np.asarray(np.isfinite(told).all(axis=1))
        rigid = self.robot.commanded_lengths(self.commands.pose)
        at = self.predicted(np.where(found[:, None], told, rigid))
        return np.where((found & at.solved)[:, None], at.pose, np.nan)

    def lengths(self, poses: Array) -> Array:
        """Lengths to tell (n, m) [m] that differ as the believed geometry does at poses (n, 7).

        Only their differences count. Winches pay out what their believed gains make of them;
        passive lines stay as long as they are.
        """
        setup = self.experiment.setup(self.effects)
        spans = setup.geometric_lengths(poses) / setup.length_factor / (1.0 + setup.length_gain)
        return np.where(self.robot.driven, spans, self.robot.rest_lengths)

    @cached_property
    def jacobian(self) -> Array:
        """J (n, m, 6): change of the lengths by displacement [m/m] and rotation [m/rad].

        Rows are minus the unit vectors u_i and minus (R b_i) x u_i of a plain cable (paper, eq 4).
        """
        poses = self.commands.pose
        return self.rates_of(lambda x: self.lengths(moved_by(poses, x)), np.zeros((len(poses), 6)))

    def rates_of(self, lengths: Callable[[Array], Array], change: Array) -> Array:
        """Derivatives (n, m, 6) of lengths by a change (n, 6) of the poses that they are for."""
        out = np.empty((len(change), self.robot.n_cables, 6))
        for k, size in enumerate(self.units):
            step = np.zeros(6)
            step[k] = _STEP * size
            apart = lengths(change + step) - lengths(change - step)
            out[..., k] = apart / (2.0 * _STEP * size)
        return out

    @property
    def units(self) -> Array:
        """(6,) a displacement of the robot's length [m], and a rotation of one radian."""
        return np.repeat([self.robot.length, 1.0], 3)

    @cached_property
    def motions(self) -> Array:
        """Projectors (n, 6, 6) onto motions that the joints allow; identity if they allow all."""
        n = len(self.commands)
        if not self.robot.joints:
            return np.broadcast_to(np.eye(6), (n, 6, 6))
        pose = self.commands.pose
        screws = values_of_pose(self.robot, pose)[1]
        columns = motion_columns(screws, pose[:, :3]) / self.units[:, None]
        return self._in_units(columns @ np.linalg.pinv(columns, rcond=_STEP))

    def _in_units(self, projectors: Array) -> Array:
        """Projectors of motions in :attr:`units` as those of motions in metres and radians."""
        return np.asarray(self.units[:, None] * projectors / self.units)

    def steered(self, seen: NDArray[np.bool_]) -> Array:
        """Maps (n, 6, 6) from errors that are read to those that lengths can do away with.

        Args:
            seen: (6,) parts of the pose that the tracker reads.
        """
        by_length = self.jacobian @ self.motions * self.units
        known = by_length * seen
        return self._in_units(np.linalg.pinv(known, rcond=_STEP) @ known) @ self.unread

    @cached_property
    def goal(self) -> Array:
        """Poses (n, 7) that are read where the platform is as wanted."""
        seen = self.experiment.readings_at(self.effects, self.commands.pose)
        return np.concatenate([seen.position, seen.quat_wxyz], axis=1)

    @cached_property
    def pulls(self) -> Array:
        """Tensions (n, m) [N] that are read where they are those of the correction."""
        setup = self.experiment.setup(self.effects)
        there = np.nan_to_num(self.correction.solution.tensions * self.robot.falls)
        return read(self.effects, setup, self.commands.pose, there).tensions

    def error(
        self, poses: Array, tensions: Array, rows: NDArray[np.intp], with_tensions: bool
    ) -> Array:
        """(k, 6 + m) [m, rad, N] readings of rows (k,) minus what would be read if all were well.

        Errors of tensions are zero without ``with_tensions``: those wanted take long to find.
        """
        pulls = self.pulls[rows] if with_tensions else tensions
        return np.concatenate([changes_between(poses, self.goal[rows]), tensions - pulls], axis=1)

    @cached_property
    def unread(self) -> Array:
        """Derivatives (n or 1, 6, 6) of the platform's motion by what the tracker reads."""
        if not sensors_among(self.effects):
            return np.eye(6)[None]
        return np.asarray(np.linalg.inv(rates_of_reading(self.held, self.held.sensors)[:, :6, :6]))

    @cached_property
    def held(self) -> Prediction:
        """The believed robot as `correct` holds it."""
        rigid = self.robot.commanded_lengths(self.commands.pose)
        found = self.correction.found[:, None]
        return self.predicted(np.where(found, self.correction.lengths, rigid))

    @cached_property
    def rates(self) -> Rates:
        """Derivatives of the cables' forces there."""
        return linearised(self.held.tables, self.held.found)[1]


def readings_by_told(robot: Robot, effects: Sequence[Effect], at: Prediction) -> Array:
    """Derivatives (n, 6 + m, m) of readings by told lengths [m], of a robot at a prediction.

    Winches pay out what their gains and eccentric drums make of a change; play is left out, since
    a loop ends by going on in one direction or by going to and fro by more.
    """
    commands, step, paid = at.setup.commands, _STEP * robot.length, []
    told = robot.rest_lengths + at.setup.commanded_change
    for sign in (1.0, -1.0):
        moved = replace(commands, lengths=told + sign * step, told=True, passed=None)
        setup = setup_with(effects, robot, moved)
        setup.backlash = np.zeros_like(setup.backlash)
        paid.append(setup.rest_lengths())
    by_told = (paid[0] - paid[1]) / (2.0 * step)
    return np.asarray(read_by_length(at) * by_told[:, None, :])
