"""Lengths to command where what a cable pulls depends on its history: found in rounds.

The lengths for a wanted pose depend on the history that the cables have there, and that on the
lengths of all rows before. So the path is predicted, the poses are held again with the history that
the cables then have, and so on, until the prediction is at the wanted poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.holding.lengths import Held, hold_again
from seecr.inverse.aitken import damped, to_their_limit
from seecr.inverse.told import told_lengths
from seecr.pose import Array, changes_between
from seecr.prediction.experiment import Experiment, Prediction

REACHED = 1e-6
"""A pose counts as reached if it is missed by less than this [m, and rad times the length]."""

# Rounds, and the error of the pose at which they end [robot's length]. As long as the first missed
# pose is a later one than so many rounds ago, they go on, up to the most.
_ROUNDS, _MISSED, _PATIENCE, _MOST = 80, 1e-10, 40, 400
# Every so-many-th round ends at the limit of the last changes.
_EVERY = 3
# From this round on, a larger error will do where there is a history: a cable between sticking and
# slipping may go to and fro.
_LATE, _MISSED_LATE = 12, 1e-7
# Late rounds do one of two things, in turns of so many. They take the tension behind a cable that
# sticks as given: it is nearly so where the cable slips on the way to the pose. Or they change by
# less the rows whose changes do not get smaller. They leave what comes before the first missed row.
_TURNS = 14
# Such changes are made in so many rows at a time: what comes later depends on what they lead to.
_AHEAD = 8


def lengths_with_history(
    robot: Robot,
    commands: Commands,
    effects: Sequence[Effect],
    held: Held,
    limits: tuple[Array, Array, Array],
) -> tuple[Array, Prediction]:
    """Told lengths (n, m) [m] that pay out what holds the poses, and the prediction with them.

    If the rounds do not converge, those of the round that misses fewest poses are taken. Without
    history and users' laws they are those of ``held`` at once.

    Args:
        robot: as described. commands: of the n poses; their lengths are ignored.
        effects: of the robot.
        held: rest lengths that hold the poses without a history.
        limits: aim and limits of the tensions, as for :func:`seecr.holding.lengths.hold_again`.
    """
    size = np.where(np.arange(6) < 3, 1.0 / robot.length, 1.0)
    before, part = np.zeros_like(held.rest), np.ones(len(held.rest))
    last_size = np.full(len(held.rest), np.inf)
    least, best = (np.inf, np.inf), None
    farthest, improved = 0, 0
    for number in range(_MOST):
        told = told_lengths(robot, commands, effects, held.rest)
        prediction = Experiment(robot, replace(commands, lengths=told, told=True)).predict(effects)
        if not (prediction.has_history or prediction.setup.laws):
            return told, prediction
        missed = np.abs(changes_between(prediction.pose, commands.pose) * size).max(axis=1)
        late = number >= _LATE and prediction.has_history
        left = _left(missed[held.fine], robot)
        if best is None or left < least:
            least, best = left, (told, prediction)
        first = _first_missed(missed, held, robot)
        if first > farthest:
            farthest, improved = first, number
        if left[1] <= _enough(late, robot) or number + 1 >= max(_ROUNDS, improved + _PATIENCE):
            break
        last, given = held.rest, late and (number - _LATE) // _TURNS % 2 == 0
        held = hold_again(prediction.tables, held, *limits, follows=not given)
        change, size_now = held.rest - last, np.full(len(held.rest), np.inf)
        if late and not given:
            size_now = np.abs(change).max(axis=1)
            part = damped(part, size_now, last_size)
            held.rest = last + part[:, None] * change
            held.rest[first + _AHEAD :] = last[first + _AHEAD :]
        elif number and number % _EVERY == 0:
            held.rest = last + to_their_limit(change, before)
        if late and first < len(missed):
            held.rest[:first] = last[:first]
        before, last_size = change, size_now
    assert best is not None
    return best


def _first_missed(missed: Array, held: Held, robot: Robot) -> int:
    """The first row that is missed, or the number of rows: what is before it is as it should be.

    To change that a little would change the history of all that come after it.
    """
    rows = np.flatnonzero(held.fine & (np.nan_to_num(missed, nan=np.inf) >= REACHED / robot.length))
    return int(rows[0]) if len(rows) else len(missed)


def _left(missed: Array, robot: Robot) -> tuple[float, float]:
    """How many poses are missed, and the largest error [robot's length]; NaN misses a pose."""
    error = np.nan_to_num(missed, nan=np.inf)
    return float(np.sum(error >= REACHED / robot.length)), float(np.max(error, initial=0.0))


def _enough(late: bool, robot: Robot) -> float:
    """The error [robot's length, rad] at which rounds end; half of what counts as reached."""
    return min(_MISSED_LATE if late else _MISSED, 0.5 * REACHED / robot.length)
