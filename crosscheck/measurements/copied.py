"""Readings that another row has too, to the last digit, beside another command, load or file."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements.data import Measurements
from seecr.counted import plural, some
from seecr.pose import Array

# A note is wrong in one of so many files whose readings are as coarse.
_WRONG = 1e-3
# Single numbers repeat where a robot is symmetric; so many together do not.
_LEAST_COLUMNS = 2
_MOST_LINES = 20


def copied(data: Measurements) -> list[str]:
    """A sentence for each pair of files, or file, with readings of one in rows of the other.

    Noise does not repeat all numbers of a row, unless they are so coarse that chance does.
    """
    read = _readings(data)
    told = [values for name, values in data.columns() if not name.startswith(_NOT_TOLD)]
    commands = list(zip(*told, data.file.tolist(), strict=True))
    first: dict[bytes, int] = {}
    pairs: dict[tuple[int, int], list[tuple[int, int]]] = {}
    whole = np.flatnonzero(np.isfinite(read).sum(axis=1) >= _LEAST_COLUMNS)
    for row in whole.tolist():
        before = first.setdefault(read[row].tobytes(), row)
        if before != row and commands[before] != commands[row]:
            files = int(data.file[row]), int(data.file[before])
            pairs.setdefault(files, []).append((row, before))
    count = sum(map(len, pairs.values()))
    if count == 0 or _by_chance(data, read[whole], whole, count) > _WRONG:
        return []
    return [_words(data, *files, found) for files, found in pairs.items()]


_READ = ("meas_", "tension_")
_NOT_TOLD = (*_READ, "t_s", "run")


def _readings(data: Measurements) -> Array:
    """The readings (n, k) as written; 0 and -0 are the same, NaN is not read."""
    columns = [values for name, values in data.columns() if name.startswith(_READ)]
    return np.array(columns, dtype=float).reshape(len(columns), data.n_rows).T + 0.0


def _by_chance(data: Measurements, read: Array, rows: NDArray[np.intp], count: int) -> float:
    """The probability that so many rows (n, k) or more repeat another one by chance.

    Pairs are counted as if they were independent (Poisson): those of one command, whose numbers
    differ by noise, and all others.
    """
    place = data.command_pose if data.command_lengths is None else data.command_lengths
    assert place is not None
    _places, which = np.unique(place[rows].round(9), axis=0, return_inverse=True)
    which = which.ravel()
    order = np.argsort(which, kind="stable")
    same = order[np.flatnonzero(np.diff(which[order]) == 0)[:, None] + [0, 1]]
    same = same[(read[same[:, 0]] != read[same[:, 1]]).any(axis=1)]  # what repeats is in question
    alike, every, once = 1.0, 1.0, np.unique(read, axis=0)
    for column, single in zip(read.T, once.T, strict=True):
        values, often = np.unique(single[np.isfinite(single)], return_counts=True)
        if len(values) < 2:
            continue
        step, spread = float(np.diff(values).min()), float(np.ptp(values)) / math.sqrt(12.0)
        pairs = float(len(single) * (len(single) - 1))
        anywhere = max(float(np.sum(often * (often - 1.0))) / pairs, _density(step, spread))
        apart = np.abs(np.diff(column[same], axis=1))
        every *= anywhere
        if len(apart):
            noise = float(np.nanmedian(apart)) / _USUAL
            anywhere = max(float(np.mean(apart == 0.0)), _density(step, noise))
        alike *= anywhere
    sizes = np.bincount(which).astype(float)
    expected = 0.5 * float(np.sum(sizes * (sizes - 1.0))) * alike
    expected += 0.5 * len(read) * (len(read) - 1.0) * every
    term, below = math.exp(-min(expected, 700.0)), 0.0
    for k in range(min(count, 1000)):
        below += term
        term *= expected / (k + 1.0)
    return max(1.0 - below, 0.0)


# The median of a normal difference's size, in standard deviations.
_USUAL = 0.6745


def _density(step: float, spread: float) -> float:
    """The probability that a normal difference is 0 when rounded to a step."""
    return min(step / (math.sqrt(2.0 * math.pi) * spread), 1.0) if spread > 0.0 else 1.0


def _words(data: Measurements, file: int, other: int, found: list[tuple[int, int]]) -> str:
    noun = plural(len(found), "line")
    rows, before = (
        f"{noun} {some([str(data.line[pair[k]]) for pair in found], _MOST_LINES)}" for k in (0, 1)
    )
    here, there = (f"{data.files[k]} " if data.files else "" for k in (file, other))
    why = (
        "copied from one file to the other"
        if file != other
        else "copied, or the tracker stood still"
    )
    return (
        f"Repeated readings: {here}{rows} have those of {there}{before} to the last digit, beside "
        f"another command, load or file. Noise does not repeat: were they {why}? Then leave those "
        "out that were not measured; all count as measured here."
    )
