"""Lines and columns that several commands print alike: values with units, rms errors by kind."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.fit.least_squares.problem import KINDS, Kind, Rms
from crosscheck.fit.words import value_lines
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.units import without_rounding

_WIDE = 160


def heading(kind: Kind) -> str:
    """Over a column of its errors."""
    return f"{kind.name}\n[{kind.unit}]"


def cell(kind: Kind, rms: Rms) -> str:
    """Its rms error in the unit of the heading, or a dash."""
    value = rms.get(kind.key)
    return "-" if value is None else four_digits(kind.factor * value)


def four_digits(value: float) -> str:
    """A number in a unit of people; what rounding leaves of 0 is 0."""
    return f"{without_rounding(value):.4g}"


def console_for(console: Console | None, notes: Iterable[str] = ()) -> Console:
    """The console to print on, notes on it; wide where nobody's screen is the limit."""
    console = console or Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, _WIDE)
    for note in notes:
        say(console, f"note: {note}", "dim")
    return console


def say(console: Console, line: str, style: str = "") -> None:
    """One line, never broken: people search and pipe them."""
    console.print(Text(line, style=style), soft_wrap=True)


def print_parameters(
    console: Console, layout: Layout, values: Array, stderr: Array,
    stopped: NDArray[np.bool_], most: int, file: str,
) -> None:  # fmt: skip
    """A line for each of an effect's parameters, ``most`` of them; the rest are in ``file``."""
    lines = list(value_lines(layout, values, stderr, stopped))
    for line in lines[:most]:
        say(console, f"  {line}")
    if len(lines) > most:
        say(console, f"  and {len(lines) - most} more in {file}")


def rms_table(rows: Sequence[tuple[str, Rms, str]]) -> Table:
    """A table of rms errors: name, errors by kind and style of each row.

    Kinds that were not read have no column.
    """
    kinds = [k for k in KINDS if any(rms.get(k.key) is not None for _name, rms, _style in rows)]
    table = table_of(["rms error", *(heading(k) for k in kinds)])
    for name, rms, style in rows:
        table.add_row(Text(name), *(cell(k, rms) for k in kinds), style=style)
    return table


def table_of(heads: Sequence[str]) -> Table:
    """A plain table, words on the left and numbers on the right.

    Headings are texts as they stand: a bare "[mm]" would be taken for a style and vanish.
    """
    table = Table(box=None, header_style="bold", pad_edge=False)
    for i, head in enumerate(heads):
        table.add_column(Text(head), justify="right" if i else "left")
    return table
