"""The cases of a study: rows of a table, each a robot, what is changed, and what is done with it.

``docs/formats.md`` has the columns. All mistakes of a table are told at once, before any work.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from crosscheck.measurements.read import load_commands, load_measurements
from seecr.columns.commands import read_commands
from seecr.columns.csv import Table, read_table, show
from seecr.description.fingerprint import all_numbers
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term, Terms
from seecr.errors import Faults, InputError, SeecrError
from seecr.files import digits_of, path_of, toml_path
from seecr.parts import key_of
from seecr.pose import Array
from seecr.prediction.model import Model, load_model
from seecr.units import of_columns
from seecr.version import full_version
from seecr.workspace.maps import axis_of, default_axes

GivenCases: TypeAlias = str | Path | Iterable[Mapping[str, Any]]
"""The file of a table of cases, or its rows as mappings from columns to values."""

# What may be done with a robot: what each needs of the columns below, and what else it takes.
_DOES = {
    "map": ((), ("grid", "lowest_N", "highest_N", "model")),
    "sweep": (("data",), ("model",)),
    "diagnose": (("data",), ("model",)),
    "twin": (("seed",), ("points", "data")),
}
_HEAD = ("case", "robot", "do")
_OPTIONS = dict.fromkeys(word for needs, takes in _DOES.values() for word in needs + takes)
# A change of the robot: mass_kg, ea_N, ea_3_N, exit_2_x_mm, anchor_2_x_mm.
_CHANGE = re.compile(r"(mass|ea|ea_(\d+)|(exit|anchor)_(\d+)_([xyz]))_([a-zA-Z]+)")
_EFFECT = re.compile(r"(\w+)\.(\w+)")
_SI = {"mass": "kg", "ea": "N", "exit": "m", "anchor": "m"}


@dataclass(frozen=True, eq=False)
class StudyCase:
    """One case, ready to be sent to a worker.

    Attributes:
        name: of the case. do: ``map``, ``sweep``, ``diagnose`` or ``twin``.
        robot: as changed. given: the cells of its row that are not empty, by their columns.
        effects: of the robot. data: name of its measurements or commands, "" without.
        options: for what is done. key: hash of all that its result depends on.
    """

    name: str
    do: str
    robot: Robot
    given: Mapping[str, str]
    effects: Model | Terms
    data: str
    options: Mapping[str, Any]
    key: str


def read_cases(given: GivenCases) -> tuple[list[StudyCase], dict[str, Any]]:
    """The cases of a table, and the data that they name.

    Raises:
        InputFileError: with every mistake of the table, and of the files that it names.
        InputError: no table.
    """
    table, folder = _table(given)
    faults, data, found = Faults(), dict[str, Any](), list[StudyCase]()
    _check_columns(table, faults)
    faults.check()
    reader = _Reader(table, folder, data)
    for row in range(len(table.line)):
        if (case := faults.of(reader.case, row)) is not None:
            found.append(case)
    faults.check()
    return found, data


def _table(given: GivenCases) -> tuple[Table, Path]:
    if isinstance(given, str | Path) or not isinstance(given, Iterable):
        path = path_of(given, "a table of cases, or its rows")
        return read_table(path), path.parent
    rows = list(given)
    if not rows or not all(isinstance(row, Mapping) for row in rows):
        raise InputError("cases: expected a mapping from columns to values for each, or their file")
    names = dict.fromkeys(str(name) for row in rows for name in row)
    cells = [["" if row.get(k) is None else str(row[k]).strip() for row in rows] for k in names]
    lines = np.arange(1, len(rows) + 1)
    return Table(Path("cases"), tuple(names), lines, None, cells), Path()


def _check_columns(table: Table, faults: Faults) -> None:
    for name in table.names:
        change, repeated = _CHANGE.fullmatch(name), table.names.count(name) > 1
        unit = change is not None and change[6] not in of_columns(_SI[_kind(change)])
        known = name in (*_HEAD, *_OPTIONS) or change is not None or _EFFECT.fullmatch(name)
        if unit or repeated or not known:
            words = (
                "unknown unit; expected one such as exit_2_x_mm, ea_N or mass_kg" if unit
                else "is there twice; expected it once" if repeated
                else f"unknown column; expected {', '.join((*_HEAD, *_OPTIONS))}, a change of the "
                "robot such as exit_2_x_mm, anchor_2_x_mm, ea_N, ea_2_N or mass_kg, or a parameter "
                "of an effect such as pulley_radius.radius_m"
            )  # fmt: skip
            faults.add(table.error(words, column=name or "without a name"))
    for name in ("robot", "do"):
        if name not in table.names:
            faults.add(table.error("expected a table with columns robot and do", column=name))


def _kind(change: re.Match[str]) -> str:
    return change[1].partition("_")[0]


class _Reader:
    """Reads the rows of a table; each file once."""

    def __init__(self, table: Table, folder: Path, data: dict[str, Any]) -> None:
        self._table, self._folder, self._data = table, folder, data
        self._names: set[str] = set()

    def case(self, row: int) -> StudyCase:
        """The case of a row.

        Raises:
            InputFileError: the first mistake in it.
        """
        cells = zip(self._table.names, (column[row] for column in self._table.cells), strict=True)
        given = {name: cell for name, cell in cells if cell}

        def at(column: str, call: Callable[..., Any], *args: Any, **named: Any) -> Any:
            try:
                return call(*args, **named)
            except SeecrError as error:
                raise self._table.error(str(error), row=row, column=column) from None

        name, do = given.get("case", str(row + 1)), given.get("do", "")
        at("case", self._check_name, name)
        at("do", _check_do, do, given)
        robot = at("robot", self._robot, given.get("robot", ""))
        for kind in _SI:
            columns = [k for k in given if (m := _CHANGE.fullmatch(k)) and _kind(m) == kind]
            values = [at(column, _change, robot, column, given[column]) for column in columns]
            if values:
                robot = at(columns[0], _changed, robot, kind, values)
        of_model = given.get("model")
        model = None if of_model is None else at("model", load_model, self._path(of_model), robot)
        terms = [at(f"{name}.{next(iter(values))}", Term.of, robot, name, **values)
                 for name, values in at("an effect", _values_of, given).items()]  # fmt: skip
        effects = Terms([*getattr(model, "terms", ()), *terms]) if terms else model or Terms()
        numbers = {
            column: at(column, read, given[column])
            for column, read in _NUMBERS.items() if column in given
        }  # fmt: skip
        grid = {"axes": at("grid", _axes, given["grid"], robot)} if "grid" in given else {}
        data, digits = at("data", self._read, do, given.get("data"), robot)
        key = key_of([
            full_version(), do, all_numbers(robot), digits,
            "" if model is None else digits_of(model.path), numbers, grid,
            [[term.name, term.vector] for term in terms],
        ])  # fmt: skip
        return StudyCase(name, do, robot, given, effects, data, numbers | grid, key)

    def _check_name(self, name: str) -> None:
        if name in self._names:
            raise InputError(f"expected a name of its own, got {show(name)} again")
        self._names.add(name)

    def _path(self, cell: str) -> Path:
        """A file beside the table, or else as it is."""
        return there if (there := self._folder / cell).exists() else Path(cell)

    def _robot(self, cell: str) -> Robot:
        if not cell:
            raise InputError("expected the path of an MJCF or the name of a shipped robot")
        return load_robot(self._path(cell))

    def _read(self, do: str, cell: str | None, robot: Robot) -> tuple[str, list[str]]:
        """The name of a case's data, which are read once for each robot, and their digits."""
        if not cell:
            return "", []
        path = self._path(cell)
        name = key_of([do, str(path), all_numbers(robot)])
        if name not in self._data:
            if do == "sweep":
                self._data[name] = read_commands(path, robot).commands
            else:
                read = load_measurements if do == "diagnose" else load_commands
                self._data[name] = read(path, robot)
        return name, [digits_of(p) for p in (path, toml_path(path)) if p.is_file()]


