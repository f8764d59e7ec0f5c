"""Steps of a platform along its coordinates: poses if it is free, else the values of its joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.pose_rows import changes_between, moved_by
from seecr.statics import batch
from seecr.statics.starts import start_of
from seecr.statics.tables import Tables


def evaluated(robot: Robot, tables: Tables, poses: Array) -> batch.Evaluation:
    """Gradient, stiffness and energy with the platform at poses (n, 7)."""
    at = batch.Evaluation.empty(len(poses), tables.cables.shape[1], tables.n_dof)
    start, values = start_of(robot, tables, poses)
    at.deviation[:] = start
    if values is not None:
        at.values[:] = values
    return batch.evaluate(tables, at)


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Poses of a free platform, or joint values: what steps are added to.

    Poses on joints need a search for their values. Where many steps are made from one another, they
    are kept as values.
    """

    robot: Robot

    def of(self, poses: Array) -> Array:
        """(n, 7), or (n, d) [m, rad], of poses (n, 7)."""
        return values_of_pose(self.robot, poses)[0] if self.robot.joints else poses

    def poses(self, there: Array) -> Array:
        """(n, 7) of coordinates (n, ...)."""
        return pose_of_values(self.robot, there)[0] if self.robot.joints else there

    def moved(self, there: Array, steps: Array) -> Array:
        """Coordinates after steps (n, d) [m]; rotations in a step are times the robot's length."""
        change = steps * np.where(self.robot.hinges, 1.0 / self.robot.length, 1.0)
        return there + change if self.robot.joints else moved_by(there, change)

    def between(self, there: Array, before: Array) -> Array:
        """Steps (n, d) [m] from ``before`` to other coordinates."""
        change = there - before if self.robot.joints else changes_between(there, before)
        return np.asarray(change * np.where(self.robot.hinges, self.robot.length, 1.0))

    def evaluated(self, tables: Tables, there: Array, commanded: Array) -> batch.Evaluation:
        """Gradient, stiffness and energy; tables are of coordinates ``commanded`` (1, ...)."""
        if not self.robot.joints:
            return evaluated(self.robot, tables, there)
        at = batch.Evaluation.empty(len(there), tables.cables.shape[1], tables.n_dof)
        at.deviation[:] = batch.deviations(tables, self.poses(there))
        at.values[:] = self.between(there, commanded)
        return batch.evaluate(tables, at)


def moved(robot: Robot, poses: Array, step: Array) -> Array:
    """Poses (n, 7) after steps (n, d) [m]; rotations in a step are times the robot's length."""
    by = Coordinates(robot)
    return by.poses(by.moved(by.of(poses), step))


def step_between(robot: Robot, poses: Array, before: Array) -> Array:
    """Steps (n, d) [m] from ``before`` to ``poses`` (n, 7), rotations times the robot's length."""
    by = Coordinates(robot)
    if not robot.joints:
        return by.between(poses, before)
    values = by.of(np.concatenate([poses, before]))
    return by.between(values[: len(poses)], values[len(poses) :])
