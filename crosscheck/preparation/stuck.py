"""Warns about rows in which the platform, or its tracker, stood still while commands went on.

A run that crashes midway leaves readings of one place beside commands of many. No effect is like
that, so a diagnosis would call it an unknown one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from seecr.counted import counted
from seecr.pose import Array

# The platform stands still if it moves by less than this part of the way it is predicted to move,
_STILL = 0.05
# which is more than this part of what all predicted positions spread by, over so many rows.
_FAR, _LEAST_ROWS = 0.1, 3
# Most stretches that are named, and most rows of a run that are looked at, evenly spaced.
_MOST_NAMED, _MOST_ROWS = 3, 400


def stuck_doubts(problem: Problem, predicted: Array) -> list[str]:
    """A sentence for each stretch of a run in which the position hardly changes but should.

    Args:
        problem: the data. predicted: (n, 3) [m] positions by the model as it stands.
    """
    data = problem.data
    axes = np.flatnonzero(problem.counted[:, :3].any(axis=0))
    if not len(axes):
        return []
    read, there = data.position[:, axes], predicted[:, axes]
    whole = problem.use & np.isfinite(read).all(axis=1) & np.isfinite(there).all(axis=1)
    if not whole.any():
        return []
    least = _FAR * float(np.linalg.norm(np.ptp(there[whole], axis=0)))
    found = [
        (rows[first], rows[first + 1 : last + 1])
        for run in np.unique(data.run_index)
        for rows in [_thinned(np.flatnonzero(whole & (data.run_index == run)))]
        for first, last in _stretches(read[rows], there[rows], least)
    ]
    said = [_said(problem, read, there, at, rows) for at, rows in found[:_MOST_NAMED]]
    if (more := len(found) - _MOST_NAMED) > 0:
        said.append(f"The position also stays in {counted(more, 'other part')} of the data.")
    return said


def _thinned(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    return rows[:: 1 + len(rows) // _MOST_ROWS]


def _stretches(read: Array, there: Array, least: float) -> list[tuple[int, int]]:
    """First and last rows between which positions read (n, k) stay, and those predicted do not.

    Rows at either end at which the platform should be where it is read are left out.
    """
    apart, expected = _apart(read), _apart(there)
    moved, should = (np.maximum.accumulate(table, axis=1) for table in (apart, expected))
    still = (expected > least) & (moved < _STILL * should)
    away = apart < _STILL * expected
    out, first = [], 0
    while first + _LEAST_ROWS < len(read):
        if still[first].any():
            start = int(np.argmax(away[first])) - 1
            last = int(np.flatnonzero(still[first])[-1])
            if last - start >= _LEAST_ROWS:
                out.append((start, last))
                first = last
        first += 1
    return out


def _apart(places: Array) -> Array:
    """(n, n) distances of places (n, k) from each other; zero from those before."""
    squares = ((axis[:, None] - axis) ** 2 for axis in places.T)
    return np.asarray(np.triu(np.sqrt(sum(squares))))


def _said(problem: Problem, read: Array, there: Array, at: np.intp, rows: NDArray[np.intp]) -> str:
    data = problem.data
    moved, should = (
        1e3 * float(np.linalg.norm(table[rows] - table[at], axis=1).max())
        for table in (read, there)
    )
    return (
        f"Lines {data.place(int(rows[0]))} to {data.line[rows[-1]]}, run {data.run[at]}: the "
        f"position stays within {moved:.3g} mm of that at line {data.line[at]}, where the commands "
        f"should move it by {should:.4g} mm. Did the robot or its tracker stop? Then leave these "
        "rows out."
    )
