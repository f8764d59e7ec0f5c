"""Cells that nobody read: copied rows, constants, numbers that were filled in, a frozen tracker.

Instruments repeat a number only if what they read changes by less than their last digit. Where the
model expects more, whoever wrote the file filled it in.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crosscheck.fit.problem import ORIENTATION, POSITION, TENSION, Problem
from crosscheck.measurements.data import Mask, Measurements
from seecr.counted import some
from seecr.pose import Array, rxyz_from_quat
from seecr.prediction.experiment import Prediction

# A usual size is known from so many rows.
SEVERAL = 4
LEAST_TURN = np.radians(0.1)
"""Least turn [rad] that a model must expect before its absence is odd."""

# Numbers that differ by less are the same. They are to change by such parts of the robot's size and
# of the usual tension, or by the least turn.
_SAME, _MOVES, _PULLS = 1e-12, 0.02, 0.05
# A number that stands in so many rows or more, so many times as often as any other, is no rounded
# reading: rounding makes neighbours repeat about as often. Eleven of one and two of the next, if
# both were as probable, come once in ninety times, and then only where the model expects changes.
_LEAST_ROWS, _TIMES = 8, 5
_MOST_NAMED = 8
_REMEDY = "leave the cells empty where nothing was read"


def without_unread(problem: Problem, at: Prediction) -> tuple[Problem, list[str]]:
    """The problem without cells that nobody read, and notes on these.

    Copied rows have been noted when the file was read. If nothing else was read the data are left
    as they are.
    """
    data, notes = problem.data, list[str]()
    read, expected = _table(data), _expected(at)
    seen = problem.counted & np.isfinite(expected)
    least = _least(problem, at, seen)
    odd = problem.counted & data.copied[:, None]
    for name, rows in rows_of_files(problem):
        mine = seen & rows[:, None] & ~odd
        columns = _constant(read, expected, mine, least)
        cells = _filled_in(read, expected, mine & ~columns, least)
        odd |= (problem.counted & rows[:, None] & columns) | cells
        if cells.any():
            which = f"{name}{_names(np.asarray(cells.any(axis=0)))}"
            notes.append(
                f"{which}: {data.lines_of(cells.any(axis=1))} not "
                "counted as readings, because the same number stands there again and again where "
                f"the model expects changes; {_REMEDY}"
            )
        if columns.any():
            notes.append(
                f"{name}{_names(columns)}: not counted as readings, because the file has the same "
                f"number in every row where the model expects changes; {_REMEDY}"
            )
    if not odd.any() or odd[problem.counted].all():
        return problem, []
    rest = _without(data, np.where(odd, np.nan, read))
    own = problem.use, problem.left_out, problem.considered
    return Problem(problem.robot, rest, problem.sigma, *own), notes


def locked_note(problem: Problem) -> list[str]:
    """A note about parts of the pose that the joints lock, and that nothing read."""
    said = (
        f"{_names(problem.filled_in)}: not counted as readings, because the joints allow no such "
        "motion and the file has the same number in every row"
    )
    return [said] if problem.filled_in.any() else []


def is_frozen(problem: Problem) -> bool:
    """Whether every channel was read in all rows and never changed."""
    table = _table(problem.data)[problem.use]
    channels = table[:, np.isfinite(table).any(axis=0)]
    return channels.size > 0 and bool(np.all(np.ptp(channels, axis=0) == 0.0))


def rows_of_files(problem: Problem) -> Iterator[tuple[str, Mask]]:
    """Each file's name, as a sentence begins with it, and its rows (n,) with readings."""
    data = problem.data
    for k in np.unique(data.file):
        yield (f"{data.files[k]}: " if data.files else ""), data.read & (data.file == k)


def mean_distances(read: Array, expected: Array, seen: Mask) -> Array:
    """(2, k) mean distances from the median of columns (n, k); NaN where rows are few.

    An outlier can only make them larger.
    """
    out = np.full((2, seen.shape[1]), np.nan)
    for k, rows in enumerate(seen.T):
        if rows.sum() >= SEVERAL:
            both = np.stack([read[rows, k], expected[rows, k]])
            out[:, k] = np.abs(both - np.median(both, axis=1, keepdims=True)).mean(axis=1)
    return out


def _table(data: Measurements) -> Array:
    """(n, 6 + m) positions, angles and tensions as they were read."""
    angles = data.angles_rad if data.quat_wxyz is None else rxyz_from_quat(data.quat_wxyz)
    return np.concatenate([data.position, angles, data.tensions], axis=1)


def _expected(at: Prediction) -> Array:
    """The same as the model predicts them."""
    there = at.readings
    return np.concatenate([there.position, rxyz_from_quat(there.quat_wxyz), there.tensions], axis=1)


def _least(problem: Problem, at: Prediction, seen: Mask) -> Array:
    """(6 + m,) mean distances from their median that instruments would see."""
    pulls = at.readings.tensions[seen[:, TENSION]]
    usual = float(np.sqrt(np.mean(pulls**2))) if pulls.size else 0.0
    least = np.full(seen.shape[1], _PULLS * usual)
    least[:6] = np.repeat([_MOVES * problem.robot.reach, LEAST_TURN], 3)
    return least


def _constant(read: Array, expected: Array, seen: Mask, least: Array) -> Mask:
    """(6 + m,) columns that never change though the model expects changes of more than ``least``.

    A cable that reads nothing in all rows may be slack, unless no tension ever changes.
    """
    small, large = mean_distances(read, expected, seen)
    odd = (small <= _SAME) & (large > least)
    if (small[TENSION] > _SAME).any():
        odd[TENSION] &= np.where(seen, read, 0.0)[:, TENSION].any(axis=0)
    return np.asarray(odd)


def _filled_in(read: Array, expected: Array, seen: Mask, least: Array) -> Mask:
    """(n, 6 + m) cells that repeat a number though the model expects changes beyond ``least``."""
    odd = np.zeros_like(seen)
    for k, rows in enumerate(seen.T):
        values, count = np.unique(read[rows, k], return_counts=True)
        if len(values) < 2:  # columns of one number alone are another matter
            continue
        often, next_often = np.sort(count)[-1], np.sort(count)[-2]
        same = rows & (read[:, k] == values[np.argmax(count)])
        if often < max(_LEAST_ROWS, _TIMES * next_often + 1):
            continue
        there = expected[same, k]
        if np.abs(there - np.median(there)).mean() > least[k]:
            odd[:, k] = same
    # a slack cable pulls with nothing, but never all of them
    nothing = read[:, TENSION] == 0.0
    odd[:, TENSION] &= ~(nothing & ~nothing.all(axis=1, keepdims=True))
    return odd


def _without(data: Measurements, left: Array) -> Measurements:
    """Data of which only some readings (n, 6 + m) are left: positions, angles and tensions."""
    angles, quat = left[:, ORIENTATION], data.quat_wxyz
    lost = np.isnan(angles)
    if quat is None or lost.all() or (lost != lost[:, :1]).any():
        quat = None  # single angles can only be left out of angles
    else:
        quat, angles = np.where(lost[:, :1], np.nan, quat), data.angles_rad
    return replace(
        data, position=left[:, POSITION], quat_wxyz=quat, angles_rad=angles,
        tensions=left[:, TENSION],
    )  # fmt: skip


def _names(columns: Mask) -> str:
    pose = [*"xyz", *(f"rotation about {axis}" for axis in "xyz")]
    names = [pose[k] if k < 6 else f"tension_{k - 5}" for k in np.flatnonzero(columns).tolist()]
    return some(names, _MOST_NAMED)
