"""Warns about readings that the model explains so badly that they may be of another robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import BY_NAME, Problem
from seecr.description.robot import Robot
from seecr.effects.base import Readings
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)
from seecr.units import short

# A model is worse than none if it is so many times as far from the readings as the commands are,
# and as the noise is.
_WORSE, _NOISE = 3.0, 10.0
_LEAST_ROWS = 4
# Rotations are in doubt where they change so many times less than the model expects, if it expects
# at least so much [rad].
_OTHER_TURN, _LEAST_TURN = 20.0, np.radians(0.1)


def another_robot_doubts(problem: Problem, readings: Readings) -> list[str]:
    """Sentences that say why the data are hardly of this robot; none if they may be.

    Args:
        problem: the data with their noise. readings: what the model as it stands predicts.
    """
    raw = problem.residuals(readings)
    data = problem.data
    said = [
        f"{data.files[k]}: {note}" if data.files else note
        for k in np.unique(data.file)
        for note in _worse_than_commands(problem, raw, data.file == k)
    ]
    return [*said, *_other_turns(problem, readings)]


def _worse_than_commands(problem: Problem, raw: Array, rows: NDArray[np.bool_]) -> list[str]:
    told = problem.data.command_pose
    if told is None:
        return []
    columns = BY_NAME["position"].columns
    counted = problem.counted[:, columns] & np.isfinite(raw[:, columns]) & rows[:, None]
    if counted.any(axis=1).sum() < _LEAST_ROWS:
        return []
    off = float(np.sqrt(np.mean(raw[:, columns][counted] ** 2)))
    plain = float(np.sqrt(np.mean((problem.data.position - told[:, :3])[counted] ** 2)))
    noise = np.broadcast_to(problem.reading_sigma, raw.shape)
    in_noise = float(np.sqrt(np.mean((raw / noise)[:, columns][counted] ** 2)))
    if off <= _WORSE * plain or in_noise <= _NOISE:
        return []
    return [
        f"The model is {short(1e3 * off)} mm from the measured positions, the commands themselves "
        f"are only {short(1e3 * plain)} mm from them (rms): is this the file of another robot, or "
        "does the controller correct for elasticity already?"
    ]


def _other_turns(problem: Problem, readings: Readings) -> list[str]:
    """Whether the platform turns far less than the model expects: radians that are called degrees.

    Only changes count, since the target may sit on the platform in any orientation.
    """
    counted = problem.counted[:, BY_NAME["orientation"].columns]
    if problem.data.quat_wxyz is not None:
        read = _turned(problem.data.quat_wxyz, problem.robot)
        expected = _turned(readings.quat_wxyz, problem.robot)
    else:
        read, expected = problem.data.angles_rad, rxyz_from_quat(readings.quat_wxyz)
    spreads = [
        [np.mean(np.abs(values[rows] - np.median(values[rows]))) for values in (one, other)]
        for rows, one, other in zip(counted.T, read.T, expected.T, strict=True)
        if rows.sum() >= _LEAST_ROWS
    ]
    if not spreads:
        return []
    small, large = np.sqrt(np.mean(np.square(spreads), axis=0)).tolist()
    if large < _LEAST_TURN or small * _OTHER_TURN > large:
        return []
    return [
        f"Rotations change by {short(np.degrees(small))} deg where the model expects "
        f"{short(np.degrees(large))} deg (mean distance from their median): are these radians in "
        "columns of degrees, or is this the file of another robot?"
    ]


def _turned(quat: Array, robot: Robot) -> Array:
    """Rotation vectors (n, 3) [rad] from the reference pose."""
    return rotvec_from_quat(quat_multiply(quat, quat_conjugate(robot.reference_pose[3:])))
