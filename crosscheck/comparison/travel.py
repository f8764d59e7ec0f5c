"""How the platform was told to move to each row: direction and speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.measurements.data import Names
from seecr.experiment import Prediction
from seecr.pose import Array, pose_difference

AXES = ("x", "y", "z", "rx", "ry", "rz")
STILL = "still"


@dataclass(frozen=True, eq=False)
class Travel:
    """Commanded motion to each row from the one before, or from the reference pose in a new run.

    Attributes:
        pose: (n, 7) commanded; where lengths are commanded, where the model rests.
        step: (n, 6) displacement [m] and rotation vector [rad].
        direction: (n,) sign and axis of the largest part of the step, rotations weighed by the
            robot's length; "still" where nothing moves.
        speed: (n,) [m/s], rotations times the robot's length; NaN for the first row of a run
            and without times.
    """

    pose: Array
    step: Array
    direction: Names
    speed: Array


def travel(problem: Problem, prediction: Prediction) -> Travel:
    """The motion that was commanded, never the one measured."""
    commands = problem.experiment.commands
    pose = commands.pose if commands.lengths is None else prediction.pose
    before = np.concatenate([pose[:1], pose[:-1]])
    before = np.where(commands.starts[:, None], problem.robot.reference_pose, before)
    step = pose_difference(pose, before)
    weighed = step * np.repeat([1.0, problem.robot.length], 3)
    axis = np.argmax(np.abs(weighed), axis=1)
    most = weighed[np.arange(len(step)), axis]
    words = [("+" if v > 0 else "-") + AXES[k] for k, v in zip(axis, most, strict=True)]
    moves = np.abs(most) > 1e-6 * problem.robot.length
    direction = np.where(moves, np.array(words), STILL)
    speed = np.full(len(pose), np.nan)
    time = problem.data.t_s
    if time is not None:
        apart = np.concatenate([[0.0], np.diff(time)])
        known = ~commands.starts & (apart > 0)
        speed[known] = np.linalg.norm(weighed[known], axis=1) / apart[known]
    return Travel(pose, step, direction, speed)
