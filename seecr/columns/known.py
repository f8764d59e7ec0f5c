"""What the columns of commands and measurements mean: names, units, and which belong together.

A name is a quantity and, after the last underscore, its unit: ``cmd_x_mm``, ``length_3_m``. Cables
have their number in the MJCF or, if that is not a number, their tendon's name: ``length_left_m``.
Quaternions (``cmd_qw``) have no unit. Columns with other names are ignored and listed as unused.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from seecr.columns.csv import Table, show
from seecr.columns.headers import QUANTITY, foreign, numbered_headers, spelled
from seecr.counted import counted, some
from seecr.errors import Faults, InputFileError
from seecr.pose import Array
from seecr.units import Unit, of_columns

# Column names that are close to known ones, and names that only look alike.

# Other programs' names for a column, if the spelling is not close enough to guess.
_ALIASES = {"time": "t_s", "time_s": "t_s", "timestamp": "t_s", "temp_c": "temperature_C"}
# Similarity from which a name may be a misspelt one.
_NEAR = 0.75
_ROTATION = re.compile(
    r"roll|pitch|yaw|euler|heading|rotvec|rodrigues|(?:^|_)(?:phi|theta|psi|rot)(?:_|$)",
    re.IGNORECASE,
)
_OF_CABLE = re.compile(r"(length|tension)_(.+)")
# So much of a name that it would be a column, if it were a cable's; results have others besides.
_OF_NO_CABLE = re.compile(r"(length|tension)_(?!\d+_)[^_]+(_(m|cm|mm|um|N|kN))?")
OUR_ROTATIONS = (
    "a rotation is meas_rx_deg meas_ry_deg meas_rz_deg with R = Rx(rx) Ry(ry) Rz(rz), or the "
    "quaternion meas_qw meas_qx meas_qy meas_qz"
)


def meant_by(unused: Sequence[str], absent: Sequence[str]) -> dict[str, str]:
    """For unused names that are close to a missing one, that name.

    Only the spelling may differ: what distinguishes one known name from another (the axis, the
    cable) has to be in the name.
    """
    ours = {name.lower(): name for name in absent}
    ours |= {alias: name for alias, name in _ALIASES.items() if name in absent}
    # most names have not the parts of any other: only few are compared, which takes long
    alike: dict[frozenset[str], list[str]] = {}
    for one in ours:
        alike.setdefault(frozenset() if one in _ALIASES else _distinct(one), []).append(one)
    found = {}
    for name in unused:
        if _ROTATION.search(name):
            continue
        parts = _distinct(name)
        may = [one for own, those in alike.items() if own <= parts for one in those]
        if near := difflib.get_close_matches(name.lower(), may, n=1, cutoff=_NEAR):
            found[name] = ours[near[0]]
    return found


def _distinct(name: str) -> frozenset[str]:
    """The distinguishing parts of a name: x, qw, rz, the number of a cable."""
    parts = re.split(r"[\W_]+|(?<=\D)(?=\d)|(?<=\d)(?=\D)", name.lower())
    whole = {part for part in parts if re.fullmatch(r"q[wxyz]|r?[xyz]|\d+", part)}
    # as in cmdx_m, with the axis attached to the word
    stuck = {part[-1] for part in parts if re.fullmatch(r"[a-pr-z]{2,}[xyz]", part)}
    return frozenset(whole | stuck)


def other_rotations(unused: Sequence[str]) -> list[str]:
    """Names of rotations by words that have different meanings for different people."""
    return [name for name in unused if _ROTATION.search(name)]


def numbered(name: str, cables: Sequence[str]) -> str:
    """The name of a column with the number of its cable, from 1, in place of the cable's name.

    Other names stay as they are. A cable whose name is a number has no name here: numbers are those
    in the order of the robot's description.
    """
    match = _OF_CABLE.fullmatch(name)
    if match is None:
        return name
    prefix, rest = match[1], match[2]
    meant = [
        (number, rest.removeprefix(cable))
        for number, cable in enumerate(cables, start=1)
        if rest.startswith(cable) and not cable.isdigit()
    ]
    fits = [one for one in meant if re.fullmatch(r"(_[^_]*)?", one[1])]
    if not fits:
        return name
    # of cables a and a_m the first is meant where that leaves a unit, else the longer name
    number, unit = min(fits, key=lambda one: (not one[1], len(one[1])))
    return f"{prefix}_{number}{unit}"


def of_no_cable(unused: Sequence[str]) -> list[str]:
    """Names of lengths or tensions of no cable that the robot has."""
    return [name for name in unused if _OF_NO_CABLE.fullmatch(name)]


def no_cable_note(names: Sequence[str], cables: Sequence[str]) -> list[str]:
    """The sentence about :func:`of_no_cable`, which names the cables that there are."""
    if not names or not cables:
        return unused_note(names, [])
    word, verb = ("Column", "is") if len(names) == 1 else ("Columns", "are")
    numbers = ", ".join(f"{k} ({cable})" for k, cable in enumerate(cables, start=1))
    return [
        f"{word} {', '.join(names)} {verb} not used: the robot's cables are {numbers}, by number "
        "or name."
    ]


def question(name: str, meant: str) -> str:
    """The question about a name that is close to a known one."""
    return f"Column {show(name)} is not used; did you mean {meant}?"


def unused_note(names: Sequence[str], rotations: Sequence[str]) -> list[str]:
    """Sentences that list the columns without a known meaning."""
    notes = []
    if rotations:
        word = "Column" if len(rotations) == 1 else "Columns"
        verb = "is" if len(rotations) == 1 else "are"
        listed = " ".join(rotations)
        notes.append(
            f"{word} {listed} {verb} not used, because roll, pitch and yaw have several "
            f"conventions: here {OUR_ROTATIONS}."
        )
    if names:
        notes.append(f"Not used: {some(names, _MOST_NAMES)}.")
    return notes


# Most columns that a note about unused ones names.
_MOST_NAMES = 40
# Most further lines that an error names.
_MOST_LINES = 8

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ANGLES = ("rx", "ry", "rz")

# Many other names begin with these; only the listed suffixes are certain to be meant as units.
_SURE_UNITS = {
    "t": {"", "s", "ms", "us", "ns", "sec", "min", "h", "S"},
    "payload": {"", "kg", "g", "mg", "t", "lb", "lbs", "oz", "N", "Kg", "KG"},
    "run": {""},
}


@dataclass(frozen=True)
class Column:
    """A known column: its name and index in the file, and the unit of its numbers."""

    name: str
    index: int
    unit: Unit


@dataclass(frozen=True, eq=False)
class Columns:
    """The known columns of a table, as numbers in SI units.

    Attributes:
        table: the cells. known: columns by quantity (``"cmd_x"``, ``"length_3"``).
        unused: names of the others. meant: for those close to a missing name, that name.
        notes: sentences for the reader, collected while reading. named: names of the cables.
    """

    table: Table
    known: dict[str, Column]
    unused: tuple[str, ...]
    meant: dict[str, str]
    notes: list[str] = field(default_factory=list)
    named: tuple[str, ...] = ()

    @property
    def n_rows(self) -> int:
        """Number of rows n."""
        return len(self.table.line)

    def present(self, prefix: str, parts: Sequence[str]) -> tuple[str, ...]:
        """Those of the parts that have a column ``prefix_part``."""
        return tuple(part for part in parts if f"{prefix}_{part}" in self.known)

    def cables(self, prefix: str) -> tuple[int, ...]:
        """Numbers, from 1, of the cables that have a column ``prefix_i``."""
        start = f"{prefix}_"
        return tuple(sorted(int(q.removeprefix(start)) for q in self.known if q.startswith(start)))

    def numbers(self, quantity: str, *, blank_is_nan: bool = False) -> Array:
        """One column (n,) in SI units."""
        column = self.known[quantity]
        return column.unit.to_si(self.table.numbers(column.index, blank_is_nan=blank_is_nan))

    def all_numbers(self, quantities: Sequence[str], *, blank_is_nan: bool = False) -> Array:
        """Several columns (n, k) in SI units; an error tells the mistakes of all of them."""
        values, faults = np.full((self.n_rows, len(quantities)), np.nan), Faults()
        for k, quantity in enumerate(quantities):
            column = faults.of(lambda q: self.numbers(q, blank_is_nan=blank_is_nan), quantity)
            if column is not None:
                values[:, k] = column
        faults.check()
        return values

    def readings(self, prefix: str, parts: Sequence[str]) -> Array:
        """Columns ``prefix_part`` (n, k) in SI units; NaN for a missing column or an empty cell."""
        there = [k for k, part in enumerate(parts) if f"{prefix}_{part}" in self.known]
        if not there:  # one number, shown so many times
            return np.broadcast_to(np.nan, (self.n_rows, len(parts)))
        values = np.full((self.n_rows, len(parts)), np.nan)
        quantities = [f"{prefix}_{parts[k]}" for k in there]
        values[:, there] = self.all_numbers(quantities, blank_is_nan=True)
        for k, part in enumerate(parts):
            quantity = f"{prefix}_{part}"
            if quantity in self.known and np.all(np.isnan(values[:, k])):
                name = self.known[quantity].name
                self.notes.append(f"Column {name} is empty: not measured.")
        return values

    def refuse(self, wrong: NDArray[np.bool_], quantity: str, text: Callable[[int], str]) -> None:
        """Raise an error at the first row that is ``wrong`` (n,), if any, which names the others.

        If all rows are, it is no matter of single rows, and none is named.
        """
        if not np.any(wrong):
            return
        row, *others = np.flatnonzero(wrong).tolist()
        said = text(row)
        if others and not np.all(wrong):
            lines = some([str(self.table.line[k]) for k in others], _MOST_LINES)
            said += f" (also at {self.table.word} {lines})"
        raise self.table.error(said, row=row, column=self.known[quantity].name)

    def half_there(self, what: str, missing: Sequence[str], need: str) -> InputFileError:
        """The error about an incomplete group of columns."""
        text = f"incomplete {what} columns: expected {need}, {' '.join(missing)} missing"
        return self.table.error(text + self.near_misses())

    def near_misses(self) -> str:
        """`` (NOTE; NOTE)`` about misspelt columns, for errors about a missing column."""
        notes = [question(name, meant) for name, meant in self.meant.items()]
        notes += unused_note([], other_rotations(self.unused))
        lost = of_no_cable([name for name in self.unused if name not in self.meant])
        notes += no_cable_note(lost, self.named)
        return f" ({'; '.join(note.rstrip('.') for note in notes)})" if notes else ""


def know_columns(table: Table, n_cables: int, cables: Sequence[str] = ()) -> Columns:
    """Identify the columns of a table; cables may have their names in place of a number.

    Raises:
        InputFileError: missing or unknown units, repeated columns, cables that the robot does not
            have, no header, or the same quantity given in two ways.
    """
    _check_names(table)
    known: dict[str, Column] = {}
    unused, faults = list[str](), Faults()
    for index, ours in enumerate(foreign(table)):
        name = table.names[index]
        try:
            found = _parse_name(table, name, ours, n_cables, cables)
        except InputFileError as fault:
            faults.add(fault)
            continue
        if found is None:
            unused.append(name or f"(column {index + 1}, without a name)")
            continue
        quantity, unit = found
        if quantity in known:
            text = f"says the same as {known[quantity].name}; expected only one of the two"
            faults.add(table.error(text, column=name))
        known.setdefault(quantity, Column(name, index, unit))
    meant = meant_by(unused, _absent(known, n_cables))
    turned = other_rotations(unused)
    lost = of_no_cable([name for name in unused if name not in meant])
    told = {*meant, *turned, *lost}
    rest = [name for name in unused if name not in told]
    notes = [*table.notes, *(question(name, near) for name, near in meant.items())]
    notes += [*no_cable_note(lost, cables), *unused_note(rest, turned)]
    columns = Columns(table, known, tuple(unused), meant, notes, tuple(cables))
    faults.of(_check_one_way, columns)
    faults.check()
    return columns


def _check_names(table: Table) -> None:
    """Check that there is a header, without repeated names."""
    numbers = [name for name in table.names if re.fullmatch(r"[+-]?\d*\.?\d+(e[+-]?\d+)?", name)]
    if numbers and not numbered_headers(list(table.names)):
        raise table.error(
            f"expected a header row with column names such as cmd_x_m, got the number "
            f"{show(numbers[0])}; put the names in the first row, without a # before them"
        )
    faults, places = Faults(), dict[str, int]()
    for index, name in enumerate(table.names):
        first = places.setdefault(name, index)
        if name and first < index:
            text = f"repeated header, columns {first + 1} and {index + 1}; expected each once"
            faults.add(table.error(f"{text}; rename or remove one", column=name))
    faults.check()


def _parse_name(
    table: Table, name: str, ours: str, n_cables: int, cables: Sequence[str]
) -> tuple[str, Unit] | None:
    """The quantity and unit of a column with its name in the file and in our terms."""
    match = QUANTITY.fullmatch(spelled(numbered(spelled(ours), cables)))
    if match is None:
        return None
    quantity, suffix = match[1], match[2] or ""
    if suffix not in _SURE_UNITS.get(quantity, {suffix}):
        return None
    units = of_columns(_si_of(quantity))
    if suffix not in units:
        shown = ours.removesuffix(f"_{suffix}") if suffix else ours
        meant = f"{name}={quantity}_{next(iter(units))}"
        hint = "" if suffix or "" in units else f"; or say it, such as --columns {meant}"
        raise table.error(_unit_fault(shown, suffix, units) + hint, column=name)
    _check_cable(table, quantity, name, n_cables)
    return quantity, units[suffix]


def _si_of(quantity: str) -> str:
    """The SI unit of a quantity; "" for names of runs and parts of quaternions."""
    if quantity in _SI:
        return _SI[quantity]
    prefix, _, last = quantity.rpartition("_")
    if prefix in _SI:
        return _SI[prefix]
    if last in QUATERNION:
        return ""
    return "rad" if last in ANGLES else "m"


# SI units of quantities, or of all quantities with a prefix.
_SI = {
    "run": "", "t": "s", "temperature": "C", "payload": "kg", "payload_x": "m", "payload_y": "m",
    "payload_z": "m", "tension": "N", "length": "m", "force": "N", "moment": "Nm",
}  # fmt: skip


def _unit_fault(quantity: str, suffix: str, units: dict[str, Unit]) -> str:
    if "" in units:
        return f"a quaternion has no unit, got {show(suffix)}; expected {quantity}"
    *others, last = [f"{quantity}_{unit}" for unit in units]
    expected = f"{', '.join(others)} or {last}" if others else last
    fault = f"unknown unit {show(suffix)}" if suffix else "missing unit"
    return f"{fault}; expected {expected}"


def _check_cable(table: Table, quantity: str, name: str, n_cables: int) -> None:
    prefix, _, number = quantity.rpartition("_")
    if prefix not in ("length", "tension"):
        return
    if not 1 <= int(number) <= n_cables or number.startswith("0"):
        raise table.error(
            f"there is no cable {number}; the robot has {counted(n_cables, 'cable')}, expected "
            f"{prefix}_1 to {prefix}_{n_cables}",
            column=name,
        )


def _absent(known: dict[str, Column], n_cables: int) -> list[str]:
    """Names, in each possible unit, of every quantity without a column."""
    of_poses = [f"{p}_{part}" for p in ("cmd", "meas") for part in POSITION + QUATERNION + ANGLES]
    of_cables = [f"{p}_{i}" for p in ("length", "tension") for i in range(1, n_cables + 1)]
    of_loads = [f"{p}_{axis}" for p in ("payload", "force", "moment") for axis in POSITION]
    quantities = ["run", "t", *of_poses, *of_cables, "temperature", "payload", *of_loads]
    return [
        f"{quantity}_{unit}" if unit else quantity
        for quantity in quantities
        if quantity not in known
        for unit in of_columns(_si_of(quantity))
    ]


def _check_one_way(columns: Columns) -> None:
    table, known = columns.table, columns.known
    for prefix in ("cmd", "meas", "want"):
        quats, angles = columns.present(prefix, QUATERNION), columns.present(prefix, ANGLES)
        if quats and angles:
            a, b = (known[f"{prefix}_{p[0]}"].name for p in (quats, angles))
            raise table.error(
                f"the orientation is given twice, as {a} and as {b}; expected only one of the two"
            )
    poses = columns.present("cmd", POSITION + QUATERNION + ANGLES)
    lengths = columns.cables("length")
    if poses and lengths:
        a, b = known[f"cmd_{poses[0]}"].name, known[f"length_{lengths[0]}"].name
        raise table.error(
            f"commands are given twice, as {a} and as {b}; expected poses or lengths, not both"
        )
