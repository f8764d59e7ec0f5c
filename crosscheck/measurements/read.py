"""Read measurements of a robot: a CSV (or Parquet) with the robot's commands and readings.

Every mistake in a file is reported in one sentence with file, line and column. Units are SI from
here on.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenRobot, robot_of
from crosscheck.measurements.copied import repetitions
from crosscheck.measurements.data import (
    EXAMPLE,
    LEAST_NOISE,
    MOST,
    GivenSigma,
    Measurements,
    Sigma,
    parse_quantity,
)
from crosscheck.measurements.dwells import averaged_dwells
from crosscheck.measurements.plausible import check_readings
from seecr.columns.commands import (
    CHOICES,
    began,
    check_commanded,
    choice,
    known_loads,
    opened,
    runs,
    temperatures,
    times,
)
from seecr.columns.csv import Table
from seecr.columns.known import POSITION, Columns, know_columns
from seecr.columns.poses import (
    command_lengths,
    command_poses,
    measured_orientation,
    wanted_poses,
)
from seecr.commands import Commands, Loads
from seecr.counted import counted
from seecr.effects import known
from seecr.errors import Faults, InputError, InputFileError
from seecr.files import Toml, path_of, read_toml, toml_path
from seecr.folders import check_together
from seecr.pose import Array, rxyz_from_quat

if TYPE_CHECKING:
    from seecr.description.robot import Robot


# The TOML beside a file of measurements: noise, meaning of lengths, start of runs.

_SIGMAS = tuple(item.name for item in fields(Sigma))
# Where stated noise comes from, the default first.
SOURCES = ("stated", "dwell_scatter", "revisited")


@dataclass(frozen=True)
class Beside:
    """The content of the TOML.

    Attributes:
        sigma: stated noise. source: where it comes from, one of :data:`SOURCES`.
        told: ``lengths = "told"``: lengths are told lengths.
        stands: ``start = "first_row"``: runs start at their first row.
        free: names of effects that every fit of these data includes.
    """

    sigma: Sigma = field(default_factory=Sigma)
    source: str = SOURCES[0]
    told: bool = False
    stands: bool = False
    free: tuple[str, ...] = ()


def read_beside(path: Path) -> Beside:
    """Read the TOML.

    Raises:
        InputFileError: a missing or broken TOML, an unknown key, a value that is not a positive
            quantity, or a value that its key does not allow.
    """
    toml = read_toml(path, "expected a TOML file with a table [sigma]")
    _check_names(toml)
    table = toml.content.get("sigma", {})
    if not isinstance(table, dict):
        raise toml.error("sigma must be a table, [sigma]", "sigma")
    said = {key: choice(toml, key) for key in CHOICES}
    source = _source(toml, table)
    values = {key: _sigma(toml, key, value) for key, value in table.items() if key != "source"}
    return Beside(
        Sigma(**values),
        source,
        said["lengths"] == "told",
        said["start"] == "first_row",
        _free(toml),
    )


def _check_names(toml: Toml) -> None:
    """Refuse misspelt keys; other names are the user's own."""
    known = ["sigma", "free", "columns", *CHOICES]
    for name in toml.content:
        if name in _SIGMAS:
            raise toml.error(f"{name} is outside the table [sigma]; put it into that table", name)
        near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.7)
        if name not in known and near:
            shown = "[{}]" if near[0] == "sigma" else "{}"
            what = "table" if near[0] == "sigma" else "key"
            text = f"unknown {what} {shown.format(name)}; expected {shown.format(near[0])}"
            raise toml.error(text, name)


def _source(toml: Toml, table: dict[str, object]) -> str:
    source = table.get("source", SOURCES[0])
    if source not in SOURCES:
        words = " or ".join(f'"{word}"' for word in SOURCES)
        raise toml.error(f"source must be {words}, got {source!r:.60}", "source")
    return str(source)


def _free(toml: Toml) -> tuple[str, ...]:
    names = toml.content.get("free", [])
    sensing = [name for name, effect in known().items() if effect.place == "sensing"]
    if not isinstance(names, list) or not all(name in sensing for name in names):
        text = f'free must be a list of some of {", ".join(sensing)}, such as ["tracker_frame"]'
        raise toml.error(f"{text}, got {names!r}", "free")
    return tuple(dict.fromkeys(names))


