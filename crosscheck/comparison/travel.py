"""The commanded motion of the platform to each row, and the region of the workspace of each row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.measurements.data import Names
from seecr.pose import Array, pose_difference
from seecr.prediction.experiment import Prediction

AXES = ("x", "y", "z", "rx", "ry", "rz")
STILL = "still"
# An axis is not divided if the commands spread along it by less than this part of the widest one.
_FLAT = 0.05
# Speeds this near to each other, relative to their size, are one; coarse times may ask for more.
_SAME_SPEED, _MOST_COARSE = 1e-9, 1e-3
# A position this near to the middle of an axis, relative to the spread, is on it.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Travel:
    """Commanded motion to each row, from the row before or, in a new run, from the reference pose.

    A run that starts at its first row has no motion to that.

    Attributes:
        pose: (n, 7) commanded poses; if lengths are commanded, the predicted ones.
        step: (n, 6) displacement [m] and rotation vector [rad].
        direction: (n,) sign and axis of the largest component of the step, rotations multiplied by
            the robot's length; "still" if nothing moves.
        speed: (n,) [m/s], rotations multiplied by the robot's length; NaN for the first row of a
            run and without times. Those that differ by rounding alone are equal.
    """

    pose: Array
    step: Array
    direction: Names
    speed: Array


def travel(problem: Problem, prediction: Prediction) -> Travel:
    """The commanded motion, never the measured one."""
    commands = problem.experiment.commands
    pose = commands.pose if commands.lengths is None else prediction.pose
    step = pose_difference(pose, commands.before(pose, problem.robot.reference_pose))
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
        speed[known] = _levelled(
            np.linalg.norm(weighed[known], axis=1) / apart[known], _rounding(time, apart[known])
        )
    return Travel(pose, step, direction, speed)


def _rounding(time: Array, apart: Array) -> float:
    """What speeds may differ by, relative to their size: times since 1970 are coarse."""
    coarse = 4.0 * np.spacing(np.abs(time).max())
    return float(np.clip(coarse / apart.min(initial=np.inf), _SAME_SPEED, _MOST_COARSE))


def _levelled(speed: Array, rounding: float) -> Array:
    """Speeds (n,), each group of those that differ by rounding as the smallest of them."""
    order = np.argsort(speed)
    rising = speed[order]
    begins = np.diff(rising, prepend=-1.0) > rounding * rising
    out = np.empty_like(speed)
    out[order] = rising[begins][np.cumsum(begins) - 1]
    return out


def regions_of(problem: Problem, pose: Array) -> Names:
    """The region of each row, (n,): halves along each axis that is used, such as
    "x below 0.4 m, z from 0.15 m".

    Args:
        problem: the data.
        pose: (n, 7) commanded poses.
    """
    place = pose[:, :3]
    used = place[problem.use] if problem.use.any() else place
    low, high = used.min(axis=0), used.max(axis=0)
    spread = high - low
    words: list[list[str]] = [[] for _ in place]
    for k, axis in enumerate("xyz"):
        if spread[k] <= _FLAT * spread.max() or spread[k] == 0:
            continue
        middle = 0.5 * (low[k] + high[k])
        edge = middle - _ROUNDING * spread[k]
        for row, value in zip(words, place[:, k], strict=True):
            row.append(f"{axis} {'below' if value < edge else 'from'} {middle:.3g} m")
    return np.array([", ".join(row) or "everywhere" for row in words], dtype=np.str_)
