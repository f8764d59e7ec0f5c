"""Commands from a file: poses or lengths, with runs, times, temperatures and known loads.

The columns are those of a file of measurements, whose readings are ignored, and ``want_*``, the
poses that lengths are for. The TOML beside it may state ``lengths = "told"`` and
``start = "first_row"``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.columns.csv import Table, Texts, read_table, show
from seecr.columns.headers import columns_said, renamed
from seecr.columns.known import ANGLES, POSITION, QUATERNION, Columns, know_columns
from seecr.columns.plausible import check_commands
from seecr.columns.poses import aimed_poses, command_lengths, command_poses
from seecr.commands import Commands, Loads
from seecr.description.robot import Robot
from seecr.errors import Faults, InputFileError
from seecr.files import Toml, read_toml, toml_path
from seecr.folders import check_together
from seecr.pose import Array

# The commands part of the TOML beside a file; the rest of it is about measurements.

# Allowed values of each key, the default first.
CHOICES = {"lengths": ("absolute", "told"), "start": ("reference", "first_row")}


def choice(toml: Toml, key: str) -> str:
    """The value of a key of :data:`CHOICES`.

    Raises:
        InputFileError: the value is not an allowed one.
    """
    value = toml.content.get(key, CHOICES[key][0])
    if value not in CHOICES[key]:
        words = " or ".join(f'"{word}"' for word in CHOICES[key])
        raise toml.error(f"{key} must be {words}, got {value!r}", key)
    return str(value)


# Columns of known loads: payloads, forces and moments.

# A load that would strain all cables together, if they were parallel to it, by this much: few ropes
# bear it. Robots with softer ones carry so many times their platform's weight or their tension.
_STRAIN, _TIMES = 0.05, 10.0
# A payload of so many times the platform's mass is noted.
_HEAVY = 5.0
# Units that a load which is too large by a thousand may be in.
_SMALLER = {"kg": "g", "kN": "N"}


def known_loads(columns: Columns, robot: Robot) -> Loads | None:
    """The known load of each row, or None if the file has no such columns.

    Raises:
        InputFileError: a centre without a payload, an incomplete centre, one that is farther from
            the platform than the robot is large, a payload that leaves the platform without mass,
            or a load that the cables cannot carry.
    """
    mass = _payload(columns, robot)
    wrench = np.zeros((columns.n_rows, 6))
    for k, part in enumerate(
        [f"{kind}_{axis}" for kind in ("force", "moment") for axis in POSITION]
    ):
        if part in columns.known:
            wrench[:, k] = columns.numbers(part)
            arm = 1.0 if k < 3 else robot.reach
            _refuse_heavy(columns, part, wrench[:, k], arm * _most(robot), "N" if k < 3 else "N m")
    centre = _centre(columns, mass, robot)
    if mass is None and not np.any(wrench):
        return None
    return Loads.of(columns.n_rows, mass=mass, centre=centre, wrench=wrench)


def _payload(columns: Columns, robot: Robot) -> Array | None:
    if "payload" not in columns.known:
        return None
    mass = columns.numbers("payload")
    columns.refuse(
        mass <= -robot.mass,
        "payload",
        lambda row: (
            f"expected a payload that leaves the platform some of its {robot.mass:g} kg, got "
            f"{mass[row]:g} kg"
        ),
    )
    gravity = float(np.linalg.norm(robot.gravity))
    if gravity > 0.0:
        _refuse_heavy(columns, "payload", mass, _most(robot) / gravity, "kg")
        _note_heavy(columns, mass, robot)
    return mass


def _most(robot: Robot) -> float:
    """More than all cables together can carry [N]."""
    weight = robot.mass * float(np.linalg.norm(robot.gravity))
    pull = float(np.sum(robot.ea * np.maximum(robot.reference_lengths / robot.rest_lengths - 1, 0)))
    return max(_STRAIN * float(np.sum(robot.ea)), _TIMES * weight, _TIMES * pull)


def _refuse_heavy(columns: Columns, quantity: str, load: Array, most: float, unit: str) -> None:
    smaller = _SMALLER.get(columns.known[quantity].unit.suffix)
    guess = f"is it in {smaller}? Name the column {quantity}_{smaller}" if smaller else "check it"
    columns.refuse(
        np.abs(load) > most,
        quantity,
        lambda row: (
            f"expected a load that the cables of this robot can carry, at most {most:.3g} {unit}, "
            f"got {load[row]:g} {unit}; {guess}"
        ),
    )


def _note_heavy(columns: Columns, mass: Array, robot: Robot) -> None:
    """Note payloads in kg that are many times the platform's mass."""
    most = float(np.max(mass))
    column = columns.known["payload"]
    if robot.mass > 0.0 and most > _HEAVY * robot.mass and column.unit.suffix == "kg":
        columns.notes.append(
            f"Column {column.name} is up to {most:g} kg, {most / robot.mass:.3g} times the mass of "
            "the platform: if it is in g, name it payload_g."
        )


def _refuse_far(columns: Columns, centre: Array, robot: Robot) -> None:
    """Refuse centres (n, 3) farther from all anchor points than the robot is large."""
    apart = np.linalg.norm(centre[:, None] - robot.anchor_points, axis=-1).min(axis=1)
    far = apart > robot.reach  # False where it is not given
    if np.any(far):
        largest = int(np.argmax(np.abs(centre[int(np.argmax(far))])))
        columns.refuse(
            far,
            f"payload_{POSITION[largest]}",
            lambda row: (
                "expected the centre of a payload on the platform, in the platform's frame, got "
                f"one that is {apart[row]:.3g} m from its anchor points, where the frame is "
                f"{robot.reach:.3g} m across"
            ),
        )


