"""The runs of a file, its clock and its thermometer: names, seconds or times of day, Celsius."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from seecr.columns.known import Columns
from seecr.columns.table import show
from seecr.errors import InputFileError
from seecr.pose import Array

# A date, and a time of day or none.
_ISO = re.compile(r"\d{4}-?\d\d-?\d\d([T ]\d.*)?")
_ABSOLUTE_ZERO_C = -273.15


def runs(columns: Columns) -> NDArray[np.str_]:
    """Names of the runs (n,); "all" where the file has no such column.

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
        InputFileError: a cell that is no time, or rows of a run (n,) out of time order.
    """
    if "t" not in columns.known:
        return None
    cells = columns.table.cells[columns.known["t"].index]
    of_day = _ISO.fullmatch(cells[0]) is not None and not cells[0].isdigit()
    t_s = _seconds(columns) if of_day else columns.numbers("t")
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
        InputFileError: a cell that is empty or no temperature.
    """
    if "temperature" not in columns.known:
        return None
    # It acts on the cables in every row, so a gap cannot be passed over like a lost reading.
    celsius = columns.numbers("temperature")
    columns.refuse(
        celsius < _ABSOLUTE_ZERO_C,
        "temperature",
        lambda row: f"expected a temperature above {_ABSOLUTE_ZERO_C} C, got {celsius[row]:g} C",
    )
    return celsius


def _shown(cells: Sequence[str], t_s: Array, row: int, of_day: bool) -> str:
    return cells[row] if of_day else f"{t_s[row]:.9g} s"


def _seconds(columns: Columns) -> Array:
    """Times of day (n,) [s] since the first row's."""
    first = _moment(columns, 0)
    out = np.empty(columns.n_rows)
    for row in range(columns.n_rows):
        now = _moment(columns, row)
        if (now.tzinfo is None) != (first.tzinfo is None):
            text = f"expected a time zone in every row or in none, got {_cell(columns, row)} after "
            raise _error(columns, row, text + _cell(columns, 0))
        out[row] = (now - first).total_seconds()
    columns.notes.append(f"Column t_s holds times of day: counted from {_cell(columns, 0)}.")
    return out


def _moment(columns: Columns, row: int) -> datetime:
    try:
        return datetime.fromisoformat(columns.table.cells[columns.known["t"].index][row])
    except ValueError:
        text = f"expected a time in ISO 8601, as {_cell(columns, 0)} in the first row"
        raise _error(columns, row, f"{text}, got {_cell(columns, row)}") from None


def _cell(columns: Columns, row: int) -> str:
    return show(columns.table.cells[columns.known["t"].index][row])


def _error(columns: Columns, row: int, text: str) -> InputFileError:
    return columns.table.error(text, row=row, column=columns.known["t"].name)
