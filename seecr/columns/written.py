"""The text of a CSV, as :mod:`seecr.columns.table` reads it: every file of rows is written here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from seecr.pose import Array

__all__ = ["table_text"]


def table_text(columns: Mapping[str, Sequence[Any] | Array], digits: int | None = None) -> str:
    """A table as CSV; numbers that are missing or not finite are empty cells.

    Args:
        columns: the values of each column by its name, all of one length.
        digits: significant digits of numbers; all of them by default.
    """
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(_cell(value, digits) for value in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def _cell(value: object, digits: int | None) -> str:
    if isinstance(value, float):
        # adding zero turns -0.0 into 0.0
        number = float(value) + 0.0
        text = repr(number) if digits is None else f"{number:.{digits}g}"
        return text if math.isfinite(number) else ""
    return "" if value is None else _quoted(str(value))


def _quoted(text: str) -> str:
    """Text as a cell; a leading # would make its line a comment."""
    if any(mark in text for mark in ',"\n\r') or text.lstrip().startswith("#"):
        return '"' + text.replace('"', '""') + '"'
    return text
