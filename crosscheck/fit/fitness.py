"""Whether measurements can carry a verdict or a calibration at all; if not, why."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.measurements.data import Sigma
from seecr.pose import Array

# More rows than this part without an answer, and the data are not fit for a verdict.
_LOST = 0.05
# Fewer readings, or fewer poses, than this say nothing.
_LEAST_READINGS, LEAST_POSES = 6, 6
# Commands that differ by less are the same [m, or components of a quaternion].
_SAME = 1e-9
# Two readings without motion between them contradict each other beyond this many of their noise;
# two of the same command, whatever was between, beyond this part of how far the commands spread.
_NOISE, _TRAVEL = 10.0, 0.2
# Readings contradict each other where this part of the pairs does, and of all rows: one row in
# ten may be far off.
_PAIRS, _ROWS = 1.0 / 3.0, 0.1


def refusal_of(problem: Problem, predicted: Array, stated: Sigma) -> Refusal | None:
    """Why nothing can be said of measurements; None where something can.

    Args:
        problem: the data, without rows that have no equilibrium.
        predicted: (n, 3) [m] where the model as it stands has the platform.
        stated: the noise that the user stated; what was estimated is missing in it.
    """
    n, readings = int(problem.data.read.sum()), problem.n_readings
    lost = n - int(problem.use.sum())
    commands = commands_table(problem)
    if lost > max(_LOST * n, 1):
        return Refusal(Unfit.NO_EQUILIBRIUM, n, lost, readings)
    if readings < _LEAST_READINGS:
        return Refusal(Unfit.FEW_READINGS, n, lost, readings)
    used = np.flatnonzero(problem.use)
    if len(used) > 1 and np.all(np.ptp(commands[used], axis=0) <= _SAME):
        return Refusal(Unfit.CONSTANT_COMMANDS, n, lost, readings)
    poses = 1 + int(np.sum(~_resting(problem, commands, used)))
    if poses < LEAST_POSES:
        return Refusal(Unfit.FEW_POSES, poses, lost, readings)
    if _frozen(problem, used):
        return Refusal(Unfit.FROZEN_READINGS, n, lost, readings)
    apart = _contradicting(problem, commands, predicted, stated)
    if apart is not None:
        places = problem.data.places(np.isin(np.arange(len(problem.use)), apart))
        return Refusal(Unfit.CONTRADICTION, n, lost, readings, places)
    return None


def commands_table(problem: Problem) -> Array:
    """(n, k) what was commanded in each row, the load that it carried with it."""
    commands = problem.experiment.commands
    table = np.asarray(commands.pose if commands.lengths is None else commands.lengths, float)
    if commands.loads is None:
        return table
    return np.concatenate([table, commands.loads.kinds[:, None]], axis=1)


def _resting(problem: Problem, commands: Array, used: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(k - 1,) whether nothing moved from each used row to the next."""
    run = problem.data.run_index[used]
    same = np.all(np.abs(np.diff(commands[used], axis=0)) <= _SAME, axis=1)
    # what was passed in between moved the robot
    return np.asarray(same & (run[1:] == run[:-1]) & (np.diff(used) == 1))


def _frozen(problem: Problem, used: NDArray[np.intp]) -> bool:
    """Whether every channel read the same in all rows."""
    data = problem.data
    turned = data.angles_rad if data.quat_wxyz is None else data.quat_wxyz
    table = np.concatenate([data.position, turned, data.tensions], axis=1)[used]
    whole = table[:, np.isfinite(table).all(axis=0)]
    partly = np.isfinite(table).any(axis=0).sum() != whole.shape[1]
    return whole.shape[1] > 0 and not partly and bool(np.all(np.ptp(whole, axis=0) == 0.0))


def _contradicting(
    problem: Problem, commands: Array, predicted: Array, stated: Sigma
) -> tuple[int, int] | None:
    """Two rows that contradict each other most, where many do; None elsewhere."""
    used = np.flatnonzero(problem.use & np.isfinite(problem.data.position).all(axis=1))
    if len(used) < 2:
        return None
    place = problem.data.position
    at_rest = _resting(problem, commands, used)
    neighbours = np.stack([used[:-1][at_rest], used[1:][at_rest]], axis=1)
    limit = np.inf if stated.position_m is None else _NOISE * np.sqrt(6.0) * stated.position_m
    spread = float(np.linalg.norm(np.std(predicted[used], axis=0)))
    # files or runs that have values of their own may well differ
    kinds = commands
    if problem.groups is not None:
        kinds = np.concatenate([commands, problem.groups[:, None]], axis=1)
    for pairs, most in (
        (neighbours, limit),
        (_of_same_command(kinds, used), _TRAVEL * spread),
    ):
        off = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
        wrong = off > most
        if most > 0.0 and wrong.sum() > max(_PAIRS * len(pairs), _ROWS * len(used)):
            first, second = pairs[int(np.argmax(off))].tolist()
            return first, second
    return None


def _of_same_command(commands: Array, used: NDArray[np.intp]) -> NDArray[np.intp]:
    """Pairs (k, 2) of rows with the same command, each row with the first of its kind."""
    _rounded, first, kind = np.unique(
        np.round(commands[used] / (10.0 * _SAME)), axis=0, return_index=True, return_inverse=True
    )
    earlier = first[np.ravel(kind)]
    later = np.flatnonzero(earlier != np.arange(len(used)))
    return np.stack([used[earlier[later]], used[later]], axis=1)
