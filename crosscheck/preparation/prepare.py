"""Prepares measurements: leaves out rows without equilibrium, fills in noise, finds outliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.fit.residual_noise import estimate_sigma, oversized
from crosscheck.fit.state import State
from crosscheck.fit.words import rms_words
from crosscheck.measurements.data import Mask, Measurements, Sigma
from crosscheck.preparation.freed import freed, groups_of, laid_out
from crosscheck.preparation.suspect import suspicions
from crosscheck.preparation.unread import locked_note, without_unread
from seecr.counted import counted
from seecr.description.joints import locked
from seecr.description.robot import Robot
from seecr.effects import Terms, catalogue
from seecr.equilibrium.strange import strange
from seecr.pose import Array
from seecr.prediction.experiment import Prediction

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction that is done, 0 to 1."""

Finder = Callable[[Problem, Terms, Prediction], NDArray[np.bool_]]
"""Called with the data, the model as it stands and what that predicts; returns outliers (n,)."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Measurements ready for a fit.

    Attributes:
        problem: the data without the rows that have no equilibrium, and with all noise filled in.
        terms: effects of the model, with those that the data leave free.
        notes: what was assumed, estimated or left out.
        refusal: why nothing can be said about these data; None if something can.
        fitted: how many values were fitted in advance because the data leave them free.
        far_off: (n,) outliers, which count in none of the estimates; None if nobody looked for any.
        plain: what the terms predict where commanded lengths are exact; None without readings.
    """

    problem: Problem
    terms: Terms
    notes: tuple[str, ...]
    refusal: Refusal | None
    fitted: int = 0
    far_off: NDArray[np.bool_] | None = None
    plain: Prediction | None = None


def prepare(
    robot: Robot,
    data: Measurements,
    terms: Terms,
    considered: frozenset[str] | None = None,
    outliers: Finder | None = None,
) -> Prepared:
    """Leave out rows that have no equilibrium, estimate unstated noise, and fit what is free.

    Args:
        robot, data: what was measured.
        terms: effects of the model as it stands.
        considered: names of the effects that may be missing; by default the whole catalogue.
        outliers: finds outliers, without which noise is estimated; by default nobody looks for any.
    """
    considered = frozenset(catalogue()) if considered is None else considered
    every = np.ones(data.n_rows, dtype=bool)
    problem = Problem(robot, data, data.sigma, every, considered=considered)
    if not problem.measured.any():
        none = Refusal(Unfit.NO_READINGS, data.n_rows)
        return Prepared(problem, terms, (*robot.notes, *data.notes), none)
    terms, fresh, laid = laid_out(data, terms)
    plain = problem.experiment.predict(terms.effects)
    problem, unread = without_unread(_solved_rows(problem, plain), plain)
    problem, estimates = estimate_sigma(problem, plain)
    terms, free, said = freed(problem, terms, fresh)
    if free.any():
        plain = problem.experiment.predict(terms.effects)
        if estimates:  # the first residuals also contained the error of the frame
            problem, estimates = estimate_sigma(problem.with_sigma(data.sigma), plain)
    far_off = None if outliers is None else outliers(problem, terms, plain)
    if far_off is not None and far_off.any() and estimates:
        others, estimates = estimate_sigma(problem.only(~far_off).with_sigma(data.sigma), plain)
        problem = problem.with_sigma(others.sigma)
    asked, odd = suspicions(problem, plain)
    notes = (
        *data.notes, *robot.notes, *strange(robot), *locked_note(problem), *unread, *asked,
        *oversized(problem, plain), *problem.left_out, *estimates, *laid, *said,
    )  # fmt: skip
    problem = problem.with_groups(groups_of(data, terms))
    refusal = refusal_of(problem, plain.pose[:, :3], data.sigma) or odd
    return Prepared(problem, terms, notes, refusal, int(free.sum()), far_off, plain)


def _solved_rows(problem: Problem, plain: Prediction) -> Problem:
    """The problem without the rows that have no equilibrium."""
    for rows, words in (
        (plain.singular, "the platform is free to move there"),
        (~plain.solved & ~plain.singular, "no equilibrium was found there"),
    ):
        if np.any(rows & problem.use):
            lines = problem.data.lines_of(rows & problem.use)
            problem = problem.without(rows, f"{lines} left out: {words}")
    return problem


def noise_floor(problem: Problem, state: State | None = None) -> Rms:
    """The rms errors of a perfect model, by kind: noise of the readings alone.

    With a state, the noise of the commanded lengths is included, as whitening at that state has it.
    """
    raw = np.broadcast_to(problem.reading_sigma, problem.measured.shape).copy()
    if state is not None and state.factor.ndim == 3:
        raw = np.sqrt(np.einsum("nij,nij->ni", state.factor, state.factor))
    return rms_by_kind(problem, raw)