def _sigma(toml: Toml, key: str, value: object) -> float:
    if key not in _SIGMAS:
        # Nearest first, so that the likely one is read first.
        keys = (*_SIGMAS, "source")
        likeness = {k: difflib.SequenceMatcher(None, key, k).ratio() for k in keys}
        known = ", ".join(sorted(keys, key=lambda k: -likeness[k]))
        raise toml.error(f"unknown key {key} in [sigma]; known are {known}", key)
    kind, _, unit = key.rpartition("_")
    if isinstance(value, str):
        try:
            return parse_quantity(key, kind, value, LEAST_NOISE)
        except CrosscheckError as error:
            raise toml.error(str(error), key) from None
    # not yet a float, which cannot hold a whole number of hundreds of digits
    number = value if isinstance(value, int | float) and value is not True else 0.0
    if not LEAST_NOISE < number < MOST:
        size = f" between {LEAST_NOISE:g} and {MOST:g}" if number > 0.0 else ""
        text = f'{key} must be a positive number [{unit}]{size} or a text such as "{EXAMPLE[kind]}"'
        raise toml.error(f"{text}, got {value!r:.60}; leave it out if it is not known", key)
    return float(number)


# Several files of one robot as one: days, payloads, trackers set up anew.

# Columns that every file has, be it without a reading.
_IN_ALL = ("position", "tensions", "stands", "line", "copied")
# Relative noise of lengths in files that state none, if others do: practically zero.
_EXACT = 1e-6