def _check_do(do: str, given: Mapping[str, str]) -> None:
    if do not in _DOES:
        raise InputError(f"expected {', '.join(_DOES)}, got {show(do) if do else 'an empty cell'}")
    needs, takes = _DOES[do]
    wrong = [f"needs {name}, got an empty cell" for name in needs if name not in given]
    wrong += [
        f"takes no {name}, got {show(given[name])}"
        for name in given if name in _OPTIONS and name not in needs + takes
    ]  # fmt: skip
    if wrong:
        raise InputError(f"{do} {'; '.join(wrong)}")


def _number(cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"expected a number, got {show(cell)}")
    return value


def _whole(cell: str) -> int:
    value = _number(cell)
    if value < 0 or not value.is_integer():
        raise InputError(f"expected a whole number from 0 on, got {show(cell)}")
    return int(value)


# Cells that are numbers whatever the robot.
_NUMBERS: dict[str, Callable[[str], float]] = {
    "lowest_N": _number, "highest_N": _number, "seed": _whole, "points": _whole,
}  # fmt: skip


def _axes(cell: str, robot: Robot) -> tuple[Array, ...]:
    """The axes of ``grid``: three, with blanks between, or the number of values on each."""
    parts = cell.split()
    if len(parts) == 1:
        return default_axes(robot, _whole(cell))
    if len(parts) != 3:
        raise InputError(f"expected X Y Z, each FIRST:LAST:COUNT or a number, got {show(cell)}")
    return tuple(axis_of(part, "each of X Y Z") for part in parts)


def _change(robot: Robot, column: str, cell: str) -> tuple[Any, float]:
    """Where in the robot's array of that kind a value goes, and the value in SI."""
    change = _CHANGE.fullmatch(column)
    assert change is not None
    number = change[2] or change[4]
    value = of_columns(_SI[_kind(change)])[change[6]].to_si(_number(cell))
    if number is None:
        return ..., value
    if not 1 <= int(number) <= robot.n_cables:
        raise InputError(f"expected a cable from 1 to {robot.n_cables}")
    at = int(number) - 1
    return (at, "xyz".index(change[5])) if change[5] else at, value


def _changed(robot: Robot, kind: str, changes: Iterable[tuple[Any, float]]) -> Robot:
    """The robot with other numbers of a kind.

    Where a point moves, the cable is longer or shorter by as much as its straight length at the
    reference pose: it stays as taut there as its description has it. E S stays.
    """
    name = {"exit": "exit_points", "anchor": "anchor_points"}.get(kind, kind)
    numbers = np.array(getattr(robot, name), float)
    for at, value in changes:
        numbers[at] = value
    if kind == "mass":
        return replace(robot, mass=float(numbers))
    other: Any = {name: numbers}
    moved = replace(robot, **other)
    longer = moved.reference_lengths - robot.reference_lengths
    return replace(moved, rest_lengths=robot.rest_lengths + longer) if longer.any() else moved


def _values_of(given: Mapping[str, str]) -> dict[str, dict[str, float]]:
    """Parameters by effects, of the columns ``EFFECT.PARAMETER``."""
    found: dict[str, dict[str, float]] = {}
    for column, cell in given.items():
        if (match := _EFFECT.fullmatch(column)) is not None:
            found.setdefault(match[1], {})[match[2]] = _number(cell)
    return found
