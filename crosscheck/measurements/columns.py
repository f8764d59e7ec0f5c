"""What the columns of measurements mean: names, units, and which belong together.

A name is a quantity and, after the last underscore, its unit: ``cmd_x_mm``, ``length_3_m``.
Quaternions (``cmd_qw``) have no unit. Columns of other names are kept out and named as unused.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from crosscheck.measurements.table import Table, show
from crosscheck.units import Unit, of_columns

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ANGLES = ("rx", "ry", "rz")

_Units = dict[str, Unit]

_PURE = Unit("", "")
_LENGTH, _ANGLE = of_columns("m"), of_columns("rad")
_SECONDS, _NEWTONS, _CELSIUS = of_columns("s"), of_columns("N"), of_columns("C")
_NO_UNIT: _Units = {"": _PURE}

_QUANTITY = re.compile(
    r"(t|temperature|run|(?:cmd|meas)_(?:q[wxyz]|r?[xyz])|(?:length|tension)_\d+)(?:_([^_]*))?"
)
# "t" begins many other names; only these endings are surely meant as a unit of time.
_TIME_UNITS = {"", "ms", "us", "ns", "sec", "min", "h", "S"}
# What others call a column, where the spelling is not close enough to be guessed from.
_ALIASES = {"time": "t_s", "time_s": "t_s", "timestamp": "t_s", "temp_c": "temperature_C"}


@dataclass(frozen=True)
class Column:
    """One known column: its name and place in the file, and the unit of its numbers."""

    name: str
    index: int
    unit: Unit


@dataclass(frozen=True)
class Header:
    """Known columns by quantity (``"cmd_x"``, ``"length_3"``), and what was left over."""

    columns: dict[str, Column]
    unused: tuple[str, ...]
    notes: tuple[str, ...]

    def present(self, prefix: str, parts: Sequence[str]) -> tuple[str, ...]:
        """Those of the parts that have a column ``prefix_part``."""
        return tuple(part for part in parts if f"{prefix}_{part}" in self.columns)

    def cables(self, prefix: str) -> tuple[int, ...]:
        """Numbers, from 1, of the cables that have a column ``prefix_i``."""
        start = f"{prefix}_"
        return tuple(sorted(int(q[len(start) :]) for q in self.columns if q.startswith(start)))


def parse_header(table: Table, n_cables: int) -> Header:
    """Know the columns of a table for a robot with ``n_cables`` cables.

    Raises:
        InputFileError: missing or unknown unit, repeated column, a cable that the robot has
            not, no header at all, two ways of saying the same.
    """
    _check_is_header(table)
    columns: dict[str, Column] = {}
    unused = []
    seen: dict[str, int] = {}
    for index, name in enumerate(table.names):
        if name and name in seen:
            text = f"repeated header, columns {seen[name] + 1} and {index + 1}; expected each once"
            raise table.error(f"{text}; rename or remove one", column=name)
        seen[name] = index
        known = _parse_name(table, name, n_cables)
        if known is None:
            unused.append(name or f"(column {index + 1}, without a name)")
            continue
        quantity, unit = known
        if quantity in columns:
            other = columns[quantity].name
            raise table.error(f"says the same as {other}; expected one of the two", column=name)
        columns[quantity] = Column(name, index, unit)
    header = Header(columns, tuple(unused), _unused_notes(unused, columns, n_cables))
    _check_one_way(table, header)
    return header


def near_misses(header: Header) -> str:
    """`` (NOTE; NOTE)`` of misspelt columns, for errors about a column that is not there."""
    close = [note.rstrip(".") for note in header.notes if "did you mean" in note]
    return f" ({'; '.join(close)})" if close else ""


def _check_is_header(table: Table) -> None:
    numbers = [name for name in table.names if re.fullmatch(r"[+-]?\d*\.?\d+(e[+-]?\d+)?", name)]
    if numbers:
        raise table.error(
            f"expected a header row with column names such as cmd_x_m, got the number "
            f"{show(numbers[0])}; put the names in the first row, without a # before them"
        )


def _parse_name(table: Table, name: str, n_cables: int) -> tuple[str, Unit] | None:
    match = _QUANTITY.fullmatch(name)
    if match is None:
        return None
    quantity, unit = match[1], match[2]
    if quantity == "run":
        return None if unit is not None else ("run", _PURE)
    if quantity == "t" and unit != "s" and (unit or "") not in _TIME_UNITS:
        return None
    units = _units_of(quantity)
    if (unit or "") not in units:
        raise table.error(_unit_fault(quantity, unit, units), column=name)
    _check_cable(table, quantity, name, n_cables)
    return quantity, units[unit or ""]


def _units_of(quantity: str) -> _Units:
    if quantity == "t":
        return _SECONDS
    if quantity == "temperature":
        return _CELSIUS
    if quantity.startswith("tension_"):
        return _NEWTONS
    last = quantity.rpartition("_")[2]
    if last in QUATERNION:
        return _NO_UNIT
    return _ANGLE if last in ANGLES else _LENGTH


def _unit_fault(quantity: str, unit: str | None, units: _Units) -> str:
    if "" in units:
        return f"a quaternion has no unit, got {show(unit or '')}; expected {quantity}"
    expected = " or ".join(f"{quantity}_{known}" for known in units)
    fault = f"unknown unit {show(unit)}" if unit else "missing unit"
    return f"{fault}; expected {expected}"


def _check_cable(table: Table, quantity: str, name: str, n_cables: int) -> None:
    prefix, _, number = quantity.rpartition("_")
    if prefix not in ("length", "tension"):
        return
    if not 1 <= int(number) <= n_cables or number.startswith("0"):
        raise table.error(
            f"there is no cable {number}; the robot has {n_cables} cables, expected "
            f"{prefix}_1 to {prefix}_{n_cables}",
            column=name,
        )


def _known_names(n_cables: int) -> list[str]:
    """Every name a column may have, usual unit first."""
    quantities = ["t", *(f"cmd_{p}" for p in POSITION + QUATERNION + ANGLES)]
    quantities += [f"meas_{p}" for p in POSITION + QUATERNION + ANGLES]
    quantities += [f"{p}_{i}" for p in ("length", "tension") for i in range(1, n_cables + 1)]
    names = ["run"]
    for quantity in [*quantities, "temperature"]:
        names += [f"{quantity}_{unit}" if unit else quantity for unit in _units_of(quantity)]
    return names


def _unused_notes(
    unused: Sequence[str], columns: dict[str, Column], n_cables: int
) -> tuple[str, ...]:
    absent = {n.lower(): n for n in _known_names(n_cables) if not _is_taken(n, columns)}
    absent |= {alias: n for alias, n in _ALIASES.items() if not _is_taken(n, columns)}
    notes = []
    for name in unused:
        close = difflib.get_close_matches(name.lower(), absent, n=1, cutoff=0.75)
        if close:
            meant = absent[close[0]]
            notes.append(f"Column {show(name)} is not used; did you mean {meant}?")
    return tuple(notes)


def _is_taken(name: str, columns: dict[str, Column]) -> bool:
    match = _QUANTITY.fullmatch(name)
    return match is not None and match[1] in columns


def _check_one_way(table: Table, header: Header) -> None:
    for prefix in ("cmd", "meas"):
        quats, angles = header.present(prefix, QUATERNION), header.present(prefix, ANGLES)
        if quats and angles:
            a, b = (header.columns[f"{prefix}_{p[0]}"].name for p in (quats, angles))
            raise table.error(f"orientation twice, as {a} and as {b}; expected one of the two ways")
    poses = header.present("cmd", POSITION + QUATERNION + ANGLES)
    lengths = header.cables("length")
    if poses and lengths:
        a = header.columns[f"cmd_{poses[0]}"].name
        b = header.columns[f"length_{lengths[0]}"].name
        raise table.error(f"commands twice, as {a} and as {b}; expected poses or lengths, not both")
