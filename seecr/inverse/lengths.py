"""Lengths to command so that the winches pay out given lengths, also where cables have a history.

Without a history the winch laws are inverted. With one, the lengths for a wanted pose depend on the
history that the cables have there, and that on the lengths of all rows before. So the path is
predicted, the poses are held again with the history that the cables then have, and so on, until the
prediction is at the wanted poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.pose import Array, changes_between
from seecr.prediction.experiment import Experiment, Prediction
from seecr.tensions.balance import driven_tables, with_passive
from seecr.tensions.rest_lengths import Held, hold_again

REACHED = 1e-6
"""A pose counts as reached if it is missed by less than this [m, and rad times the length]."""

# Most iterations of the winch laws; eccentric drums need several, gains and offsets one.
_ITERATIONS = 60
# Every so-many-th iteration or round ends at the limit of the last changes: where the run-out is
# nearly a drum's radius, few angles pay out much.
_EVERY = 3
# Rounds, and the error of the pose at which they end [robot's length]. As long as the first missed
# pose is a later one than so many rounds ago, they go on, up to the most.
_ROUNDS, _MISSED, _PATIENCE, _MOST = 80, 1e-10, 40, 400
# From this round on, a larger error will do where there is a history: a cable between sticking and
# slipping may go to and fro.
_LATE, _MISSED_LATE = 12, 1e-7
# Late rounds do one of two things, in turns of so many. They take the tension behind a cable that
# sticks as given: it is nearly so where the cable slips on the way to the pose. Or they change by
# less the rows whose changes do not get smaller. They leave what comes before the first missed row.
_TURNS = 14
# Such changes are made in so many rows at a time: what comes later depends on what they lead to.
_AHEAD = 8
# Changes in a ratio nearer to one than this do not tell where they end; and none is prolonged
# further than by this ratio.
_RATIO = 0.99
# Changes that swing and grow by more than this ratio are cut to a third, and no further.
_SWING = -2.0
# Parts of changes are halved where these do not fall by this factor, but not below the least part,
# and grow by a factor where they do. They are whole where changes fall by what was made of them, to
# this part: then all of it would have been right.
_FALLS, _LEAST, _GROWS, _NEARLY = 0.95, 0.1, 1.1, 0.09


def lengths_with_history(
    robot: Robot, commands: Commands, effects: Sequence[Effect], held: Held,
    limits: tuple[Array, Array, Array],
) -> tuple[Array, Prediction]:  # fmt: skip
    """Lengths to command (n, m) [m] that hold the poses, and the prediction with them.

    If the rounds do not converge, those of the round that misses fewest poses are taken. Without
    history and users' laws they are those of ``held`` at once, which is of the driven cables.
    ``limits`` are aim and limits of :func:`seecr.tensions.rest_lengths.hold_again`.
    """
    size = np.where(np.arange(6) < 3, 1.0 / robot.length, 1.0)
    before, part = np.zeros_like(held.rest), np.ones(len(held.rest))
    last_size = np.full(len(held.rest), np.inf)
    least, best = (np.inf, np.inf), None
    farthest, improved = 0, 0
    for number in range(_MOST):
        told = commanded_lengths(robot, commands, effects, with_passive(robot, held.rest))
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
        tables = driven_tables(prediction.tables, robot)
        held = hold_again(tables, held, *limits, follows=not given)
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


def commanded_lengths(
    robot: Robot, commands: Commands, effects: Sequence[Effect], paid: Array
) -> Array:
    """Lengths (n, m) [m] to command so that the winches pay out given rest lengths ``paid`` (n, m).

    The winch laws are inverted for the commands' runs, times and temperatures. Lengths are as
    ``Commands.told``: at the reference pose, those of the plain robot.
    """
    told, last, before = paid.copy(), np.inf, np.zeros_like(paid)
    for number in range(1, _ITERATIONS + 1):
        trial = replace(commands, lengths=told, told=True, passed=None)
        setup = Experiment(robot, trial).setup(effects)
        # the length without any turn of the winch, then what its turning adds
        pretension = robot.rest_lengths - robot.reference_lengths
        zero = setup.geometric_lengths(setup.zero_pose[None]) + pretension
        turned = paid / setup.length_factor - zero - setup.extra_length
        turned = turned / (1.0 + setup.length_gain)
        if np.any(setup.backlash):
            turned = unplay(turned, commands.starts, 0.5 * setup.backlash)
        step = robot.rest_lengths + turned - told
        change = float(np.max(np.abs(step), initial=0.0))
        told = told + (step if number % _EVERY else to_their_limit(step, before))
        before = step
        if change <= 1e-15 * float(np.max(np.abs(told), initial=0.0)) or change >= last:
            break
        last = change if change < 1e-9 else np.inf
    return told if robot.all_driven else np.where(robot.driven, told, robot.rest_lengths)


def unplay(wanted: Array, starts: NDArray[np.bool_], half_width: Array) -> Array:
    """Inputs (n, m) of the play operator for outputs (n, m); zero before ``starts`` (n,).

    The inverse of play is a jump at each reversal (Krejci and Kuhnen, IEE Proceedings 148, 2001).
    While an output is constant, so is its input.
    """
    out, side = np.empty_like(wanted), np.zeros(wanted.shape[1])
    before = np.zeros(wanted.shape[1])
    for k in range(len(wanted)):
        if starts[k]:
            side[:], before = 0.0, np.zeros_like(before)
        moved = np.sign(wanted[k] - before)
        side = np.where(moved == 0.0, side, moved)
        out[k], before = wanted[k] + side * half_width, wanted[k]
    return out


def to_their_limit(change: Array, before: Array) -> Array:
    """The sum of the last change and all to come, in the ratio of the last two (Aitken 1926)."""
    some = (np.abs(change) < _RATIO * np.abs(before)) | (change * before < 0.0)
    ratio = np.divide(change, before, out=np.zeros_like(change), where=some)
    return np.asarray(change / (1.0 - np.clip(ratio, _SWING, _RATIO)))


def damped(part: Array, size: Array, before: Array) -> Array:
    """The parts (n,) of changes to make, smaller where changes do not become smaller.

    ``size`` (n,) is that of the changes now, ``before`` of the last ones: infinite if these were of
    another kind.
    """
    halved, grown = np.maximum(0.5 * part, _LEAST), np.minimum(_GROWS * part, 1.0)
    some = np.where(size > _FALLS * before, halved, grown)
    whole = np.isfinite(before) & (size <= (1.0 + _NEARLY - part) * before)
    return np.asarray(np.where(whole, 1.0, some))
