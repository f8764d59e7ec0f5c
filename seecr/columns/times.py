"""Runs, times and temperatures of a file: names, seconds or times of day, Celsius."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from seecr.columns.known import Columns
from seecr.columns.table import Table, show
from seecr.errors import InputFileError
from seecr.pose import Array

# A date, with or without a time of day.
_ISO = re.compile(r"\d{4}-?\d\d-?\d\d([T ]\d.*)?")
# Temperatures at which no cable robot works.
_COLDEST_C, _WARMEST_C = -100.0, 200.0


def runs(columns: Columns) -> NDArray[np.str_]:
    """Names of the runs (n,); "all" if the file has no such column.

    Raises:
        InputFileError: a row without a name, or a run that comes back after another.
    """
    if "run" not in columns.known:
        columns.notes.append('No column run: all rows count as one run called "all".')
        return np.full(columns.n_rows, "all")
    names = columns.table.cells[columns.known["run"].index]
    last_row: dict[str, int] = {}
    for row, name in enumerate(names):
        if not name:
            text = "expected the name of a run in every row, got an empty cell"
            raise columns.table.error(text, row=row, column="run")
        if last_row.get(name, row - 1) != row - 1:
            raise _run_came_back(columns, name, last_row[name], row)
        last_row[name] = row
    return np.array(names, dtype=np.str_)


def _run_came_back(columns: Columns, name: str, last: int, row: int) -> InputFileError:
    word = "line" if columns.table.header_line is not None else "row"
    text = (
        f"rows out of time order: run {show(name)} ended at {word} {columns.table.line[last]} and "
        "comes back here; expected the rows of a run together, in time order; sort the rows or "
        "rename the run"
    )
    return columns.table.error(text, row=row, column="run")


def times(columns: Columns, run: NDArray[np.str_]) -> Array | None:
    """Times (n,) [s], or None; times of day count from that of the first row.

    Raises:
        InputFileError: a cell that is not a time, or rows of a run (n,) out of time order.
    """
    if "t" not in columns.known:
        return None
    name, index = columns.known["t"].name, columns.known["t"].index
    cells = columns.table.cells[index]
    of_day = began(columns.table, index) is not None
    if of_day:
        columns.notes.append(f"Column {name} holds times of day: counted from {show(cells[0])}.")
    t_s = times_of_day(columns.table, index) if of_day else columns.numbers("t")
    falls = np.concatenate([[False], (np.diff(t_s) < 0) & (run[1:] == run[:-1])])
    columns.refuse(
        falls,
        "t",
        lambda row: (
            f"rows out of time order: expected {_shown(cells, t_s, row - 1, of_day)} or later "
            f"within run {show(str(run[row]))}, got {_shown(cells, t_s, row, of_day)}; sort the "
            "rows by time"
        ),
    )
    return t_s


def temperatures(columns: Columns) -> Array | None:
    """Temperatures (n,) [deg C], or None.

    Raises:
        InputFileError: a cell that is empty, or not a temperature that cables bear.
    """
    if "temperature" not in columns.known:
        return None
    # It affects the cables in every row, so it may not be missing like a reading.
    celsius = columns.numbers("temperature")
    columns.refuse(
        (celsius < _COLDEST_C) | (celsius > _WARMEST_C),
        "temperature",
        lambda row: (
            f"expected a temperature from {_COLDEST_C:g} to {_WARMEST_C:g} C, got "
            f"{celsius[row]:g} C; leave the column out if it was not measured"
        ),
    )
    return celsius


def began(table: Table, index: int) -> datetime | None:
    """The time of day in the first row of a column; None if the column has numbers.

    Raises:
        InputFileError: it looks like a time of day but is not one.
    """
    cell = table.cells[index][0]
    of_day = _ISO.fullmatch(cell) is not None and not cell.isdigit()
    return _moment(table, index, 0) if of_day else None


def times_of_day(table: Table, index: int) -> Array:
    """Seconds (n,) since the first row of a column of times of day.

    Raises:
        InputFileError: a cell that is not a time of day, or has a time zone only if others have
            not.
    """
    cells = table.cells[index]
    first = _moment(table, index, 0)
    out = np.empty(len(cells))
    for row in range(len(cells)):
        now = _moment(table, index, row)
        if (now.tzinfo is None) != (first.tzinfo is None):
            text = f"expected a time zone in every row or in none, got {show(cells[row])} after "
            raise table.error(text + show(cells[0]), row=row, column=table.names[index])
        out[row] = (now - first).total_seconds()
    return out


def _moment(table: Table, index: int, row: int) -> datetime:
    cells = table.cells[index]
    try:
        return datetime.fromisoformat(cells[row])
    except ValueError:
        text = f"expected a time in ISO 8601, as {show(cells[0])} in the first row"
        text = f"{text}, got {show(cells[row])}"
        raise table.error(text, row=row, column=table.names[index]) from None


def _shown(cells: Sequence[str], t_s: Array, row: int, of_day: bool) -> str:
    return cells[row] if of_day else f"{t_s[row]:.9g} s"
