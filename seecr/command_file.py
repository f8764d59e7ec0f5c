"""Commands from a CSV: poses or lengths, with runs, times and temperatures where they are given.

The columns are those of a file of measurements: ``cmd_x_m``, ``cmd_qw``, ``cmd_ry_deg``,
``length_1_m``, ``run``, ``t_s``, ``temperature_C``, ``payload_kg``, ``force_x_N`` and so on, in any
order; others are not looked at. The TOML beside it may say ``lengths = "told"`` and
``start = "first_row"``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.errors import InputFileError
from seecr.files import read_text, read_toml
from seecr.loads import Loads
from seecr.pose import Array, quat_from_rxyz
from seecr.robot import Robot

__all__ = ["CommandFile", "read_commands"]

_EXPECTED = "expected a CSV of commands with a header row, such as cmd_x_m,cmd_y_m,cmd_z_m"
_NAME = re.compile(
    r"((?:cmd|want)_r?[xyz]|length_\d+|t|temperature|payload(?:_[xyz])?|(?:force|moment)_[xyz])"
    r"_([A-Za-z]*)|((?:cmd|want)_q[wxyz]|run)"
)
_UNITS = {
    "length": {"m": 1.0, "cm": 100.0, "mm": 1e3, "um": 1e6},
    "angle": {"rad": 1.0, "deg": 180.0 / np.pi},
    "t": {"s": 1.0, "ms": 1e3},
    "temperature": {"C": 1.0},
    "payload": {"kg": 1.0, "g": 1e3},
    "force": {"N": 1.0, "kN": 1e-3},
    "moment": {"Nm": 1.0},
}
_POSITION, _QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
_ANGLES = ("rx", "ry", "rz")
_NORM = 1e-3


@dataclass(frozen=True, eq=False)
class CommandFile:
    """Commands as read.

    Attributes:
        path: the file.
        commands: its rows.
        wanted: (n, 7) poses of columns ``want_*``, or None.
        run: (n,) names of runs.
    """

    path: Path
    commands: Commands
    wanted: Array | None
    run: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells of the known columns, with their places."""

    path: Path
    names: dict[str, str]
    units: dict[str, float]
    lines: list[int]
    texts: dict[str, list[str]]
    comma: bool

    def error(self, text: str, column: str | None = None, row: int | None = None) -> InputFileError:
        line = None if row is None else self.lines[row]
        return InputFileError.at(self.path, text, line=line, column=column)

    def numbers(self, quantity: str) -> Array:
        values = np.empty(len(self.lines))
        for row, cell in enumerate(self.texts[quantity]):
            try:
                values[row] = float(cell.replace(",", ".") if self.comma else cell)
            except ValueError:
                values[row] = np.nan
            if not np.isfinite(values[row]):
                what = f"got {cell!r}" if cell else "got an empty cell"
                raise self.error(f"expected a finite number, {what}", self.names[quantity], row)
        return values / self.units[quantity]

    def together(self, quantities: Sequence[str], what: str) -> Array | None:
        """Columns (n, k) that are there all or not at all."""
        missing = [q for q in quantities if q not in self.texts]
        if len(missing) == len(quantities):
            return None
        if missing:
            raise self.error(f"{what} half there; expected {' '.join(missing)} too")
        return np.stack([self.numbers(q) for q in quantities], axis=1)


def read_commands(path: str | Path, robot: Robot) -> CommandFile:
    """Read a list of commands for a robot.

    Args:
        path: the CSV.
        robot: its number of cables, and the reference pose for what the file does not say.

    Raises:
        InputFileError: with line and column of what is wrong.
    """
    cells = _cells(Path(path))
    lengths = cells.together([f"length_{i + 1}" for i in range(robot.n_cables)], "lengths")
    beyond = f"length_{robot.n_cables + 1}"
    if beyond in cells.texts:
        raise cells.error(f"the robot has {robot.n_cables} cables", cells.names[beyond])
    told, wanted = _poses(cells, "cmd", robot), _poses(cells, "want", robot)
    if told is not None and lengths is not None:
        raise cells.error("commands twice, as poses and as lengths; expected one of the two")
    if lengths is not None and np.any(lengths <= 0):
        row, cable = np.argwhere(lengths <= 0)[0]
        name = cells.names[f"length_{cable + 1}"]
        raise cells.error("expected a length above zero", name, int(row))
    if lengths is None and told is None:
        raise cells.error(f"no commands; {_EXPECTED}, or length_1_m and on")
    n = len(cells.lines)
    start = wanted if wanted is not None else np.tile(robot.reference_pose, (n, 1))
    run = tuple(cells.texts.get("run", ["all"] * n))
    optional = {q: cells.numbers(q) for q in ("t", "temperature") if q in cells.texts}
    commands = Commands(
        pose=start if told is None else told,
        lengths=lengths,
        run=_numbered(cells, run),
        time=optional.get("t"),
        temperature=optional.get("temperature"),
        loads=_loads(cells),
        **_beside(Path(path), n, lengths is not None),
    )
    _check_times(cells, commands)
    return CommandFile(Path(path), commands, wanted, run)


