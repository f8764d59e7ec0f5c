"""Measurements of a robot at rest: commands and readings, row by row, in SI units.

Each row is one resting pose. Readings may be any part of the pose and of the tensions; missing ones
are NaN. :mod:`crosscheck.measurements.read` reads them from files.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.given import check_above_zero
from seecr.commands import Commands, Loads
from seecr.counted import counted, plural, some
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array
from seecr.result import COORDINATES, Record, Result, rows_of
from seecr.units import UNITS, number_and_unit


def _load_columns(loads: Loads) -> Iterator[tuple[str, list[Any]]]:
    """The columns of payload and wrench with content."""
    if np.any(loads.mass):
        yield from _columns(["payload_kg"], loads.mass)
        if np.isfinite(loads.centre).any():
            yield from _columns([f"payload_{c}_m" for c in "xyz"], loads.centre)
    wrench = [*(f"force_{c}_N" for c in "xyz"), *(f"moment_{c}_Nm" for c in "xyz")]
    acts = np.array([bool(column.any()) for column in loads.wrench.T])
    yield from _columns(wrench, loads.wrench, acts)


def _columns(
    names: list[str], values: Array | None, mask: NDArray[np.bool_] | None = None
) -> Iterator[tuple[str, list[Any]]]:
    """Columns (n,) or (n, k) with their names, without those that the mask (k,) excludes."""
    if values is None:
        return
    for k, name in enumerate(names):
        if mask is None or mask[k]:
            column = values if values.ndim == 1 else values[:, k]
            yield name, [None if v != v else v for v in column.tolist()]


# Quantities as people type them: `0.5mm`, and the noise of readings: `position=0.1mm`.

SI = {"position": "m", "orientation": "rad", "tension": "N", "length": "m"}
"""The SI unit of each kind of reading, and of commanded lengths."""

EXAMPLE = {"position": "0.5mm", "orientation": "0.2deg", "tension": "1N", "length": "0.2mm"}
"""What a person may type for each of them."""

# In SI; beyond them squares, which fits and noise are made of, are lost in rounding.
LEAST, MOST = 1e-15, 1e15
# Of noise: beside less, what effects do is so large that rounding leaves nothing of the rest.
LEAST_NOISE = 1e-9


def parse_quantity(label: str, kind: str, text: str, least: float = LEAST) -> float:
    """A positive number with its unit, in SI.

    Args:
        label: the option or key, to say where.
        kind: one of :data:`SI`.
        text: such as ``0.5mm``.
        least: in SI; less is none.

    Raises:
        CrosscheckError: no number above zero with a unit of that kind.
    """
    return parse_kind(label, (kind,), text, least)[1]


def parse_kind(
    label: str, kinds: Sequence[str], text: str, least: float = LEAST
) -> tuple[str, float]:
    """A positive number with the unit of one of some kinds: which kind, and the number in SI.

    Raises:
        CrosscheckError: no number above zero with a unit of those kinds.
    """
    units = {
        name: (kind, unit)
        for kind in kinds for unit in UNITS if unit.si == SI[kind]
        for name in (unit.suffix, *unit.also)
    }  # fmt: skip
    examples = " or ".join(EXAMPLE[kind] for kind in kinds)
    words = f"{label}: expected a number with its unit ({', '.join(units)}) such as {examples}"
    typed = number_and_unit(text)
    if typed is None:
        raise CrosscheckError(f"{words}, got {text!r}")
    value, name = typed
    if name not in units:
        got = f"unit {name!r}" if name else "no unit"
        raise CrosscheckError(f"{words}, got {got} in {text!r}")
    if not (value > 0 and math.isfinite(value)):
        raise CrosscheckError(f"{label}: expected more than zero, got {text!r}")
    kind, unit = units[name]
    if not least < unit.to_si(value) < MOST:
        raise CrosscheckError(f"{label}: expected a size that can be measured, got {text!r}")
    return kind, unit.to_si(value)


Mask = NDArray[np.bool_]
Names = NDArray[np.str_]

# Default of fields that __post_init__ computes from the others if they are not given.
_FILLED_IN: Any = None
_PER_ROW = (
    "run", "t_s", "command_pose", "command_lengths", "wanted", "position", "quat_wxyz",
    "angles_rad", "tensions", "temperature_C", "stands", "sigma_ratio", "file", "line", "copied",
)  # fmt: skip


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
        values: dict[str, float] = {}
        for text in texts:
            kind, equals, quantity = text.partition("=")
            kind = kind.strip()
            if not equals or kind not in SI:
                near = difflib.get_close_matches(kind, SI, n=len(SI), cutoff=0.0)
                raise CrosscheckError(
                    f"--sigma {text}: expected KIND=QUANTITY such as position=0.1mm, KIND one of "
                    f"{', '.join(near)} (nearest first)"
                )
            key = f"{kind}_{SI[kind]}"
            if key in values:
                raise CrosscheckError(
                    f"--sigma {text}: expected one for the {kind}, got two; leave one out"
                )
            values[key] = parse_quantity(f"--sigma {kind}", kind, quantity, LEAST_NOISE)
        return cls(**values)

    @classmethod
    def of(cls, given: GivenSigma) -> Sigma | None:
        """The noise as callers may give it: metres, or ``"0.1mm"``, whose unit tells the kind.

        Raises:
            InputError: something else.
        """
        if isinstance(given, str):
            kind, value = parse_kind("sigma", ("position", "orientation", "tension"), given,
                                     LEAST_NOISE)  # fmt: skip
            return cls(**{f"{kind}_{SI[kind]}": value})
        if isinstance(given, int | float) and not isinstance(given, bool):
            return cls(position_m=float(given))
        if given is None or isinstance(given, Sigma):
            return given
        raise InputError(
            "sigma: expected a crosscheck.Sigma, such as Sigma(position_m=1e-4), metres, or a "
            f'text such as "0.1mm", got {type(given).__name__}'
        )

    @property
    def stated(self) -> dict[str, float]:
        """The kinds that are stated, with their noise in SI."""
        return {name: value for name, value in vars(self).items() if value is not None}


GivenSigma: TypeAlias = Sigma | float | str | None
"""Noise of readings: a sigma, metres, ``"0.1mm"``, or None for what the files state."""


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
        copied: (n,) bool, rows whose readings another row has too, beside another command.
        driven: (m,) bool, cables on winches; commanded lengths of the others have no columns.
        unused_columns: names of columns without a known meaning.
        notes: sentences for the reader: what was assumed, filled in or left out.
    """

    # set by crosscheck.measurements.arrays, which reads by what reads files into this class
    from_arrays: ClassVar[Callable[..., Measurements]]
    from_frame: ClassVar[Callable[..., Measurements]]

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
    copied: Mask = _FILLED_IN
    driven: Mask = _FILLED_IN
    unused_columns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, m = len(self.run), self.n_cables
        if (self.command_pose is None) == (self.command_lengths is None):
            raise ValueError("expected exactly one of command_pose and command_lengths")
        self._set("run", np.array(self.run, dtype=np.str_))
        filled: dict[str, NDArray[Any]] = {
            # one number, shown so many times
            "position": np.broadcast_to(np.nan, (n, 3)),
            "angles_rad": np.broadcast_to(np.nan, (n, 3)),
            "tensions": np.broadcast_to(np.nan, (n, m)),
            "line": np.arange(2, n + 2),
            "driven": np.ones(m, dtype=bool),
            "stands": np.zeros(n, dtype=bool),
            "copied": np.zeros(n, dtype=bool),
            "file": np.zeros(n, dtype=np.int64),
            "sigma_ratio": np.broadcast_to(1.0, (n, len(fields(Sigma)))),
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
        widths |= {"angles_rad": 3, "tensions": m, "wanted": 7, "sigma_ratio": len(fields(Sigma))}
        shapes: dict[str, tuple[int, ...]] = {k: (n, width) for k, width in widths.items()}
        shapes |= dict.fromkeys(("t_s", "temperature_C", "line", "stands", "file", "copied"), (n,))
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

    def __len__(self) -> int:
        return self.n_rows

    @property
    def parts(self) -> dict[str, Names]:
        """Names (n,) of the "file" and the "run" of each row, as models know them."""
        return {kind: names[index] for kind, (names, index) in self._labels.items()}

    @cached_property
    def _labels(self) -> dict[str, tuple[Names, NDArray[np.integer]]]:
        """The different names of parts, and the index (n,) of each row's."""
        origin = np.array(self.origins or (origin_of(self.path),), dtype=np.str_)
        runs, first, which = np.unique(self.run, return_index=True, return_inverse=True)
        names = []
        for name, file in zip(runs.tolist(), self.file[first], strict=True):
            # runs of several files have the file's name in front
            own = name[len(self.files[file]) + 2 :] if self.files else name
            names.append(f"{origin[file]}: {own}")
        run = np.array(names, dtype=np.str_), which.ravel().astype(np.int32)
        return {"file": (origin, self.file), "run": run}

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs, in order of appearance."""
        return tuple(dict.fromkeys(self.run.tolist()))

    @cached_property
    def run_index(self) -> NDArray[np.int64]:
        """(n,) index of each row's run in :attr:`runs`."""
        _names, first, which = np.unique(self.run, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[which.ravel()]

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

    def without_readings(self) -> Measurements:
        """The commands and loads alone."""
        nothing: dict[str, Any] = dict.fromkeys(("position", "quat_wxyz", "angles_rad", "tensions"))
        return dataclasses.replace(self, **nothing)

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
        file = f"{self.files[self.file[row]]} " if self.files else ""
        return f"{file}{self.line[row]}"

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
            # names that rows have in common are kept once
            parts={k: names.astype(object)[index] for k, (names, index) in self._labels.items()},
            line=None if self.files else self.line,
        )

    @cached_property
    def position_mask(self) -> Mask:
        """(3,) coordinates that were read in some row."""
        return np.asarray(np.isfinite(self.position).any(axis=0))

    @cached_property
    def angle_mask(self) -> Mask:
        """(3,) angles that were read in some row; all false with ``quat_wxyz``."""
        return np.asarray(np.isfinite(self.angles_rad).any(axis=0))

    @cached_property
    def tension_mask(self) -> Mask:
        """(m,) cables whose tension was read in some row."""
        return np.asarray(np.isfinite(self.tensions).any(axis=0))

    @property
    def has_position(self) -> bool:
        """Whether any coordinate was read."""
        return bool(self.position_mask.any())

    @property
    def has_orientation(self) -> bool:
        """Whether any part of the orientation was read."""
        return self.quat_wxyz is not None or bool(self.angle_mask.any())

    @property
    def has_tension(self) -> bool:
        """Whether any tension was read."""
        return bool(self.tension_mask.any())

    def lines(self) -> list[str]:
        """What was measured, and what was assumed, filled in or left out."""
        kinds = ("position", "orientation", "tension")
        read = [f"{kind}s" for kind in kinds if getattr(self, f"has_{kind}")]
        what = ", ".join(read) or "commands alone"
        rows, runs = counted(self.n_rows, "row"), counted(len(self.runs), "run")
        return [f"{self.name}: {rows} in {runs}, {what}", *self.notes]

    def records(self) -> list[Record]:
        """Commands and readings row by row, named as in the file; None if not read."""
        return rows_of(dict(self.columns()))

    def columns(self) -> Iterator[tuple[str, list[Any]]]:
        """Names and values (n,) of the file's columns with content, in SI; None if not read."""
        yield "run", self.run.tolist()
        cables = range(1, self.n_cables + 1)
        yield from _columns(["t_s"], self.t_s)
        yield from _columns([f"cmd_{c}" for c in COORDINATES], self.command_pose)
        lengths = [f"length_{i}_m" for i in cables]
        yield from _columns(lengths, self.command_lengths, self.driven)
        if self.wanted is not None:
            stated = np.asarray(np.isfinite(self.wanted).any(axis=0))
            yield from _columns([f"want_{c}" for c in COORDINATES], self.wanted, stated)
        yield from _columns([f"meas_{c}_m" for c in "xyz"], self.position, self.position_mask)
        yield from _columns([f"meas_q{c}" for c in "wxyz"], self.quat_wxyz)
        yield from _columns([f"meas_r{c}_rad" for c in "xyz"], self.angles_rad, self.angle_mask)
        yield from _columns([f"tension_{i}_N" for i in cables], self.tensions, self.tension_mask)
        yield from _columns(["temperature_C"], self.temperature_C)
        if self.loads is not None:
            yield from _load_columns(self.loads)

    def rows(self, index: ArrayLike | slice) -> Measurements:
        """Some rows, by index, mask (n,) or slice."""
        chosen = np.arange(self.n_rows)[index if isinstance(index, slice) else np.asarray(index)]
        there = {k: value for k in _PER_ROW if (value := getattr(self, k)) is not None}
        values: dict[str, Any] = {name: value[chosen] for name, value in there.items()}
        loads = None if self.loads is None else self.loads.rows(chosen)
        return dataclasses.replace(self, loads=loads, **values)