def together(parts: Sequence[Measurements]) -> Measurements:
    """The measurements of several files, as read, with separate runs, clocks and noise.

    Raises:
        InputFileError: a file given twice, or commands of another kind than in the first.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    _check_alike(parts)
    names = _short_names([part.path for part in parts])
    sigma, ratio, said = _noise(parts, names)
    pairs = zip(parts, names, strict=True)
    notes = [f"{name}: {note}" for part, name in pairs for note in part.notes]
    t_s, lost_times = _of_all("t_s", [part.t_s for part in parts], names)
    free = {
        name: tuple(k for k, part in enumerate(parts) if name in part.free)
        for part in parts for name in part.free
    }  # fmt: skip
    warmth, lost_warmth = _of_all("temperature_C", [part.temperature_C for part in parts], names)
    quat, angles = _orientations(parts)
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _IN_ALL
    }
    whole = Measurements(
        path=Path(" + ".join(names)),
        n_cables=first.n_cables,
        driven=first.driven,
        run=np.concatenate(
            [np.char.add(f"{n}: ", part.run) for part, n in zip(parts, names, strict=True)]
        ),
        t_s=t_s,
        command_pose=_stack([part.command_pose for part in parts]),
        command_lengths=_stack([part.command_lengths for part in parts]),
        told=first.told,
        wanted=_filled(parts, "wanted", 7),
        quat_wxyz=quat,
        angles_rad=angles,
        temperature_C=warmth,
        loads=_loads(parts),
        free=tuple(free),
        free_in=free,
        sigma=sigma,
        sigma_source=_common_source(parts),
        sigma_ratio=ratio,
        files=tuple(names),
        origins=tuple(_short_names([part.path.resolve() for part in parts], 2)),
        file=np.repeat(np.arange(len(parts)), [part.n_rows for part in parts]),
        unused_columns=tuple(dict.fromkeys(name for part in parts for name in part.unused_columns)),
        notes=(*notes, *said, *lost_times, *lost_warmth),
        **columns,
    )
    said, copied = repetitions(whole, across=True)
    return replace(whole, copied=whole.copied | copied, notes=(*said, *whole.notes))


def _check_alike(parts: Sequence[Measurements]) -> None:
    first, seen = parts[0], set()
    for part in parts:
        place = part.path.resolve()
        if place in seen:
            raise InputFileError.at(part.path, "is given twice; expected each file once")
        seen.add(place)
        if _commanded_in(part) != _commanded_in(first):
            raise InputFileError.at(
                part.path,
                f"commands {_commanded_in(part)}, but {first.path} {_commanded_in(first)}; "
                "expected files with the same kind of commands; use them one at a time",
            )


def _commanded_in(data: Measurements) -> str:
    if data.command_lengths is None:
        return "poses"
    return "told lengths" if data.told else "absolute lengths"


def _short_names(paths: Sequence[Path], least: int = 1) -> list[str]:
    """Names that tell files apart, with as many folders as necessary."""
    for depth in range(least, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]


def _stack(columns: Sequence[Array | None]) -> Array | None:
    there = [column for column in columns if column is not None]
    return np.concatenate(there) if len(there) == len(columns) else None


def _filled(parts: Sequence[Measurements], name: str, width: int) -> Array | None:
    """A table (n, width) of all files; NaN in those without it, None if none has it."""
    tables = [getattr(part, name) for part in parts]
    if all(table is None for table in tables):
        return None
    pairs = zip(parts, tables, strict=True)
    blank = [np.full((part.n_rows, width), np.nan) if t is None else t for part, t in pairs]
    return np.concatenate(blank)


def _of_all(
    what: str, columns: Sequence[Array | None], names: Sequence[str]
) -> tuple[Array | None, list[str]]:
    """A column of all files, or None if some file lacks it; and a note about that."""
    without = [name for name, column in zip(names, columns, strict=True) if column is None]
    if not without or len(without) == len(columns):
        return _stack(columns), []
    return None, [f"{', '.join(without)} without {what}: that of the others is not used."]


def _orientations(parts: Sequence[Measurements]) -> tuple[Array | None, Any]:
    """Quaternions, or angles if some file has only these."""
    if any(part.angle_mask.any() for part in parts):
        quats = [(part.angles_rad, part.quat_wxyz) for part in parts]
        return None, np.concatenate([a if q is None else rxyz_from_quat(q) for a, q in quats])
    return _filled(parts, "quat_wxyz", 4), None


def _loads(parts: Sequence[Measurements]) -> Loads | None:
    if all(part.loads is None for part in parts):
        return None
    whole, *others = [part.loads or Loads.of(part.n_rows) for part in parts]
    for other in others:
        whole = whole.followed_by(other)
    return whole


def _noise(parts: Sequence[Measurements], names: Sequence[str]) -> tuple[Sigma, Array, list[str]]:
    """Noise of the first file that states it, each row's ratio to it, and notes about gaps."""
    kinds = [item.name for item in fields(Sigma)]
    common: dict[str, float] = {}
    ratios = np.ones((len(parts), len(kinds)))
    notes = []
    for k, kind in enumerate(kinds):
        own = [getattr(part.sigma, kind) for part in parts]
        stated = [i for i, value in enumerate(own) if value is not None]
        if not stated:
            continue
        common[kind] = own[stated[0]]
        otherwise = _EXACT if kind == "length_m" else 1.0
        ratios[:, k] = [otherwise if v is None else v / common[kind] for v in own]
        without = [names[i] for i in range(len(parts)) if i not in stated]
        if without:
            other = f"that of {names[stated[0]]} is used"
            then = "these lengths are taken as exact" if kind == "length_m" else other
            notes.append(f"{', '.join(without)} without {kind}: {then}.")
    return Sigma(**common), np.repeat(ratios, [part.n_rows for part in parts], axis=0), notes


def _common_source(parts: Sequence[Measurements]) -> str:
    """A lower bound in any file makes the common noise one."""
    found = [part.sigma_source for part in parts if part.sigma.stated]
    return "dwell_scatter" if "dwell_scatter" in found else next(iter(found), "stated")


GivenData: TypeAlias = Measurements | str | Path | Sequence[Measurements | str | Path]
"""Measurements, their file, or several of these of one robot."""

_NONE = "there are no commands; expected one or more"

GivenCommands: TypeAlias = Measurements | Commands | str | Path | ArrayLike
"""Commands, their file, or commanded poses (n, 7)."""