def _cells(path: Path) -> _Cells:
    text = read_text(path, _EXPECTED)
    numbered = [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(numbered) < 2:
        found = "is empty" if not numbered else "has no rows below its header"
        raise InputFileError.at(path, f"{found}; {_EXPECTED}, and one row per command")
    head = numbered[0][1]
    mark = next((m for m in ("\t", ";") if m in head), ",")
    reader = csv.reader([line for _, line in numbered], delimiter=mark)
    rows = [[cell.strip() for cell in row] for row in reader]
    names: dict[str, str] = {}
    units: dict[str, float] = {}
    columns: dict[str, int] = {}
    for index, name in enumerate(rows[0]):
        match = _NAME.fullmatch(name)
        if match is None:
            continue
        quantity = match[1] or match[3]
        if quantity in names:
            raise InputFileError.at(path, "repeated column; expected it once", column=name)
        names[quantity], columns[quantity] = name, index
        units[quantity] = _unit(path, name, quantity, match[2])
    for (number, _), row in zip(numbered[1:], rows[1:], strict=True):
        if len(row) != len(rows[0]):
            text = f"expected {len(rows[0])} cells as in the header, got {len(row)}"
            raise InputFileError.at(path, text, line=number)
    texts = {q: [row[index] for row in rows[1:]] for q, index in columns.items()}
    return _Cells(path, names, units, [number for number, _ in numbered[1:]], texts, mark != ",")


def _unit(path: Path, name: str, quantity: str, unit: str | None) -> float:
    if unit is None:
        return 1.0
    kind = quantity
    if quantity not in _UNITS:
        kind = quantity.partition("_")[0]
        if kind not in ("force", "moment"):
            kind = "angle" if quantity.endswith(_ANGLES) else "length"
    if unit not in _UNITS[kind]:
        known = " or ".join(f"{quantity}_{one}" for one in _UNITS[kind])
        raise InputFileError.at(path, f"unknown unit {unit!r}; expected {known}", column=name)
    return _UNITS[kind][unit]


def _poses(cells: _Cells, prefix: str, robot: Robot) -> Array | None:
    """Poses (n, 7) of the columns of a prefix; None where there are none."""
    axes = [f"{prefix}_{part}" for part in _POSITION]
    if robot.joints:
        # what the joints do not move stays as at the reference pose
        parts = [
            cells.numbers(q) if q in cells.texts else np.full(len(cells.lines), at)
            for q, at in zip(axes, robot.reference_pose[:3], strict=True)
        ]
        position = np.stack(parts, axis=1) if any(q in cells.texts for q in axes) else None
    else:
        position = cells.together(axes, "positions")
    if position is None:
        return None
    quat = cells.together([f"{prefix}_{part}" for part in _QUATERNION], "quaternion")
    angles = [f"{prefix}_{part}" for part in _ANGLES]
    turned = any(q in cells.texts for q in angles)
    if quat is None and turned:
        zero = np.zeros(len(cells.lines))
        parts = [cells.numbers(q) if q in cells.texts else zero for q in angles]
        quat = quat_from_rxyz(np.stack(parts, axis=1))
    elif quat is not None:
        if turned:
            raise cells.error("orientation twice, as quaternion and as angles; expected one")
        norm = np.linalg.norm(quat, axis=1)
        if np.any(np.abs(norm - 1.0) > _NORM):
            row = int(np.argmax(np.abs(norm - 1.0)))
            text = f"expected a unit quaternion, scalar first, got norm {norm[row]:.6g}"
            raise cells.error(text, cells.names[f"{prefix}_qw"], row)
        quat = quat / norm[:, None]
    else:
        quat = np.tile(robot.reference_pose[3:], (len(cells.lines), 1))
    return np.concatenate([position, quat], axis=1)


def _loads(cells: _Cells) -> Loads | None:
    """Known loads, where there are columns of them; a coordinate that is not given is zero."""
    n, zero = len(cells.lines), np.zeros(len(cells.lines))
    wrench = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in _POSITION]
    if not any(q in cells.texts for q in ("payload", *wrench)):
        return None
    parts = [cells.numbers(q) if q in cells.texts else zero for q in wrench]
    mass = cells.numbers("payload") if "payload" in cells.texts else None
    centre = cells.together([f"payload_{axis}" for axis in _POSITION], "centre of the payload")
    return Loads.of(n, mass, centre, np.stack(parts, axis=1))


def _beside(path: Path, n: int, in_lengths: bool) -> dict[str, Any]:
    """What the TOML beside the file says of its commands; the rest of it is of measurements."""
    toml_path = path.with_suffix(".toml")
    if not toml_path.exists():
        return {}
    toml = read_toml(toml_path, "expected a TOML beside the commands")
    told, start = toml.content.get("lengths"), toml.content.get("start")
    if told not in (None, "told", "absolute"):
        raise toml.error(f"lengths must be 'told' or 'absolute', got {told!r}", "lengths")
    if start not in (None, "reference", "first_row"):
        raise toml.error(f"start must be 'reference' or 'first_row', got {start!r}", "start")
    stands = np.ones(n, dtype=bool) if start == "first_row" else None
    return {"told": told == "told" and in_lengths, "stands": stands}


def _numbered(cells: _Cells, run: Sequence[str]) -> NDArray[np.int64]:
    """Runs by number, in the order in which they come."""
    starts = [k for k in range(len(run)) if k == 0 or run[k] != run[k - 1]]
    names = [run[k] for k in starts]
    for k, name in zip(starts, names, strict=True):
        if names.count(name) > 1 and names.index(name) < starts.index(k):
            text = f"run {name!r} comes back; expected the rows of a run together"
            raise cells.error(text, "run", k)
    order = {name: number for number, name in enumerate(names)}
    return np.array([order[name] for name in run])


def _check_times(cells: _Cells, commands: Commands) -> None:
    if commands.time is None:
        return
    back = (np.diff(commands.time) < 0) & ~commands.starts[1:]
    if np.any(back):
        row = int(np.argmax(back)) + 1
        raise cells.error("rows out of time order; sort them by time", cells.names["t"], row)
