"""Runs, times and temperatures as cells say them."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from made_columns import columns_of

from seecr.columns.commands import began, runs, temperatures, times, times_of_day
from seecr.errors import InputFileError

NIGHT = ("2024-02-28T23:59:30", "2024-02-28 23:59:30.5", "2024-02-29T00:00:15")


def test_rows_without_a_run_are_one_called_all() -> None:
    columns = columns_of("t_s", "1", "2")
    assert runs(columns).tolist() == ["all", "all"]
    assert columns.notes == ['No column run: all rows count as one run called "all".']


def test_runs_have_the_names_of_their_cells() -> None:
    columns = columns_of("t_s,run", "1,b", "2,b", "0,a")
    assert runs(columns).tolist() == ["b", "b", "a"]
    assert columns.notes == []


def test_a_run_may_not_come_back_after_another() -> None:
    expected = r"line 5, column run: rows out of time order: run 'b' ended at line 3 and"
    with pytest.raises(InputFileError, match=expected):
        runs(columns_of("run", "b", "b", "a", "b"))


def test_every_row_has_the_name_of_a_run() -> None:
    with pytest.raises(InputFileError, match=r"line 3, column run: .* got an empty cell"):
        runs(columns_of("run,t_s", "a,0", ",1"))


def test_a_file_without_times_has_none() -> None:
    columns = columns_of("run", "a")
    assert times(columns, runs(columns)) is None


@pytest.mark.parametrize(("name", "cells", "seconds"), [
    ("t_s", ("0.5", "0.5", "-3"), [0.5, 0.5, -3.0]),
    ("t_ms", ("1500", "2000", "250"), [1.5, 2.0, 0.25]),
    ("t_s", NIGHT, [0.0, 0.5, 45.0]),
])  # fmt: skip
def test_times_are_seconds_and_start_again_with_each_run(
    name: str, cells: tuple[str, ...], seconds: list[float]
) -> None:
    columns = columns_of(f"run,{name}", f"a,{cells[0]}", f"a,{cells[1]}", f"b,{cells[2]}")
    found = times(columns, runs(columns))
    assert found is not None and found.tolist() == seconds


def test_times_of_two_runs_may_both_begin_at_zero_but_one_run_may_not_go_back() -> None:
    columns = columns_of("t_s", "0", "2", "0", "2")
    assert times(columns, np.array(["a", "a", "b", "b"])) is not None
    expected = r"line 4, column t_s: .* expected 2 s or later within run 'a', got 0 s"
    with pytest.raises(InputFileError, match=expected):
        times(columns, np.array(["a", "a", "a", "b"]))


def test_times_of_day_that_go_back_are_shown_as_they_are_written() -> None:
    columns = columns_of("t_s", NIGHT[2], NIGHT[0])
    expected = rf"expected {NIGHT[2]} or later within run 'all', got {NIGHT[0]}; sort"
    with pytest.raises(InputFileError, match=expected):
        times(columns, runs(columns))


@pytest.mark.parametrize("name", ["t_s", "t_ms"])
def test_a_note_tells_from_when_times_of_day_count_and_in_which_column(name: str) -> None:
    columns = columns_of(name, *NIGHT)
    times(columns, np.full(3, "all"))
    assert columns.notes == [f"Column {name} holds times of day: counted from '{NIGHT[0]}'."]


def test_time_zones_count() -> None:
    """The clocks go forward: from half past one to three o'clock are 30 minutes."""
    columns = columns_of("t_s", "2024-03-31T01:30:00+01:00", "2024-03-31T03:00:00+02:00")
    assert times_of_day(columns.table, 0).tolist() == [0.0, 1800.0]
    assert began(columns.table, 0) == datetime(2024, 3, 31, 0, 30, tzinfo=UTC)


@pytest.mark.parametrize("cells", [
    ("2024-03-31T01:30:00Z", "2024-03-31T01:30:01"),
    ("2024-03-31T01:30:00", "2024-03-31T01:30:01Z"),
])  # fmt: skip
def test_a_time_zone_stands_in_every_row_or_in_none(cells: tuple[str, str]) -> None:
    expected = rf"line 3, column t_s: .* in none, got '{cells[1]}' after '{cells[0]}'$"
    with pytest.raises(InputFileError, match=expected):
        times_of_day(columns_of("t_s", *cells).table, 0)


@pytest.mark.parametrize(("cell", "moment"), [
    ("2024-03-01", datetime(2024, 3, 1)),
    ("20240301T121530", datetime(2024, 3, 1, 12, 15, 30)),
    ("2024-03-01 12:15", datetime(2024, 3, 1, 12, 15)),
    ("20240301", None),
    ("1709290000", None),
    ("12:15:30", None),
    ("-3.5", None),
])  # fmt: skip
def test_a_date_is_a_moment_and_digits_alone_are_a_number(
    cell: str, moment: datetime | None
) -> None:
    assert began(columns_of("t_s", cell).table, 0) == moment


@pytest.mark.parametrize(("cells", "line"), [
    (("2024-13-01T00:00:00",), 2),
    (("2024-02-30",), 2),
    (("2024-03-01T00:00:00", "2024-03-01T00:60:00"), 3),
    (("2024-03-01T00:00:00", "12.5"), 3),
    (("2024-03-01T00:00:00", ""), 3),
])  # fmt: skip
def test_what_looks_like_a_moment_but_is_none_is_refused(cells: tuple[str, ...], line: int) -> None:
    columns = columns_of("t_s", *cells)
    expected = rf"line {line}, column t_s: expected a time in ISO 8601, .*, got '{cells[-1]}'$"
    with pytest.raises(InputFileError, match=expected):
        times(columns, np.full(len(cells), "all"))


def test_temperatures_are_celsius_and_may_be_left_out_altogether() -> None:
    assert temperatures(columns_of("t_s", "1")) is None
    found = temperatures(columns_of("temperature_C", "-100", "0", "200"))
    assert found is not None and found.tolist() == [-100.0, 0.0, 200.0]


@pytest.mark.parametrize(("cell", "said"), [
    ("-100.5", "from -100 to 200 C, got -100.5 C"),
    ("293.15", r"from -100 to 200 C, got 293\.15 C"),
    ("", "got an empty cell"),
])  # fmt: skip
def test_temperatures_that_no_cable_bears_are_refused(cell: str, said: str) -> None:
    columns = columns_of("t_s,temperature_C", "0,20", f"1,{cell}")
    with pytest.raises(InputFileError, match=rf"line 3, column temperature_C: .*{said}"):
        temperatures(columns)