def load_measurements(
    path: GivenData,
    robot: GivenRobot,
    *,
    sigma: GivenSigma = None,
    sigma_path: str | Path | None = None,
) -> Measurements:
    """Read measurements, and the TOML beside them if there is one: noise and the like.

    Args:
        path: CSV or Parquet, or several of them: each has its own TOML, and runs stay separate.
            Measurements may stand among them.
        robot: the measured robot, or its MJCF.
        sigma: noise, in place of the TOML's for the kinds that it states, in all files.
        sigma_path: the TOML, if its name is not the data file's with ``.toml``.

    Returns:
        the measurements, SI, with what was not read as NaN.

    Raises:
        InputFileError: any mistake in either file.
        InputError: no path, or ``sigma`` is no noise.

    Example:
        ``crosscheck.load_measurements("measured.csv", robot).n_rows``
    """
    robot = robot_of(robot)
    noise = Sigma.of(sigma)
    paths = [path] if isinstance(path, str | Path) or not isinstance(path, Sequence) else path
    for one in paths:
        if not isinstance(one, Measurements | str | Path):
            raise InputError(f"expected measurements or their files, got {type(one).__name__}")
    if not paths:
        raise InputError("expected measurements or their files, got none")
    faults = Faults()
    parts = [
        one if isinstance(one, Measurements) else faults.of(_measured, Path(one), robot, sigma_path)
        for one in paths
    ]
    faults.check()
    return stated(together(parts), noise)


def stated(data: Measurements, sigma: Sigma | None) -> Measurements:
    """The measurements with the noise that is stated for them, the same in all files."""
    if sigma is None or not sigma.stated:
        return data
    ratio = data.sigma_ratio.copy()
    ratio[:, [item.name in sigma.stated for item in fields(Sigma)]] = 1.0
    whole = replace(data.sigma, **sigma.stated)
    # what the caller states is no lower bound
    return replace(data, sigma=whole, sigma_ratio=ratio, sigma_source=SOURCES[0])


def _measured(path: Path, robot: Robot, sigma_path: str | Path | None) -> Measurements:
    toml = _toml_of(path, sigma_path)
    columns = opened(path, robot, toml)
    data = _load(columns, robot, toml)
    if not (data.has_position or data.has_orientation or data.has_tension):
        raise columns.table.error(
            "no measurement; expected readings in at least one column such as meas_x_m, meas_qw "
            f"to meas_qz, meas_rx_rad or tension_1_N{columns.near_misses()}"
        )
    return data


def load_commands(
    path: str | Path,
    robot: GivenRobot,
    *,
    sigma: GivenSigma = None,
    sigma_path: str | Path | None = None,
) -> Measurements:
    """Like :func:`load_measurements`, for commands that have not been measured yet.

    Args:
        path: CSV or Parquet.
        robot: the robot to be commanded, or its MJCF.
        sigma: noise to expect, in place of the TOML's for the kinds that it states.
        sigma_path: the TOML, if its name is not the data file's with ``.toml``.

    Returns:
        the commands; readings may be missing.

    Raises:
        InputFileError: any mistake in either file.
        InputError: no path, or ``sigma`` is no noise.

    Example:
        ``crosscheck.load_commands("measured.csv", robot)``
    """
    robot, noise = robot_of(robot), Sigma.of(sigma)
    path = path_of(path, "commands")
    toml = _toml_of(path, sigma_path)
    return stated(_load(opened(path, robot, toml), robot, toml), noise)


def measurements_of(given: GivenData, robot: Robot, sigma: GivenSigma = None) -> Measurements:
    """The measurements, read if a path is given, with the dwells of long logs averaged.

    ``sigma`` is stated for the kinds that it has, in place of what they or their files say.
    """
    whole = given if isinstance(given, Measurements) else load_measurements(given, robot)
    return averaged_dwells(stated(whole, Sigma.of(sigma)))


def commands_of(given: GivenCommands, robot: Robot) -> Measurements:
    """The commands, read if a path is given; poses (n, 7) are one run, and so are commands without.

    Raises:
        InputFileError: any mistake in the file.
        InputError: something other than commands, or none.
    """
    if isinstance(given, str | Path):
        return load_commands(given, robot)
    if isinstance(given, Measurements | Commands):
        if (given.n_rows if isinstance(given, Measurements) else len(given)) == 0:
            raise InputError(_NONE)
        return given if isinstance(given, Measurements) else _of_one_clock(given, robot)
    return _of_poses(given, robot)