def _centre(columns: Columns, mass: Array | None, robot: Robot) -> Array | None:
    """Centres of payloads (n, 3) [m]; NaN, the platform's own, where no cell is filled."""
    present = columns.present("payload", POSITION)
    if not present:
        return None
    missing = [f"payload_{part}_m" for part in POSITION if part not in present]
    if mass is None:
        missing = ["payload_kg"]
    if missing:
        raise columns.half_there(
            "payload", missing, "payload_kg and its centre payload_x_m to _z_m"
        )
    parts = [columns.numbers(f"payload_{part}", blank_is_nan=True) for part in POSITION]
    centre = np.stack(parts, axis=1)
    blank = np.isnan(centre)
    for k, part in enumerate(POSITION):
        columns.refuse(
            blank[:, k] & ~blank.all(axis=1),
            f"payload_{part}",
            lambda row: "incomplete centre; expected all three cells filled or all three empty",
        )
    _refuse_far(columns, centre, robot)
    return centre


# Runs, times and temperatures of a file: names, seconds or times of day, Celsius.

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
    return np.array(list(names), dtype=np.str_)


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


def _shown(cells: Texts, t_s: Array, row: int, of_day: bool) -> str:
    return cells[row] if of_day else f"{t_s[row]:.9g} s"


@dataclass(frozen=True, eq=False)
class CommandFile:
    """Commands as read from a file.

    Attributes:
        commands: its rows.
        wanted: (n, 7) poses of columns ``want_*``, NaN where a row does not state all of one; None
            without such columns or lengths.
        run: (n,) names of runs.
        notes: sentences for the reader: what was assumed or filled in.
        any_orientation: whether it states positions alone.
    """

    commands: Commands
    wanted: Array | None
    run: tuple[str, ...]
    notes: tuple[str, ...]
    any_orientation: bool = False

    @property
    def conditions(self) -> dict[str, Sequence[Any]]:
        """Columns of the rows' runs, if there are several, their times and temperatures."""
        columns: dict[str, Sequence[Any]] = {"run": self.run} if len(set(self.run)) > 1 else {}
        if self.commands.time is not None:
            columns["t_s"] = self.commands.time.tolist()
        if self.commands.temperature is not None:
            columns["temperature_C"] = self.commands.temperature.tolist()
        return columns


def read_commands(path: str | Path, robot: Robot) -> CommandFile:
    """Read a list of commands for a robot from a CSV or Parquet file.

    Raises:
        InputFileError: with line and column of the mistake.
    """
    path = Path(path)
    toml = toml_path(path)
    check_together(path, toml)
    columns = opened(path, robot, toml if toml.exists() else None)
    check_commanded(columns, robot)
    run = runs(columns)
    lengths = command_lengths(columns, robot)
    if lengths is None:
        # what these commands were for has no part in where they lead
        poses, wanted = command_poses(columns, robot), None
    else:
        poses, wanted = aimed_poses(columns, robot)
    told, stands = _beside(toml)
    commands = Commands(
        pose=poses,
        lengths=lengths,
        run=_numbers(run),
        time=times(columns, run),
        temperature=temperatures(columns),
        told=told and lengths is not None,
        loads=known_loads(columns, robot),
        stands=np.ones(len(run), dtype=bool) if stands else None,
        line=columns.table.line,
    )
    free = lengths is None and not columns.present("cmd", QUATERNION + ANGLES)
    return CommandFile(commands, wanted, tuple(run.tolist()), tuple(columns.notes), free)


def opened(path: Path, robot: Robot, toml: Path | None) -> Columns:
    """The columns of a file, by the names that its TOML gives them, if it has one.

    Raises:
        InputFileError: any mistake in its headers, or in the TOML's table ``[columns]``.
    """
    said = None if toml is None else read_toml(toml, "expected a TOML file with a table [sigma]")
    beside = {} if said is None else said.content.get("columns", {})
    if not isinstance(beside, dict) or not all(isinstance(ours, str) for ours in beside.values()):
        assert said is not None
        text = 'columns must be a table, [columns], of theirs = "ours", such as px = "meas_x_m"'
        raise said.error(text, "columns")
    with renamed({**beside, **columns_said()}):  # what is said on the command line comes last
        return know_columns(read_table(path), robot.n_cables, robot.cable_names)


def check_commanded(columns: Columns, robot: Robot, *more: Callable[[Columns], object]) -> None:
    """Read everything once, so that all mistakes of a file are told together.

    Args:
        columns: of the file. robot: that is commanded.
        more: further readers of the columns, for those who do not ignore readings.

    Raises:
        InputFileError: with a line for each mistake.
    """
    trial, faults = replace(columns, notes=[]), Faults()

    def commanded(columns: Columns) -> None:
        lengths = command_lengths(columns, robot)
        poses = command_poses(columns, robot) if lengths is None else None
        check_commands(columns, robot, poses, lengths)

    for reader in (lambda c: times(c, runs(c)), temperatures, commanded,
                   lambda c: known_loads(c, robot), *more):  # fmt: skip
        faults.of(reader, trial)
    faults.check()


def _beside(path: Path) -> tuple[bool, bool]:
    """Whether lengths are told ones, and whether runs start at their first row."""
    if not path.exists():
        return False, False
    toml = read_toml(path, "expected a TOML beside the commands")
    return choice(toml, "lengths") == "told", choice(toml, "start") == "first_row"


def _numbers(run: NDArray[np.str_]) -> NDArray[np.int64]:
    """Runs (n,) as numbers, in the order in which they come."""
    order = {name: number for number, name in enumerate(dict.fromkeys(run.tolist()))}
    return np.array([order[name] for name in run.tolist()], dtype=np.int64)
