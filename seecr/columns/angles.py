"""Angles in columns of radians that are degrees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seecr.columns.known import Columns

# Orientations are within a turn [rad], to the rounding of what is written; degrees are, too.
_TURN, _TURN_DEG = 2.0 * np.pi + 1e-3, 360.0


def refuse_degrees(columns: Columns, prefix: str, angles: Sequence[str]) -> None:
    """Refuse columns of orientations in radians that go beyond a whole turn.

    Readings beyond a turn in degrees, too, are left to those who look for what nobody measured.

    Raises:
        InputFileError: with line and column of the first.
    """
    for angle in angles:
        quantity = f"{prefix}_{angle}"
        column = columns.known.get(quantity)
        if column is None or column.unit.suffix != "rad":
            continue
        size = np.abs(columns.numbers(quantity, blank_is_nan=prefix != "cmd"))
        if prefix == "meas" and np.any(size > _TURN_DEG):
            continue
        given = columns.table.cells[column.index]
        columns.refuse(
            size > _TURN,
            quantity,
            lambda row, given=given, quantity=quantity: (  # type: ignore[misc]
                f"expected radians within one turn, at most 6.283, got {given[row]}, as if in "
                f"degrees; name the column {quantity}_deg, or, if it counts turns, subtract whole "
                "ones"
            ),
        )
