"""Readings that another row has too, to the last digit: rows that count twice, and copied ones.

Noise does not repeat all numbers of a row, unless they are so coarse that chance does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import count

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements.data import Mask, Measurements
from seecr.counted import plural, some
from seecr.pose import Array

# A note is wrong in one of so many files whose readings are as coarse.
_WRONG = 1e-3
# Single numbers repeat where a robot is symmetric; so many together do not.
_LEAST_COLUMNS = 2
_MOST_TWICE, _MOST_COPIED = 8, 20
# The median of a normal difference's size, in standard deviations.
_USUAL = 0.6745

Pair = tuple[int, int]
"""A row, and the first one before it that it repeats."""


def repetitions(data: Measurements, across: bool = False) -> tuple[list[str], Mask]:
    """Notes about rows that repeat others, and which rows (n,) have the readings of another one.

    Args:
        data: what was measured.
        across: whether only repetitions of another file's rows count: each file knows its own.
    """
    twice, copies = _pairs(data, across)
    notes, copied = list[str](), np.zeros(data.n_rows, dtype=bool)
    if copies and _by_chance(data, len(copies)) <= _WRONG:
        commands = _commands(data)
        by_files: dict[tuple[int, int, bool], list[Pair]] = {}
        for row, before in copies:
            # of the same command in another file either reading is right, and counts twice
            other = commands[row] != commands[before]
            copied[[row, before]] |= other
            key = int(data.file[row]), int(data.file[before]), other
            by_files.setdefault(key, []).append((row, before))
        notes += [_words(data, *key, found) for key, found in by_files.items()]
    if twice:
        pairs = [f"{data.place(row)} as {data.place(before)}" for row, before in twice]
        notes.append(
            f"Identical rows: line {some(pairs, _MOST_TWICE)}; they count twice, so remove one of "
            "each pair if it was measured only once."
        )
    return notes, copied


def _pairs(data: Measurements, across: bool) -> tuple[list[Pair], list[Pair]]:
    """Rows that repeat another one whole, and those that do beside another command or load."""
    rows = np.arange(data.n_rows)
    number = np.zeros(data.n_rows, dtype=np.int64)
    for column in _readings(data):
        number += np.isfinite(column)
    whole = _first_like(data, lambda name: name != "run")
    before = _first_like(data, _is_reading)
    commands = np.column_stack([_commands(data), data.file])
    twice = (number > 0) & (whole != rows)
    copies = (number >= _LEAST_COLUMNS) & (commands != commands[before]).any(axis=1)
    if across:
        twice &= data.file[whole] != data.file
        copies &= data.file[before] != data.file
    return _listed(twice, whole), _listed(copies, before)


def _listed(some: Mask, before: NDArray[np.intp]) -> list[Pair]:
    return [(row, int(before[row])) for row in np.flatnonzero(some).tolist()]


def _first_like(data: Measurements, wanted: Callable[[str], bool]) -> NDArray[np.intp]:
    """For each row the first one with the same numbers in some columns, bit for bit.

    Rows are sorted by a key of 64 bits, with which whole rows are compared afterwards: sorted
    themselves they take five times the memory. With other keys should two rows have the same one.
    """
    for first_key in count():
        key = np.full(data.n_rows, first_key, dtype=np.uint64)
        for column in _stated(data, wanted):
            key = _mixed(key ^ column.view(np.uint64))
        _keys, first, which = np.unique(key, return_index=True, return_inverse=True)
        before = first[which.ravel()]
        bits = (column.view(np.uint64) for column in _stated(data, wanted))
        if not any(np.any(each != each[before]) for each in bits):
            return np.asarray(before)
    raise AssertionError("there is always another key")


def _mixed(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Another key for each: the last steps of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014)."""
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        key = (key ^ (key >> np.uint64(shift))) * np.uint64(factor)
    return key ^ (key >> np.uint64(31))


_READ = ("meas_", "tension_")


def _is_reading(name: str) -> bool:
    return name.startswith(_READ)


def _commands(data: Measurements) -> NDArray[np.intp]:
    """(n,) the first row with the same command, load, and what else is stated but readings."""
    return _first_like(data, lambda name: not name.startswith((*_READ, "t_s", "run")))


def _readings(data: Measurements) -> Iterator[Array]:
    """The columns (n,) of readings, as written."""
    return _stated(data, _is_reading)


def _stated(data: Measurements, wanted: Callable[[str], bool]) -> Iterator[Array]:
    """Columns (n,) as written; 0 and -0 are the same, NaN is not stated."""
    for name, values in data.columns():
        if wanted(name):
            yield np.array(values, dtype=float) + 0.0


def _by_chance(data: Measurements, count: int) -> float:
    """The probability that so many rows or more repeat another one by chance.

    Pairs are counted as if they were independent (Poisson): those of one command, whose numbers
    differ by noise, and all others.
    """
    from scipy import special  # takes a while to import, and few files need it

    place = data.command_pose if data.command_lengths is None else data.command_lengths
    assert place is not None
    read = np.stack(list(_readings(data)), axis=1)
    rows = np.isfinite(read).sum(axis=1) >= _LEAST_COLUMNS
    read = read[rows]
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
    return float(special.pdtrc(count - 1, expected))


def _density(step: float, spread: float) -> float:
    """The probability that a normal difference is 0 when rounded to a step."""
    return min(step / (math.sqrt(2.0 * math.pi) * spread), 1.0) if spread > 0.0 else 1.0


def _words(data: Measurements, file: int, other: int, differ: bool, found: list[Pair]) -> str:
    rows, before = (
        f"{plural(len(lines), 'line')} {some(lines, _MOST_COPIED)}"
        for k in (0, 1)
        for lines in [list(dict.fromkeys(str(data.line[pair[k]]) for pair in found))]
    )
    here, there = (f"{data.files[k]} " if data.files else "" for k in (file, other))
    why = (
        "copied from one file to the other"
        if file != other
        else "copied, or the tracker stood still"
    )
    counts = "Then leave those out that were not measured; all count as measured here."
    if differ:
        counts = "At most one of each was measured, so none of them counts as long as others do."
    return (
        f"Repeated readings: {here}{rows} have those of {there}{before} to the last digit, beside "
        f"another command, load or file. Noise does not repeat: were they {why}? {counts}"
    )
