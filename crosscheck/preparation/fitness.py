"""Decides whether measurements allow a verdict or a calibration at all, and says why if not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.measurements.data import Sigma
from seecr.description.joints import locked
from seecr.pose import Array

# Data are unfit if more than this part of their rows has no equilibrium.
_LOST = 0.05
# Data with fewer readings or fewer poses say nothing.
_LEAST_READINGS, LEAST_POSES = 6, 6
# Commands that differ by no more than this are the same [m, or components of a quaternion].
_SAME = 1e-9
# Two readings without motion in between contradict each other if they differ by more than _NOISE
# times the noise. Two readings of the same command do if they differ by more than _TRAVEL times the
# spread of the poses.
_NOISE, _TRAVEL = 10.0, 0.2
# The data are contradictory if more than a third of the pairs contradict each other, and more such
# pairs than a tenth of the rows: one row in ten may be an outlier.
_PAIRS, _ROWS = 1.0 / 3.0, 0.1


def refusal_of(problem: Problem, predicted: Array, stated: Sigma) -> Refusal | None:
    """Why these measurements allow no statement; None if they do.

    Args:
        problem: the data, without rows that have no equilibrium.
        predicted: (n, 3) [m] positions of the platform by the model as it stands.
        stated: the noise that the user stated, without estimates.
    """
    n, readings = int(problem.data.read.sum()), problem.n_readings
    lost = n - int(problem.use.sum())
    commands = commands_table(problem)
    if lost > max(_LOST * n, 1):
        return Refusal(Unfit.NO_EQUILIBRIUM, n, lost, readings)
    if readings < _LEAST_READINGS:
        return Refusal(Unfit.FEW_READINGS, n, lost, readings)
    moves = np.append(~locked(problem.robot), np.ones(problem.data.n_cables, dtype=bool))
    if not problem.counted[:, moves].any():
        return Refusal(Unfit.LOCKED_READINGS, n, lost, readings)
    used = np.flatnonzero(problem.use)
    if len(used) > 1 and np.all(np.ptp(commands[used], axis=0) <= _SAME):
        return Refusal(Unfit.CONSTANT_COMMANDS, n, lost, readings)
    poses = 1 + int(np.sum(~_resting(problem, commands, used)))
    if poses < LEAST_POSES:
        return Refusal(Unfit.FEW_POSES, poses, lost, readings)
    apart = _contradicting(problem, commands, predicted, stated)
    if apart is not None:
        places = problem.data.places(np.isin(np.arange(len(problem.use)), apart))
        return Refusal(Unfit.CONTRADICTION, n, lost, readings, places)
    return None


def commands_table(problem: Problem) -> Array:
    """(n, k) the command of each row, with the kind of load that the robot carried, if any."""
    commands = problem.experiment.commands
    table = np.asarray(commands.pose if commands.lengths is None else commands.lengths, float)
    if commands.loads is None:
        return table
    return np.concatenate([table, commands.loads.kinds[:, None]], axis=1)


def _resting(problem: Problem, commands: Array, used: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(k - 1,) whether the robot rested between a used row and the next one."""
    run = problem.data.run_index[used]
    same = np.all(np.abs(np.diff(commands[used], axis=0)) <= _SAME, axis=1)
    # a way point in between would have moved the robot
    return np.asarray(same & (run[1:] == run[:-1]) & (np.diff(used) == 1))


def _contradicting(
    problem: Problem, commands: Array, predicted: Array, stated: Sigma
) -> tuple[int, int] | None:
    """The two rows that contradict each other most, if many rows do; None otherwise."""
    used = np.flatnonzero(problem.use & np.isfinite(problem.data.position).all(axis=1))
    if len(used) < 2:
        return None
    place = problem.data.position
    at_rest = _resting(problem, commands, used)
    neighbours = np.stack([used[:-1], used[1:]], axis=1)[at_rest]
    limit = np.inf if stated.position_m is None else _NOISE * np.sqrt(6.0) * stated.position_m
    spread = float(np.linalg.norm(np.std(predicted[used], axis=0)))
    # an effect with separate values for each file or run may make the same command differ
    kinds = commands
    if problem.groups is not None:
        kinds = np.concatenate([commands, problem.groups[:, None]], axis=1)
    same = _of_same_command(kinds, used)
    for pairs, most in ((neighbours, limit), (same, _TRAVEL * spread)):
        off = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
        wrong = off > most
        if most > 0.0 and wrong.sum() > max(_PAIRS * len(pairs), _ROWS * len(used)):
            first, second = pairs[int(np.argmax(off))].tolist()
            return first, second
    return None


def _of_same_command(commands: Array, used: NDArray[np.intp]) -> NDArray[np.intp]:
    """Pairs (k, 2) of rows with the same command: each row with the first one of that command."""
    _rounded, first, kind = np.unique(
        np.round(commands[used] / (10.0 * _SAME)), axis=0, return_index=True, return_inverse=True
    )
    earlier = first[np.ravel(kind)]
    later = np.flatnonzero(earlier != np.arange(len(used)))
    return np.stack([used[earlier[later]], used[later]], axis=1)
