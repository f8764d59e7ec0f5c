"""From other programs' files to a case folder that every command reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenRobot, check_case, copy_robot, file_of, numbers_of, robot_of
from crosscheck.importing.align import (
    LEFT,
    MOST,
    Frames,
    as_they_are,
    by_points,
    off_commands,
    place_of_target,
    size_of_cloud,
    to_commands,
    unturned,
    with_target,
)
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.join import commanded, joined
from crosscheck.importing.logs import Logged
from crosscheck.importing.noise import noise_of_dwells, noise_words, repeated
from crosscheck.importing.take import READERS, Take, take_of
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.read import load_commands, together
from crosscheck.measurements.write import write_measurements
from seecr.columns.csv import read_table, table_text
from seecr.columns.headers import columns_said, renamed, said_of
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.errors import InputError, InputFileError
from seecr.files import Made, json_text, write_text
from seecr.folders import staged
from seecr.pose import Array
from seecr.result import Record, Result

# Leaves out dwells at which the platform was where it had been, and not where it was commanded.
#
# A run that crashes ends with a platform that does not move any more, whatever is commanded.

# A dwell is not far from its command unless it is so many times as far as most.
_USUAL = 10.0
# It did not follow its command if it moved by less than this part of what was asked.
_FOLLOWED = 0.2


def without_strays(
    robot: Robot, takes: Sequence[Take], frames: Frames
) -> tuple[list[Take], list[str]]:
    """The recordings without dwells that did not follow their commands, and notes on them.

    Such a dwell is far from its command, by the measure by which frames cannot be aligned, much
    farther than most, and the platform has hardly moved since the dwell before, though it was told
    to. If more than a few of a recording are, it is no matter of single dwells: all stay.
    """
    told = [_told(robot, take)[:, :3] for take in takes]
    off = [_off(take, frames, own) for take, own in zip(takes, told, strict=True)]
    usual = float(np.median(np.concatenate(off)))
    limit = max(LEFT * size_of_cloud(np.concatenate(told)), _USUAL * usual)
    out, notes = list[Take](), list[str]()
    for take, own, commands in zip(takes, off, told, strict=True):
        far = (own > limit) & _stood_still(take, commands)
        if 0 < far.sum() <= (1.0 - MOST) * len(far) + 1e-9:
            notes.append(_note(take, far, own, usual))
            number = take.number.copy()
            number[np.flatnonzero(number >= 0)[far]] = -1
            take = replace(take, number=number)
        out.append(take)
    return out, notes


def _stood_still(take: Take, told: Array) -> NDArray[np.bool_]:
    """(n,) whether the platform has hardly moved since the dwell before, though it was told to."""
    place = take.dwells.position[take.used]
    moved, asked = (np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (place, told))
    return np.concatenate([[False], moved < _FOLLOWED * asked])


def _told(robot: Robot, take: Take) -> Array:
    """Commanded poses (n, 7) of the dwells that are used."""
    return commanded(robot, take.held.log.rows(take.held.row[take.number >= 0]))


def _off(take: Take, frames: Frames, told: Array) -> Array:
    """Distances (n,) [m] of the dwells that are used from where they are told to be (n, 3)."""
    quat = take.dwells.quat_wxyz
    place, _turned = frames.poses(
        take.dwells.position[take.used], None if quat is None else quat[take.used]
    )
    return np.asarray(np.linalg.norm(place - told, axis=1))


def _note(take: Take, far: NDArray[np.bool_], off: Array, usual: float) -> str:
    dwells, gone = take.dwells, take.used[far]
    lines = ", ".join(str(int(line)) for line in take.stream.line[dwells.start[gone]])
    return (
        f"{take.stream.path.name}: {counted(len(gone), 'dwell')} left out, from line {lines} on: "
        f"up to {1e3 * float(np.max(off[far])):.4g} mm from where it is commanded, other dwells "
        f"{1e3 * usual:.3g} mm; did the platform stop moving, or do the clocks disagree (--clock)?"
    )


# Significant digits of numbers about dwells.
_WRITTEN = 6
# Time between consecutive recordings [s].
_BETWEEN = 60.0
NAME = "import.json"
FILES = ("robot.xml", "measured.csv", "measured.toml", "dwells.csv", NAME)


@dataclass(frozen=True, eq=False, repr=False)
class Imported(Result):
    """The result of an import.

    Attributes:
        robot: the recorded robot. measured: the dwells as measurements.
        frames: the transform from the tracker's poses to the platform's.
        takes: the recordings. notes: what was done, for people.
    """

    robot: Robot
    measured: Measurements
    frames: Frames
    takes: tuple[Take, ...]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The number of dwells, and what was done."""
        n = int(self.measured.read.sum())
        return [f"{counted(n, 'dwell')} of {self.robot.name}", *self.notes]

    def records(self) -> list[Record]:
        """One row for each dwell: time, number of samples, their scatter and the mean's error."""
        return [
            {
                "file": take.stream.path.name,
                "from_s": float(d.begin_s[k]),
                "to_s": float(d.end_s[k]),
                "from_line": int(take.stream.line[d.start[k]]),
                "to_line": int(take.stream.line[d.stop[k] - 1]),
                "samples": int(d.samples[k]),
                "scatter_m": float(d.scatter_m[k]),
                "scatter_rad": float(d.scatter_rad[k]),
                "error_m": float(d.error_m[k]),
                "error_rad": float(d.error_rad[k]),
            }
            for take in self.takes
            for d in [take.dwells]
            for k in take.used.tolist()
        ]

    def as_json(self) -> dict[str, Any]:
        """The content of ``import.json``, in SI units."""
        return {
            "robot": self.robot.name,
            "files": [str(take.stream.path) for take in self.takes],
            "rows": self.measured.n_rows,
            "dwells": int(self.measured.read.sum()),
            "sigma": self.measured.sigma,
            "sigma_source": self.measured.sigma_source,
            "free": list(self.frames.free),
            "tracker_to_base": {"quat_wxyz": self.frames.turn, "shift_m": self.frames.shift},
            "body_on_platform": {
                "quat_wxyz": self.frames.target_turn,
                "shift_m": self.frames.target_shift,
            },
            "notes": list(self.notes),
        }


