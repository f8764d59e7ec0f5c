"""Measurements of a robot at rest: commands and readings, row by row, in SI units.

Each row is one resting pose. Readings may be any part of the pose and of the tensions; missing ones
are NaN. :mod:`crosscheck.measurements.read` reads them from files.
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

from crosscheck.given import check_above_zero
from crosscheck.measurements.named import named_columns
from crosscheck.measurements.stated import parsed
from seecr.commands import Commands, Loads
from seecr.counted import counted, plural, some
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.result import Record, Result, rows_of

Mask = NDArray[np.bool_]
Names = NDArray[np.str_]

# Default of fields that __post_init__ computes from the others if they are not given.
_FILLED_IN: Any = None
_PER_ROW = (
    "run",
    "t_s",
    "command_pose",
    "command_lengths",
    "wanted",
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
    """Standard deviation of each kind of reading; None if it was not stated.

    Attributes:
        position_m: of each measured coordinate [m].
        orientation_rad: of each measured rotation component [rad].
        tension_N: of each measured tension [N].
        length_m: of the *commanded* lengths [m]; reaches the pose through the robot.

    Raises:
        InputError: something else than a number above zero.
    """

    position_m: float | None = None
    orientation_rad: float | None = None
    tension_N: float | None = None
    length_m: float | None = None

    def __post_init__(self) -> None:
        check_above_zero(self)

    @classmethod
    def parsed(cls, texts: Iterable[str]) -> Sigma:
        """Parse what the command line takes: kinds and quantities, such as ``tension=0.5N``.

        Raises:
            CrosscheckError: an unknown kind, no quantity, one in another unit, or two for one kind.
        """
        return cls(**parsed(texts))

    @property
    def stated(self) -> dict[str, float]:
        """The kinds that are stated, with their noise in SI."""
        return {name: value for name, value in vars(self).items() if value is not None}


def origin_of(path: Path) -> str:
    """The name by which models know a file: its own and that of its folder."""
    return "/".join(path.resolve().parts[-2:])


@dataclass(frozen=True, eq=False, repr=False)
class Measurements(Result):
    """Commands and readings of n resting poses of a robot with m cables.

    Exactly one of ``command_pose`` and ``command_lengths`` is given. Orientation is in one of two
    fields: in ``quat_wxyz`` if every row has all or nothing of it, else (only some of the angles
    were read) in ``angles_rad``.

    Attributes:
        path: the file, or its future name.
        n_cables: m.
        run: (n,) name of the continuous motion that each row belongs to.
        command_pose: (n, 7) commanded platform pose, or None.
        command_lengths: (n, m) [m] rest lengths, or None. told: whether they are told lengths, in
            the plain model's terms; else they are absolute.
        wanted: (n, 7) poses that the commands are for, if they are stated besides (columns
            ``want_*``), or None; NaN where no coordinate is.
        t_s: (n,) [s] or None. began: the time of day at which it is 0, if the file states it.
        position: (n, 3) [m] in the base frame, NaN if not read.
        quat_wxyz: (n, 4) unit quaternions, NaN rows if not read, or None.
        angles_rad: (n, 3) [rad] rx ry rz with R = Rx(rx) Ry(ry) Rz(rz), NaN if not read.
        tensions: (n, m) [N], NaN if not read.
        position_mask: (3,) coordinates that were read in some row.
        angle_mask: (3,) angles that were read in some row; all false with ``quat_wxyz``.
        tension_mask: (m,) cables whose tension was read in some row.
        temperature_C: (n,) [deg C] or None.
        loads: known loads, or None.
        stands: (n,) bool, rows whose run starts at its first row instead of the reference pose.
        sigma: stated noise.
        sigma_source: where it comes from: "stated", "dwell_scatter" (a lower bound) or "revisited".
        sigma_ratio: (n, 4) noise of each row relative to that, by kind: files may differ.
        free: names of effects that every fit of these data includes: the tracker's frame, if it was
            estimated from the data. free_in: indices of the files that state so, by the effects'
            names, if not all do.
        files: their names, if there are several; file: (n,) index of each row's file.
        origins: names by which models know the files, if there are several.
        line: (n,) line in the file (row, for Parquet) of each row.
        unused_columns: names of columns without a known meaning.
        notes: sentences for the reader: what was assumed, filled in or left out.
    """

    path: Path
    n_cables: int
    run: Names
    command_pose: Array | None = None
    command_lengths: Array | None = None
    wanted: Array | None = None
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
    sigma_source: str = "stated"
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
        filled: dict[str, NDArray[Any]] = {
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
        widths |= {"angles_rad": 3, "tensions": m, "wanted": 7}
        shapes: dict[str, tuple[int, ...]] = {k: (n, width) for k, width in widths.items()}
        shapes |= dict.fromkeys(("t_s", "temperature_C", "line", "stands", "file"), (n,))
        shapes |= {"sigma_ratio": (n, len(fields(Sigma)))}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise ValueError(f"measurements: {name} must be {shape}, got {np.shape(value)}")

    @property
    def name(self) -> str:
        """The file's name; for several files, the shortest names that tell them apart."""
        return " + ".join(self.files) or self.path.name

    @property
    def n_rows(self) -> int:
        """Number of rows n."""
        return len(self.run)

    @property
    def parts(self) -> dict[str, Names]:
        """Names (n,) of the "file" and the "run" of each row, as models know them."""
        origin = np.array(self.origins or (origin_of(self.path),), dtype=np.str_)[self.file]
        run = self.run
        if self.files:  # runs of several files have the file's name in front
            own = [len(self.files[k]) + 2 for k in self.file]
            run = np.array([name[cut:] for name, cut in zip(run, own, strict=True)], dtype=np.str_)
        return {"file": origin, "run": np.char.add(np.char.add(origin, ": "), run)}

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs, in order of appearance."""
        return tuple(dict.fromkeys(self.run.tolist()))

    @property
    def run_index(self) -> NDArray[np.int64]:
        """(n,) index of each row's run in :attr:`runs`."""
        number = {name: i for i, name in enumerate(self.runs)}
        return np.array([number[name] for name in self.run.tolist()], dtype=np.int64)

    @property
    def absolute(self) -> bool:
        """Whether absolute lengths are commanded."""
        return self.command_lengths is not None and not self.told

    @property
    def read(self) -> Mask:
        """(n,) rows with any reading; the others are way points."""
        tables = [self.position, self.angles_rad, self.tensions]
        tables += [] if self.quat_wxyz is None else [self.quat_wxyz]
        return np.asarray(np.isfinite(np.concatenate(tables, axis=1)).any(axis=1))

    def with_notes(self, notes: Iterable[str]) -> Measurements:
        """The same with more notes."""
        return dataclasses.replace(self, notes=(*self.notes, *notes))

    def places(self, rows: ArrayLike, most: int = 8) -> str:
        """Lines of some rows (indices or a mask) in words, with their files if there are several.

        For example ``3, 5 and 2 more`` or ``monday.csv 3, tuesday.csv 5``.
        """
        chosen = np.arange(self.n_rows)[np.asarray(rows)]
        return some([self.place(int(row)) for row in chosen], most)

    def lines_of(self, rows: ArrayLike) -> str:
        """Lines of some rows as in :meth:`places`, with their noun: ``line 3``, ``lines 3, 5``."""
        count = len(np.arange(self.n_rows)[np.asarray(rows)])
        return f"{plural(count, 'line')} {self.places(rows)}"

    def place(self, row: int) -> str:
        """The line of one row, with its file if there are several."""
        return (
            f"{self.files[self.file[row]]} {self.line[row]}" if self.files else f"{self.line[row]}"
        )

    def as_commands(self, robot: Robot) -> Commands:
        """The commands and known loads, as the statics takes them.

        With the lines of the file, by which answers name rows; of several files' rows none has a
        line of its own.
        """
        poses = self.command_pose
        if poses is None:
            poses = np.tile(robot.reference_pose, (self.n_rows, 1))
            if self.wanted is not None:
                # of several equilibria with these lengths, the one that they are for
                poses = np.where(np.isfinite(self.wanted), self.wanted, poses)
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
            line=None if self.files else self.line,
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
        """What was measured, and what was assumed, filled in or left out."""
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
        """Commands and readings row by row, named as in the file; None if not read."""
        return rows_of(dict(self.columns()))

    def columns(self) -> Iterator[tuple[str, list[Any]]]:
        """The columns of the file, in SI units, by name; None if not read."""
        return named_columns(self)

    def rows(self, index: ArrayLike | slice) -> Measurements:
        """Some rows, by index, mask (n,) or slice. The masks of what was read are kept."""
        chosen = np.arange(self.n_rows)[index if isinstance(index, slice) else np.asarray(index)]
        values: dict[str, Any] = {}
        for name in _PER_ROW:
            value = getattr(self, name)
            values[name] = None if value is None else value[chosen]
        values["loads"] = None if self.loads is None else self.loads.rows(chosen)
        return dataclasses.replace(self, **values)
