"""Thins long logs of a slow robot for the search, and tests the result on the other rows.

Rows that were read every few millimetres say little more than every tenth of them, but a search
through the catalogue takes minutes and gigabytes for each ten thousand. So rows are taken at even
steps along each run, together with those at which a cable reverses, because friction and backlash
depend on where lengths turn. If too many rows are reversals, the poses are in no order; then the
first rows of each run are taken, so that the way to them is unchanged.

The rows that were not taken are held out: no fit has seen them.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.problem import Problem, rms_by_kind
from crosscheck.fit.words import rms_words
from crosscheck.measurements.data import Mask, Measurements, Sigma
from crosscheck.preparation.unread import without_unread
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.effects import Terms

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
