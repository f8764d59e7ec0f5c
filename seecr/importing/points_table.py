"""A table of points: one row a cable, its exit point and its anchor point."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from seecr.columns.csv import Table, read_table, show
from seecr.errors import Faults
from seecr.importing.draft import Draft
from seecr.pose import Array
from seecr.units import Unit, of_columns

_NAME = re.compile(r"(exit_[xyz]|anchor_[xyz]|ea|stiffness)(?:_(.+))?", re.IGNORECASE)
_ENDS = {end: [f"{end}_{axis}" for axis in "xyz"] for end in ("exit", "anchor")}
# Of these a cell may be empty, where it is asked for elsewhere.
_SI = {"ea": "N", "stiffness": "N_per_m"}


def read_points(path: Path) -> Draft:
    """The cables of a CSV: ``exit_x_m`` to ``anchor_z_m``, ``name``, ``ea_N`` or ``stiffness_N_m``.

    Units are those of all files. Without any column of anchor points the platform is one point.

    Raises:
        InputFileError: no such table; all its faults are told at once.
    """
    table = read_table(path)
    faults = Faults()
    columns, unused = _columns(table, faults)
    is_point = not any(name in columns for name in _ENDS["anchor"])
    needed = _ENDS["exit"] if is_point else [*_ENDS["exit"], *_ENDS["anchor"]]
    missing = [f"{name}_m" for name in needed if name not in columns]
    if missing:
        text = "expected a table of points, one row a cable: exit_x_m exit_y_m exit_z_m anchor_x_m "
        text += f"anchor_y_m anchor_z_m; {' '.join(missing)} missing, got {' '.join(table.names)}"
        faults.add(table.error(text))
    values = {name: _numbers(table, name, *place, faults) for name, place in columns.items()}
    nan, zero = np.full(len(table.line), math.nan), np.zeros(len(table.line))
    ea, stiffness = values.get("ea", nan), values.get("stiffness", nan)
    for row in np.flatnonzero(~np.isnan(ea) & ~np.isnan(stiffness)):
        text = "has E S and a stiffness; expected one of the two"
        faults.add(table.error(text, row=int(row)))
    names = _names(table, faults)
    faults.check()
    exits, anchors = (
        np.column_stack([values.get(name, zero) for name in end]) for end in _ENDS.values()
    )
    notes = (f"columns not used: {', '.join(unused)}",) if unused else ()
    return Draft(path, path.stem, exits, anchors, ea, stiffness, names, notes=notes)


def _columns(table: Table, faults: Faults) -> tuple[dict[str, tuple[int, Unit]], list[str]]:
    """The index and unit of each known column, and the names of the others."""
    known: dict[str, tuple[int, Unit]] = {}
    unused = [name or "(one without a name)" for name in table.names if not _NAME.fullmatch(name)]
    for index, name in enumerate(table.names):
        match = _NAME.fullmatch(name)
        if match is None:
            continue
        quantity, suffix = match[1].lower(), match[2] or ""
        units = of_columns(_SI.get(quantity, "m"))
        if quantity in known:
            faults.add(table.error(f"repeats {quantity}; expected it once", column=name))
        elif suffix not in units:
            fault = f"unknown unit {show(suffix)}" if suffix else "missing unit"
            options = " or ".join(f"{quantity}_{unit}" for unit in units)
            faults.add(table.error(f"{fault}; expected {options}", column=name))
        known.setdefault(quantity, (index, units.get(suffix, Unit("", ""))))
    return known, [name for name in unused if name.lower() != "name"]


def _numbers(table: Table, quantity: str, index: int, unit: Unit, faults: Faults) -> Array:
    """One column (m,) in SI; NaN for what is wrong, and for empty cells where these may be."""
    optional, column = quantity in _SI, table.names[index]
    values = faults.of(lambda: table.numbers(index, blank_is_nan=optional))
    if values is None:
        return np.full(len(table.line), math.nan)
    for row in np.flatnonzero(values <= 0.0).tolist() if optional else ():
        text = f"expected a number above zero, got {show(table.cells[index][row])}"
        faults.add(table.error(text, row=row, column=column))
    return np.asarray(unit.to_si(values))


def _names(table: Table, faults: Faults) -> tuple[str, ...]:
    """The cables' names, which must differ; none without a column for them."""
    index = next((k for k, name in enumerate(table.names) if name.lower() == "name"), None)
    names = () if index is None else tuple(table.cells[index])
    for row, name in enumerate(names):
        if not name or name in names[:row]:
            got = f"{show(name)} again" if name else "an empty cell"
            text = f"expected a name of its own, got {got}"
            faults.add(table.error(text, row=row, column="name"))
    return names
