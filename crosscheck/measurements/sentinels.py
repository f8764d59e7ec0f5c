"""Readings that no instrument measured: numbers that stand for "not read", and absurd ones."""

from __future__ import annotations

import numpy as np

from seecr.columns.known import ANGLES, POSITION, Columns
from seecr.description.robot import Robot

# Positions farther than this many times the frame's reach are no readings, even where a tracker
# reports them in the coordinates of its hall; nor are angles [rad] of more than ten turns.
_FAR, _TURNS = 100.0, 10.0 * 2.0 * np.pi
# At least so many nines, such as 999 or -99999, and nothing else, are what programs write for "not
# read"; so many equal rows show it.
_NINES, _ROWS = 3, 4

_REMEDY = "leave the cells empty where nothing was read"
_SURVEY = ", and subtract a constant from coordinates in a survey's grid"


def refuse_sentinels(columns: Columns, robot: Robot) -> None:
    """Refuse readings that cannot be any.

    Raises:
        InputFileError: with the line and column of the first.
    """
    far = _FAR * robot.reach
    near = f"within {far:.3g} m of the robot"
    for axis, home in zip(POSITION, robot.reference_pose[:3], strict=True):
        _refuse_beyond(columns, f"meas_{axis}", float(home), far, near, _SURVEY)
    for angle in ANGLES:
        _refuse_beyond(columns, f"meas_{angle}", 0.0, _TURNS, "of at most ten turns")
    tensions = [f"tension_{i + 1}" for i in range(robot.n_cables)]
    for quantity in (*(f"meas_{part}" for part in (*POSITION, *ANGLES)), *tensions):
        if quantity in columns.known:
            _refuse_nines(columns, quantity)


def _refuse_beyond(
    columns: Columns, quantity: str, home: float, most: float, where: str, more: str = ""
) -> None:
    if quantity not in columns.known:
        return
    column, values = columns.known[quantity], columns.numbers(quantity, blank_is_nan=True)
    given = columns.table.numbers(column.index, blank_is_nan=True)

    def said(row: int) -> str:
        text = f"expected a reading {where}, got {given[row]:.10g} {column.unit.suffix}; "
        if column.unit.suffix == "m" and abs(1e-3 * values[row] - home) <= most / _FAR:
            text += f"if it is in mm, name the column {quantity}_mm; "
        return f"{text}{_REMEDY}{more}"

    columns.refuse(np.abs(values - home) > most, quantity, said)


def _refuse_nines(columns: Columns, quantity: str) -> None:
    """Refuse a column that says the same number of nines in every row that it has."""
    column = columns.known[quantity]
    given = columns.table.numbers(column.index, blank_is_nan=True)
    read = given[np.isfinite(given)]
    if len(read) < _ROWS or np.ptp(read) > 0.0 or not is_nines(float(read[0])):
        return
    columns.refuse(
        np.isfinite(given),
        quantity,
        lambda row: f"expected readings, got {given[row]:g} in every row; {_REMEDY}",
    )


def is_nines(value: float) -> bool:
    """Whether a number is what programs write for "not read"."""
    digits = f"{abs(value):.12g}"
    return len(digits) >= _NINES and set(digits) == {"9"}
