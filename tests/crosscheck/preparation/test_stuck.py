"""A run that stops midway is noticed; slow, lost and repeated readings are not taken for that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, soft_cogiro

from crosscheck.measurements.data import Measurements
from crosscheck.preparation.prepare import prepare
from crosscheck.preparation.stuck import _stretches
from seecr.effects import Terms

ROBOT = soft_cogiro()


@pytest.fixture(scope="module")
def data() -> Measurements:
    return measured(ROBOT, points=8)


def stops(data: Measurements, first: int, last: int) -> Measurements:
    position = data.position.copy()
    noise = np.random.default_rng(1).normal(size=(last - first, 3))
    position[first + 1 : last + 1] = position[first] + 3e-5 * noise
    return replace(data, position=position)


def stuck_notes(data: Measurements) -> list[str]:
    return [note for note in prepare(ROBOT, data, Terms()).notes if "tracker stop" in note]


@pytest.mark.parametrize("row", [0, -1], ids=["first run", "last run"])
def test_rows_after_a_crash_are_named(data: Measurements, row: int) -> None:
    run = np.flatnonzero(data.run == data.run[row])
    (note,) = stuck_notes(stops(data, run[2], run[-1]))
    at, first, last = data.line[[run[2], run[3], run[-1]]]
    assert note.startswith(
        f"Lines {first} to {last}, run {data.run[row]}: the position stays within"
    )
    assert f"of that at line {at}, where" in note


def test_so_many_are_counted_where_more_than_three_stop(data: Measurements) -> None:
    stopped = data
    for run in np.unique(data.run_index):
        rows = np.flatnonzero(data.run_index == run)
        stopped = stops(stopped, rows[2], rows[-1])
    assert len(stuck_notes(stopped)) == 3
    (count,) = [n for n in prepare(ROBOT, stopped, Terms()).notes if "also stays" in n]
    assert (
        count
        == f"The position also stays in {len(np.unique(data.run)) - 3} other parts of the data."
    )


def test_a_run_that_goes_on_has_no_such_note(data: Measurements) -> None:
    assert stuck_notes(data) == []
    lost = data.position.copy()
    lost[2:6] = np.nan
    assert stuck_notes(replace(data, position=lost)) == []


def test_stretches_end_where_the_platform_moves_again() -> None:
    there = np.linspace(0.0, 1.0, 11)[:, None] * [1.0, 0.0, 0.0]
    read = there.copy()
    assert _stretches(read, there, 0.1) == []
    read[3:8] = read[3]
    assert _stretches(read, there, 0.1) == [(3, 7)]
    # far less than the whole way is no standstill that could be told from backlash
    assert _stretches(read, there, 0.6) == []
    # and begin where commands leave the place, and end where they are back: those rows are right
    back = np.repeat([0.0, 1.0, 0.0], 4)[:, None] * [1.0, 0.0, 0.0]
    assert _stretches(np.zeros_like(back), back, 0.1) == [(3, 7)]
    # readings of one place under one command
    assert _stretches(np.repeat(there, 5, axis=0), np.repeat(there, 5, axis=0), 0.1) == []