def _of_poses(given: ArrayLike, robot: Robot) -> Measurements:
    """Poses (n, 7) as a file of them would be read, one run."""
    from seecr.statics.starts import commanded_poses  # takes a while to import

    pose = commanded_poses(given, robot=robot)
    if len(pose) == 0:
        raise InputError(_NONE)
    run = np.full(len(pose), "all")
    return Measurements(Path("poses.csv"), robot.n_cables, run, command_pose=pose)


def _of_one_clock(given: Commands, robot: Robot) -> Measurements:
    """Commands as a file of them would be read."""
    from seecr.statics.starts import answered, commanded_poses  # takes a while to import

    if given.clock is not None and len(np.unique(given.clock)) > 1:
        raise InputError("commands of several clocks; expected those of one file")
    lengths, n = answered(given).lengths, len(given)
    run = np.full(n, "all") if given.run is None else given.run
    return Measurements(
        Path("commands.csv"),
        robot.n_cables,
        run.astype(np.str_),
        command_pose=commanded_poses(given.pose, robot=robot) if lengths is None else None,
        command_lengths=lengths,
        told=given.told and lengths is not None,
        driven=robot.driven,
        t_s=given.time,
        temperature_C=given.temperature,
        loads=given.loads,
        stands=np.zeros(n, dtype=bool) if given.stands is None else given.stands,
        line=np.arange(2, n + 2) if given.line is None else given.line,
    )


def _toml_of(path: Path, sigma_path: str | Path | None) -> Path | None:
    """The TOML of a file, if it has one; one that is named must exist."""
    if sigma_path is not None:
        return Path(sigma_path)
    beside = toml_path(path)
    check_together(path, beside)
    return beside if beside.exists() else None


def table_measurements(table: Table, robot: Robot) -> Measurements:
    """Measurements, or commands alone, of a table without a TOML.

    Raises:
        InputFileError: with a line for each mistake.
    """
    return _load(know_columns(table, robot.n_cables, robot.cable_names), robot, None)


def _load(columns: Columns, robot: Robot, toml: Path | None) -> Measurements:
    cables = [str(i + 1) for i in range(robot.n_cables)]
    check_commanded(
        columns, robot, lambda c: c.readings("meas", POSITION), measured_orientation,
        lambda c: c.readings("tension", cables), lambda c: wanted_poses(c, robot),
        lambda c: None if toml is None else read_beside(toml),
    )  # fmt: skip
    run = runs(columns)
    t_s, temperature = times(columns, run), temperatures(columns)
    lengths = command_lengths(columns, robot)
    pose = command_poses(columns, robot) if lengths is None else None
    position = columns.readings("meas", POSITION)
    quat, angles = measured_orientation(columns)
    beside = Beside() if toml is None else read_beside(toml)
    if beside.told and lengths is None:
        columns.notes.append('lengths = "told" has no effect here: the commands are poses.')
    data = Measurements(
        path=columns.table.path,
        n_cables=robot.n_cables,
        driven=robot.driven,
        run=run,
        t_s=t_s,
        began=None if t_s is None else began(columns.table, columns.known["t"].index),
        command_pose=pose,
        command_lengths=lengths,
        told=beside.told and lengths is not None,
        wanted=wanted_poses(columns, robot),
        position=position,
        quat_wxyz=quat,
        angles_rad=angles,
        tensions=columns.readings("tension", cables),
        temperature_C=temperature,
        loads=known_loads(columns, robot),
        stands=np.full(columns.n_rows, beside.stands),
        free=beside.free,
        sigma=beside.sigma,
        sigma_source=beside.source,
        line=columns.table.line,
        unused_columns=columns.unused,
    )
    repeated, copied = repetitions(data)
    odd = check_readings(columns, robot, data)
    notes = (*repeated, *columns.notes, *_way_points(data), *odd)
    return replace(data, copied=copied, notes=notes)


def _way_points(data: Measurements) -> list[str]:
    silent = int(np.sum(~data.read))
    if not 0 < silent < data.n_rows:
        return []
    has, which = (
        ("has", "a way point, which is") if silent == 1 else ("have", "way points, which are")
    )
    return [f"{counted(silent, 'row')} {has} a command but no reading: {which} not compared."]