# Whether measurements allow a verdict or a calibration at all, and why not if they do not.

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


# Thins long logs of a slow robot for the search, and tests the result on the other rows.
#
# Rows that were read every few millimetres say little more than every tenth of them, but a search
# through the catalogue takes minutes and gigabytes for each ten thousand. So rows are taken at even
# steps along each run, together with those at which a cable reverses, because friction and backlash
# depend on where lengths turn. If too many rows are reversals, the poses are in no order; then the
# first rows of each run are taken, so that the way to them is unchanged.
#
# The rows that were not taken are held out: no fit has seen them.

MOST = 1500
"""If there are more rows than this, between half as many and so many of them are searched."""

# A cable reverses where its length goes back by this part of its range.
_TURN = 1e-3
# Of more runs than this, those that are left are as good as all.
_MANY_RUNS = 100
# Runs are taken by multiples of this: of those that alternate (to and fro) some of each kind.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
# Rows with more than so many times the median error are left out of the stated rms.
_FAR = 10.0


def thinned(robot: Robot, data: Measurements, most: int = MOST) -> tuple[Measurements, Mask]:
    """Choose the rows for a search: all if no more than ``most`` were read.

    Otherwise between half as many and so many are taken, and the rows at reversals.

    Returns:
        The rows that are searched, and which rows (n,) were read and are not.
    """
    read = data.read
    every = -(-int(read.sum()) // most)
    if every <= 1:
        return data, np.zeros(data.n_rows, dtype=bool)
    turns = _turns(robot, data)
    index = np.arange(data.n_rows)
    begins = np.append(True, data.run[1:] != data.run[:-1])
    place = index - np.maximum.accumulate(np.where(begins, index, 0))  # within the run
    if turns.sum() <= most:
        last = np.append(place[1:] == 0, True)
        kept = (place % every == 0) | last | turns
        what = f"one in {every} along each run, and those where a cable changes direction"
    else:
        size = np.bincount(data.run_index)[data.run_index]
        kept = place < -(-size // every)
        what = "the first of each run, because the poses are in no order"
    # each run keeps a row at least: of many short runs some are left out whole
    runs = len(np.unique(data.run_index))
    limit = most if runs > _MANY_RUNS else 2 * most
    apart = -(-int(kept.sum()) // limit)
    if apart > 1:
        kept &= _GOLDEN * data.run_index % 1.0 < 1.0 / apart
        what += f", of one run in {apart}"
    note = (
        f"the search uses {counted(int((kept & read).sum()), 'row')} of {int(read.sum())}: "
        f"{what}; `add` fits all of them"
    )
    return data.rows(kept).with_notes([note]), read & ~kept


def note_on_others(
    robot: Robot, whole: Measurements, others: Mask, terms: Terms, sigma: Sigma
) -> list[str]:
    """How well a model predicts the rows (n,) that were held out; nothing if there are none."""
    if not others.any():
        return []
    problem = Problem(robot, whole, sigma, others)
    at = problem.experiment.predict(terms.effects)
    problem = without_unread(problem.only(at.solved), at)[0]
    raw = problem.residuals(at.readings)
    squares = np.where(problem.counted, (raw / problem.reading_sigma) ** 2, 0.0).sum(axis=1)
    size = np.sqrt(squares / np.maximum(problem.counted.sum(axis=1), 1))
    used = problem.use
    if not used.any():
        return []
    far = used & (size > _FAR * np.median(size[used]))
    rms = rms_words(rms_by_kind(problem.with_far_off(far), raw))
    aside = f", except for {counted(int(far.sum()), 'outlier')}" if far.any() else ""
    count = counted(int(used.sum()), "other row")
    return [f"{count}, not used in any fit, predicted to {rms} rms{aside}"]


def _turns(robot: Robot, data: Measurements) -> Mask:
    """(n,) rows at which a cable reverses or the load changes, and the row before such a change."""
    from scipy import signal  # takes half a second to import, and few logs are this long

    commands = data.as_commands(robot)
    told = commands.change(robot)
    turns = np.zeros(data.n_rows, dtype=bool)
    if commands.loads is not None:
        changes = commands.loads.changes
        turns |= changes
        turns[:-1] |= changes[1:]
    least = np.maximum(_TURN * np.ptp(told, axis=0), 1e-12)
    begins = np.flatnonzero(commands.starts)
    for rows in np.split(np.arange(data.n_rows), begins[1:]):
        for cable, prominence in enumerate(least):
            for way in (told[rows, cable], -told[rows, cable]):
                turns[rows[signal.find_peaks(way, prominence=prominence)[0]]] = True
    return turns
