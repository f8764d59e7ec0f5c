"""What the commands write: rows of a sweep, corrected commands, arrays of a map."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from seecr.columns.commands import CommandFile
from seecr.columns.csv import table_lines, table_text
from seecr.commands import Commands, Loads
from seecr.description.robot import Robot
from seecr.files import written
from seecr.inverse.result import Correction
from seecr.pose import Array
from seecr.prediction.uncertainty import Spread
from seecr.result import COORDINATES, Record
from seecr.statics.solution import Solution
from seecr.workspace.bars import BarManifold, midline_points
from seecr.workspace.grid import STATUSES, Workspace

_WRENCH = [
    f"{kind}_{axis}_{unit}" for kind, unit in (("force", "N"), ("moment", "Nm")) for axis in "xyz"
]


def load_columns(loads: Loads | None) -> dict[str, list[float]]:
    """Known loads as columns; none without loads.

    NaN, which is to be written as an empty cell, where a payload hangs at the platform's own centre
    of mass.
    """
    if loads is None:
        return {}
    columns = {"payload_kg": loads.mass, **dict(zip(_WRENCH, loads.wrench.T, strict=True))}
    if np.isfinite(loads.centre).any():
        centres = zip("xyz", loads.centre.T, strict=True)
        columns |= {f"payload_{axis}_m": one for axis, one in centres}
    return {name: values.tolist() for name, values in columns.items()}


def toml_beside(told: bool, commands: Commands) -> str:
    """The TOML that states whether lengths are told ones and where runs begin; empty for the
    defaults.
    """
    lines = []
    if told:
        lines += [
            "# length_i is the told length of winch i, in the plain model's terms",
            'lengths = "told"',
        ]
    if commands.stands is not None and commands.stands.any():
        lines.append('start = "first_row"')
    return "".join(f"{line}\n" for line in lines)


@dataclass(frozen=True, eq=False)
class SweepRows:
    """Results for n commands as written to files, one row per command, SI units.

    Attributes:
        solution: of n commands.
        lengths: (n, m) [m] commanded instead of poses.
        wanted: (n, 7) poses that these lengths were for, NaN where a row has none or a part of one.
        more: further values of each row, by name.
        spread: standard deviations of poses and tensions, if the model has a covariance.
        loads: known loads, if any.
        bar: tilts beside the paper's manifold, if the robot is a bar on two cables.
    """

    solution: Solution
    lengths: Array | None = None
    more: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    spread: Spread | None = None
    wanted: Array | None = None
    loads: Loads | None = None
    bar: BarManifold | None = None

    @property
    def aimed(self) -> bool:
        """Whether deviations are from wanted poses: every row has one."""
        return self.wanted is not None and bool(np.isfinite(self.wanted).all())

    def as_json(self) -> list[Record]:
        """``rows`` in ``sweep.json``."""
        return list(self.records())

    def records(self) -> Iterator[Record]:
        """The same, one after the other."""
        found, spread = self.solution, self.spread
        commanded, none = self.lengths is None, [None] * len(found)
        aimed = commanded or self.aimed
        columns = {
            **({} if found.line is None else {"line": found.line}),
            **self.more,
            "command": found.command if commanded else none,
            **({} if self.lengths is None else {"command_lengths_m": self.lengths}),
            **({} if self.wanted is None else {"wanted": self.wanted}),
            "pose": found.pose,
            "deviation_m": found.deviation[:, :3] if aimed else none,
            "rotation_rad": found.deviation[:, 3:] if aimed else none,
            "tensions_N": found.tensions,
            "slack": self._slack(),
            "rest_lengths_m": found.rest_lengths,
            "status": found.status,
            "iterations": found.iterations,
            "residual": found.residual,
            "smallest_eigenvalue": found.smallest_eigenvalue,
            **({} if found.jumps is None else {"jumps": found.jumps}),
        }
        if (met := midline_points(found)) is not None:
            columns |= {"midlines_meet_m": met.points, "beside_weight_m": met.beside}
        columns |= self._tilts()
        if spread is not None:
            columns |= {
                "position_stderr_m": spread.position,
                "rotation_stderr_rad": spread.rotation,
                "seen_stderr": spread.seen,
                "tensions_stderr_N": spread.tensions,
            }
        return (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))

    def csv_lines(self) -> Iterator[str]:
        """The lines of ``sweep.csv``; with ``sweep.toml`` it can be read as the same commands.

        Numbers have all their digits; cells without a number are empty.
        """
        found, spread = self.solution, self.spread
        cables = [str(k + 1) for k in range(found.robot.n_cables)]
        columns: dict[str, Any] = {
            k: self.more[k] for k in ("run", "t_s", "temperature_C") if k in self.more
        }
        if self.lengths is None:
            columns |= _named("cmd_{}", COORDINATES, found.command)
        else:
            columns |= _lengths(found.robot, self.lengths)
        if self.wanted is not None:
            columns |= _named("want_{}", COORDINATES, self.wanted)
        columns |= load_columns(self.loads)
        columns |= _named("pose_{}", COORDINATES, found.pose)
        if self.lengths is None or self.aimed:
            columns |= _named("deviation_{}_m", "xyz", found.deviation[:, :3])
            columns |= _named("rotation_{}_rad", "xyz", found.deviation[:, 3:])
        columns |= _named("tension_{}_N", cables, found.tensions)
        if spread is not None:
            columns |= _named("pose_{}_stderr_m", "xyz", spread.position)
            columns |= _named("rotation_{}_stderr_rad", "xyz", spread.rotation)
            columns |= _named("tension_{}_stderr_N", cables, spread.tensions)
        columns |= {
            "status": [status.name.lower() for status in found.status],
            "residual": found.residual,
            "smallest_eigenvalue": found.smallest_eigenvalue,
            "slack": [" ".join(names) for names in self._slack()],
        }
        if (met := midline_points(found)) is not None:
            columns |= _named("midlines_{}_m", "xyz", met.points)
            columns["beside_weight_m"] = met.beside
        columns |= self._tilts()
        return table_lines(columns)

    def _tilts(self) -> dict[str, list[float]]:
        """Of a bar on two cables, beside those of the manifold."""
        rows = [] if self.bar is None else self.bar.records()
        names = rows[0] if rows else ()
        return {name: [row[name] for row in rows] for name in names}

    def _slack(self) -> list[list[str]]:
        """Names of the slack cables of each row."""
        names = np.array(self.solution.robot.cable_names)
        return [names[row].tolist() for row in self.solution.slack]


def _named(pattern: str, names: Sequence[str], values: Array) -> dict[str, Any]:
    """Columns of a table (n, k), with names from the pattern."""
    return {pattern.format(name): column for name, column in zip(names, values.T, strict=True)}


def _lengths(robot: Robot, lengths: Array) -> dict[str, Any]:
    """Columns of the commanded lengths (n, m); passive lines have none."""
    driven = np.flatnonzero(robot.driven)
    return _named("length_{}_m", [str(k + 1) for k in driven], lengths[:, driven])


_WANT = [f"want_{name}" for name in COORDINATES]


def corrected_csv(found: Correction, wanted: CommandFile) -> str:
    """The wanted poses and the lengths to command, one row per pose with an answer.

    Runs, times, temperatures and loads are those of the list. Numbers have all their digits: a
    length rounded to a micrometre is off by as much.
    """
    columns: dict[str, Any] = dict(wanted.conditions)
    columns |= dict(zip(_WANT, found.wanted.T, strict=True))
    columns |= _lengths(found.robot, found.lengths)
    columns |= load_columns(wanted.commands.loads)
    kept = np.flatnonzero(found.found).tolist()
    return table_text({name: [one[i] for i in kept] for name, one in columns.items()})


def lookup_csv(found: Correction) -> str:
    """The look-up table of a controller: each position of a grid, and the lengths to command."""
    columns: dict[str, Any] = dict(zip(("x_m", "y_m", "z_m"), found.wanted.T[:3], strict=True))
    columns |= _lengths(found.robot, found.lengths)
    columns["reached"] = found.reached.astype(int).tolist()
    return table_text(columns)


def corrected_toml(wanted: CommandFile) -> str:
    """The TOML that states how the lengths are meant."""
    return toml_beside(True, wanted.commands)


# An array is compressed if that saves more than a third of this many values around its middle.
_SAMPLE, _WORTH = 16384, 0.67


def write_arrays(path: Path, found: Workspace, edge: Array | None = None) -> None:
    """``map.npz``: axes, results at the poses, (nx, ny, nz) each, and the edge's poses (k, 7).

    Of a grid with directions of its own the axes are ``u_m``, ``v_m`` and ``w_m``, and positions
    are ``u, v, w @ directions``.

    With an elastic map ``status_names[status]`` says at which poses it has an answer, or why not.
    """
    axes = {f"{name}_m": axis for name, axis in zip(found.axis_names, found.axes, strict=True)}
    with written(path) as (part,), part.open("wb") as file:
        more: dict[str, ArrayLike] = {}
        if found.chance is not None:
            more["probability"] = found.chance
        if edge is not None:
            more["edge"] = edge
        if found.status is not None:
            more["status"] = found.status
            more["status_names"] = [one.name.lower() for one in STATUSES]
        if found.directions is not None:
            more["directions"] = found.directions
        _write_npz(
            file, **more, **axes, orientation=found.orientation,
            margin_N=found.margin,
            feasible=found.feasible, deviation_m=found.deviation, rotation_rad=found.rotation,
            slack=found.slack, smallest_eigenvalue_N_per_m=found.stiffness,
            softest_direction=found.softest,
        )  # fmt: skip


def _write_npz(file: BinaryIO, **arrays: ArrayLike) -> None:
    """What :func:`numpy.load` reads, compressed where that saves much.

    Hardly any digits of a deviation can be saved, and trying took as long as a million margins.
    """
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            array = np.ascontiguousarray(values)
            middle = array.size // 2
            some = array.ravel()[max(0, middle - _SAMPLE) : middle + _SAMPLE].tobytes()
            saves = len(zlib.compress(some, 1)) < _WORTH * len(some)
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED if saves else zipfile.ZIP_STORED
            with archive.open(entry, "w", force_zip64=True) as part:
                np.lib.format.write_array(part, array, allow_pickle=False)
