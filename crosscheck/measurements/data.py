"""Measurements of a robot at rest: what was commanded and what was read, row by row, in SI.

Each row is one resting pose. Readings may be any part of the pose and of the tensions; what
was not read is NaN. :mod:`crosscheck.measurements.read` reads them from files.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crosscheck.measurements.named import named_columns
from seecr.commands.data import Commands
from seecr.commands.loads import Loads
from seecr.counted import counted, plural, some
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.result import Record, Result

Mask = NDArray[np.bool_]
Names = NDArray[np.str_]

# Default of fields that __post_init__ makes from the others when they are not given.
_FILLED_IN: Any = None
_PER_ROW = (
    "run",
    "t_s",
    "command_pose",
    "command_lengths",
    "position",
    "quat_wxyz",
    "angles_rad",
    "tensions",
    "temperature_C",
    "stands",
    "sigma_ratio",
    "file",
    "line",
)


@dataclass(frozen=True)
class Sigma:
    """One standard deviation of each kind of reading; None where nobody stated it.

    Attributes:
        position_m: of each measured coordinate [m].
        orientation_rad: of each measured rotation component [rad].
        tension_N: of each measured tension [N].
        length_m: of the *commanded* lengths [m]; reaches the pose through the robot.
    """

    position_m: float | None = None
    orientation_rad: float | None = None
    tension_N: float | None = None
    length_m: float | None = None


def origin_of(path: Path, depth: int = 2) -> str:
    """The name by which models know a file: its own and that of its folder."""
    return "/".join(path.resolve().parts[-depth:])


@dataclass(frozen=True, eq=False, repr=False)
class Measurements(Result):
    """Commands and readings of n resting poses of a robot with m cables.

    Exactly one of ``command_pose`` and ``command_lengths`` is given. Orientation is in one of
    two places: in ``quat_wxyz`` where every row that has any has all of it, else (only some of
    the angles read) in ``angles_rad``.

    Attributes:
        path: the file, or what it will be called.
        n_cables: m.
        run: (n,) name of the continuous motion each row belongs to.
        command_pose: (n, 7) commanded platform pose, or None.
        command_lengths: (n, m) [m] rest lengths, or None. told: whether they are what the winches
            were told, counted as the plain model counts; else they are absolute.
        t_s: (n,) [s] or None. began: the time of day at which it is 0, where the file says so.
        position: (n, 3) [m] in the base frame, NaN where not read.
        quat_wxyz: (n, 4) unit quaternions, NaN rows where not read, or None.
        angles_rad: (n, 3) [rad] rx ry rz with R = Rx(rx) Ry(ry) Rz(rz), NaN where not read.
        tensions: (n, m) [N], NaN where not read.
        position_mask: (3,) coordinates that were read in some row.
        angle_mask: (3,) angles that were read in some row; all false beside ``quat_wxyz``.
        tension_mask: (m,) cables whose tension was read in some row.
        temperature_C: (n,) [deg C] or None.
        loads: what the platform carried, or None.
        stands: (n,) bool, rows whose run starts at its first row instead of the reference pose.
        sigma: stated noise.
        sigma_ratio: (n, 4) noise of each row over that, by kind: each file has its own.
        free: names of effects that every fit of these data fits too: how the tracker stands, where
            that was found from the data. free_in: numbers of the files that say so, by the effects'
            names, where not all do.
        files: their names, where they are several; file: (n,) number of each row's file.
        origins: names by which models know the files, where they are several.
        line: (n,) line of the file (row, for Parquet) each row came from.
        unused_columns: names of columns that mean nothing here.
        notes: sentences for the reader: what was assumed, filled in or left out.
    """

    path: Path
    n_cables: int
    run: Names
    command_pose: Array | None = None
    command_lengths: Array | None = None
    t_s: Array | None = None
    began: datetime | None = None
    position: Array = _FILLED_IN
    quat_wxyz: Array | None = None
    angles_rad: Array = _FILLED_IN
    tensions: Array = _FILLED_IN
    position_mask: Mask = _FILLED_IN
    angle_mask: Mask = _FILLED_IN
    tension_mask: Mask = _FILLED_IN
    temperature_C: Array | None = None
    told: bool = False
    loads: Loads | None = None
    stands: Mask = _FILLED_IN
    free: tuple[str, ...] = ()
    free_in: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    sigma: Sigma = field(default_factory=Sigma)
    sigma_ratio: Array = _FILLED_IN
    files: tuple[str, ...] = ()
    file: NDArray[np.int64] = _FILLED_IN
    origins: tuple[str, ...] = ()
    line: NDArray[np.int64] = _FILLED_IN
    unused_columns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, m = len(self.run), self.n_cables
        if (self.command_pose is None) == (self.command_lengths is None):
            raise ValueError("expected exactly one of command_pose and command_lengths")
        self._set("run", np.array(self.run, dtype=np.str_))
        for name, width in (("position", 3), ("angles_rad", 3), ("tensions", m)):
            if getattr(self, name) is None:
                self._set(name, np.full((n, width), np.nan))
        for name, values in (
            ("position_mask", self.position),
            ("angle_mask", self.angles_rad),
            ("tension_mask", self.tensions),
        ):
            if getattr(self, name) is None:
                self._set(name, np.any(np.isfinite(values), axis=0))
        filled: dict[str, Any] = {
            "line": np.arange(2, n + 2),
            "stands": np.zeros(n, dtype=bool),
            "file": np.zeros(n, dtype=np.int64),
            "sigma_ratio": np.ones((n, len(fields(Sigma)))),
        }
        for name, value in filled.items():
            if getattr(self, name) is None:
                self._set(name, value)
        self._check_shapes()

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _check_shapes(self) -> None:
        n, m = len(self.run), self.n_cables
        widths = {"command_pose": 7, "command_lengths": m, "position": 3, "quat_wxyz": 4}
        widths |= {"angles_rad": 3, "tensions": m}
        shapes: dict[str, tuple[int, ...]] = {k: (n, width) for k, width in widths.items()}
        shapes |= dict.fromkeys(("t_s", "temperature_C", "line", "stands", "file"), (n,))
        shapes |= {"sigma_ratio": (n, len(fields(Sigma)))}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise ValueError(f"measurements: {name} must be {shape}, got {np.shape(value)}")

    @property
    def name(self) -> str:
        """The file's name; of several, each by what tells it from the others."""
        return " + ".join(self.files) or self.path.name

    @property
    def n_rows(self) -> int:
        """Number of rows n."""
        return len(self.run)

    @property
    def parts(self) -> dict[str, Names]:
        """Names (n,) of the "file" and the "run" that each row is of, as models know them."""
        origin = np.array(self.origins or (origin_of(self.path),), dtype=np.str_)[self.file]
        run = self.run
        if self.files:  # runs of several files are named after these
            own = [len(self.files[k]) + 2 for k in self.file]
            run = np.array([name[cut:] for name, cut in zip(run, own, strict=True)], dtype=np.str_)
        return {"file": origin, "run": np.char.add(np.char.add(origin, ": "), run)}

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs, in order of appearance."""
        return tuple(dict.fromkeys(self.run.tolist()))

    @property
    def run_index(self) -> NDArray[np.int64]:
        """(n,) number of each row's run in :attr:`runs`."""
        number = {name: i for i, name in enumerate(self.runs)}
        return np.array([number[name] for name in self.run.tolist()], dtype=np.int64)

    @property
    def absolute(self) -> bool:
        """Whether lengths are commanded that no reference applies to."""
        return self.command_lengths is not None and not self.told

    @property
    def read(self) -> Mask:
        """(n,) rows of which anything was read; the others are way points."""
        tables = [self.position, self.angles_rad, self.tensions]
        tables += [] if self.quat_wxyz is None else [self.quat_wxyz]
        return np.asarray(np.isfinite(np.concatenate(tables, axis=1)).any(axis=1))

    def with_notes(self, notes: Iterable[str]) -> Measurements:
        """The same with more notes."""
        return dataclasses.replace(self, notes=(*self.notes, *notes))

    def places(self, rows: ArrayLike, most: int = 8) -> str:
        """Lines of some rows (numbers or a mask) in words, with their files where several are.

        Such as ``3, 5 and 2 more`` or ``monday.csv 3, tuesday.csv 5``.
        """
        chosen = np.arange(self.n_rows)[np.asarray(rows)]
        return some([self.place(int(row)) for row in chosen], most)

    def lines_of(self, rows: ArrayLike) -> str:
        """The same after its noun: ``line 3``, ``lines 3, 5``."""
        count = len(np.arange(self.n_rows)[np.asarray(rows)])
        return f"{plural(count, 'line')} {self.places(rows)}"

    def place(self, row: int) -> str:
        """The line of one row, and its file where several are."""
        return (
            f"{self.files[self.file[row]]} {self.line[row]}" if self.files else f"{self.line[row]}"
        )

    def as_commands(self, robot: Robot) -> Commands:
        """What the robot was told and carried, as the statics takes it."""
        poses = self.command_pose
        if poses is None:
            poses = np.tile(robot.reference_pose, (self.n_rows, 1))
        return Commands(
            pose=np.asarray(poses, float),
            lengths=self.command_lengths,
            run=self.run_index,
            time=self.t_s,
            temperature=self.temperature_C,
            told=self.told,
            loads=self.loads,
            stands=self.stands,
            clock=self.file if self.files else None,
            parts=self.parts,
        )

    @property
    def has_position(self) -> bool:
        """Whether any coordinate was read."""
        return bool(np.any(self.position_mask))

    @property
    def has_orientation(self) -> bool:
        """Whether any part of the orientation was read."""
        return self.quat_wxyz is not None or bool(np.any(self.angle_mask))

    @property
    def has_tension(self) -> bool:
        """Whether any tension was read."""
        return bool(np.any(self.tension_mask))

    def lines(self) -> list[str]:
        """What there is of it, and what was assumed, filled in or left out."""
        read = [
            word
            for word, there in (
                ("positions", self.has_position),
                ("orientations", self.has_orientation),
                ("tensions", self.has_tension),
            )
            if there
        ]
        what = ", ".join(read) or "commands alone"
        rows, runs = counted(self.n_rows, "row"), counted(len(self.runs), "run")
        return [f"{self.name}: {rows} in {runs}, {what}", *self.notes]

    def records(self) -> list[Record]:
        """Commands and readings row by row, named as in the file; None where not read."""
        columns = dict(self.columns())
        return [
            dict(zip(columns, values, strict=True))
            for values in zip(*columns.values(), strict=True)
        ]

    def columns(self) -> Iterator[tuple[str, list[Any]]]:
        """The columns of the file, in SI, by name; None where nothing was read."""
        return named_columns(self)

    def rows(self, index: ArrayLike | slice) -> Measurements:
        """Some rows: numbers, a mask (n,) or a slice. Masks of what was read stay as they are."""
        chosen = np.arange(self.n_rows)[index if isinstance(index, slice) else np.asarray(index)]
        values: dict[str, Any] = {}
        for name in _PER_ROW:
            value = getattr(self, name)
            values[name] = None if value is None else value[chosen]
        values["loads"] = None if self.loads is None else self.loads.rows(chosen)
        return dataclasses.replace(self, **values)
