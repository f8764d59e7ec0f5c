"""Warns about readings that the model explains so badly that they may be of another robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import BY_NAME, Problem
from crosscheck.units import short
from seecr.effects.base import Readings
from seecr.pose import Array

# A model is worse than none if it is so many times as far from the readings as the commands are,
# and as the noise is. Tensions that are off by the last factor must have another cause.
_WORSE, _NOISE, _OTHER_TENSION = 3.0, 10.0, 20.0
_LEAST_ROWS = 4


def doubts(problem: Problem, readings: Readings) -> list[str]:
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
    return [*said, *_other_tensions(problem, raw)]


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


def _other_tensions(problem: Problem, raw: Array) -> list[str]:
    columns = BY_NAME["tension"].columns
    counted = problem.counted[:, columns] & np.isfinite(raw[:, columns])
    if counted.any(axis=1).sum() < _LEAST_ROWS:
        return []
    read = problem.data.tensions[counted]
    usual = float(np.sqrt(np.mean(read**2)))
    expected = float(np.sqrt(np.mean((read - raw[:, columns][counted]) ** 2)))
    if usual <= 0.0 or expected <= 0.0 or 1.0 / _OTHER_TENSION < usual / expected < _OTHER_TENSION:
        return []
    return [
        f"Tensions of {short(usual)} N were measured where the model expects {short(expected)} N "
        "(rms): is it another unit, the file of another robot, or a pretension that the model "
        "lacks?"
    ]