def import_case(
    form: str,
    files: str | Path | Sequence[str | Path],
    robot: GivenRobot,
    commands: str | Path | Sequence[str | Path],
    choices: ImportChoices | None = None,
    *,
    out: str | Path | None = None,
) -> Imported:
    """Make measurements of other programs' recordings: of motion capture, or plain logs.

    Args:
        form: "motive" (CSV exports of OptiTrack), "vicon" (of Nexus), or "poses" (a log with the
            columns t_s, x_mm, y_mm, z_mm, qw, qx, qy, qz).
        files: a recording, or several of one tracker that was not moved between them.
        robot: the recorded robot, or its MJCF.
        commands: for each recording a log of commands with times by the same clock, or one row
            per dwell without times.
        choices: what else the user states about the files.
        out: folder for the case, as ``crosscheck import`` writes it; None writes nothing.

    Returns:
        an :class:`Imported`, whose ``measured`` every other function accepts.

    Raises:
        InputFileError, CrosscheckError: any mistake in the files.
        InputError: an unknown form, or a case of a robot without a file.

    Example:
        ``crosscheck.import_case("motive", "take.csv", robot, "commands.csv")``
    """
    if not isinstance(form, str) or form not in READERS:
        raise InputError(f"form must be one of {', '.join(READERS)}, got {form!r}")
    choices = choices or ImportChoices()
    choices.check(form)
    source, robot = None if out is None else file_of(robot), robot_of(robot)
    if out is not None and source is not None:
        check_case(str(out), FILES, source)
    files = [files] if isinstance(files, str | Path) else files
    commands = [commands] if isinstance(commands, str | Path) else commands
    if len(files) != len(commands):
        raise CrosscheckError(
            f"expected {counted(len(files), 'command log')}, one for each recording, got "
            f"{len(commands)}; give --commands once for each file, in their order"
        )
    said: list[str] = []
    theirs = None
    if form == "poses" and columns_said():  # a header may be in one kind of file alone
        theirs = said_of(name for log in commands for name in read_table(Path(log)).names)
    with renamed(theirs):
        logs = [load_commands(log, robot) for log in commands]
    for log in logs:
        said += [f"{log.path.name}: {note}" for note in log.notes]
    with renamed(None, elsewhere=theirs or ()):
        takes = [
            take_of(form, Path(file), robot, log, choices, said)
            for file, log in zip(files, logs, strict=True)
        ]
    frames = _frames(robot, takes, choices)
    takes, strays = without_strays(robot, takes, frames)
    if strays:
        frames = _frames(robot, takes, choices)
    parts = [_measured(take, frames) for take in takes]
    measured = _one([part for part, _noise in parts])
    scatter = noise_of_dwells(takes, [noise for _part, noise in parts])
    sigma, origin, repeats = repeated(measured, scatter)
    measured = replace(
        measured, sigma=sigma, sigma_source=origin, free=frames.free,
        stands=np.ones(measured.n_rows, dtype=bool),
    )  # fmt: skip
    off = off_commands(frames, *_rests(robot, takes)) if choices.aligned else []
    off += unturned(frames, *_rests(robot, takes)) if robot.n_driven >= robot.n_dof else []
    notes = (
        *said,
        *strays,
        frames.how,
        *off,
        noise_words(replace(measured, sigma=scatter)),
        repeats,
    )
    found = Imported(robot, measured, frames, tuple(takes), notes)
    if source is not None:
        write_case(found, source, Path(str(out)))
    return found


def write_case(found: Imported, robot_path: Path, out: Path, made: Made | None = None) -> None:
    """Write the case folder, completely or not at all; ``made`` is its provenance."""
    said = {} if made is None else {"made": made}
    check_case(out, FILES, robot_path)
    read = [file for take in found.takes for file in (take.stream.path, take.held.log.path)]
    with staged(out, read=read, made=made) as folder:
        write_measurements(folder / "measured.csv", found.measured)
        copy_robot(robot_path, folder / "robot.xml", found.robot)
        rows = found.records()
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        write_text(folder / "dwells.csv", table_text(columns, _WRITTEN))
        write_text(folder / NAME, json_text({**said, **found.as_json()}) + "\n")


def _rests(robot: Robot, takes: Sequence[Take]) -> tuple[Array, Array | None, Array]:
    """Tracked positions (n, 3) and quaternions (n, 4), if any, and commanded poses (n, 7)."""
    position = np.concatenate([take.dwells.position[take.used] for take in takes])
    quats = [take.dwells.quat_wxyz for take in takes]
    turned = [q[take.used] for q, take in zip(quats, takes, strict=True) if q is not None]
    quat = np.concatenate(turned) if len(turned) == len(takes) else None
    return position, quat, np.concatenate([_told(robot, take) for take in takes])


def _frames(robot: Robot, takes: Sequence[Take], choices: ImportChoices) -> Frames:
    position, quat, told = _rests(robot, takes)
    # the markers' positions on the platform are given
    target = np.zeros(3) if choices.shape and choices.target is None else choices.target
    if choices.aligned:
        return as_they_are(target)
    names = list(choices.points)
    there = np.array([_place(takes[0].export, name) for name in names])
    here = np.array([choices.points[name] for name in names])
    try:
        if not choices.points:
            return to_commands(position, quat, told, target)
        found = by_points(names, there, here)
    except CrosscheckError as error:
        pairs = [f"{take.stream.path} with {take.held.log.path}" for take in takes]
        raise CrosscheckError(f"{', '.join(pairs)}: {error}") from None
    frames = with_target(found, quat, told, target)
    return frames if target is not None else place_of_target(frames, position, told)


def _place(export: Logged, name: str) -> Array:
    """A marker's mean position (3,) [m], or the coordinates given in its place.

    Raises:
        InputFileError: the marker is never seen.
    """
    if name not in export.markers and name.count(",") == 2:
        return numbers_of("--point", name)
    every = export.marker(name)
    seen = every[np.isfinite(every).all(axis=1)]
    if len(seen) == 0:
        raise InputFileError.at(
            export.path,
            f"never sees marker {name}; expected its position in at least one row; name another "
            "with --point",
        )
    return np.asarray(seen.mean(axis=0))


def _measured(take: Take, frames: Frames) -> tuple[Measurements, Array]:
    rows, noise = joined(take.held, take.dwells, take.number)
    number = take.number[: rows.n_rows]
    there = number >= 0
    used, quat = number[there], take.dwells.quat_wxyz
    place, turn = frames.poses(take.dwells.position[used], None if quat is None else quat[used])
    position = np.full((rows.n_rows, 3), np.nan)
    position[there] = place
    if turn is not None:
        quat = np.full((rows.n_rows, 4), np.nan)
        quat[there] = turn
    return Measurements(
        path=take.stream.path, n_cables=rows.n_cables, run=rows.run, t_s=rows.t_s,
        command_pose=rows.command_pose, command_lengths=rows.command_lengths, told=rows.told,
        position=position, quat_wxyz=quat, tensions=rows.tensions, loads=rows.loads,
        temperature_C=rows.temperature_C, driven=rows.driven,
    ), noise  # fmt: skip


def _one(parts: Sequence[Measurements]) -> Measurements:
    """All recordings as one file, each beginning some time after the end of the one before."""
    if len(parts) == 1:
        return parts[0]
    whole = together(parts)
    assert whole.t_s is not None
    t_s = whole.t_s.copy()
    for k in range(1, len(parts)):
        own = whole.file == k
        t_s[own] += t_s[whole.file == k - 1][-1] + _BETWEEN - t_s[own][0]
    one = np.zeros(whole.n_rows, dtype=np.int64)
    return replace(whole, t_s=t_s, files=(), file=one, notes=())
