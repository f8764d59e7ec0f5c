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
from crosscheck.importing.dwells import about_mean, joined
from crosscheck.importing.logs import Logged
from crosscheck.importing.take import READERS, Take, take_of
from crosscheck.measurements.data import LEAST, Measurements, Sigma
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
    told = [take.told(robot)[:, :3] for take in takes]
    places = [frames.poses(*take.tracked)[0] for take in takes]
    off = [np.linalg.norm(at - to, axis=1) for at, to in zip(places, told, strict=True)]
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
    position, quats = zip(*(take.tracked for take in takes), strict=True)
    turned = [quat for quat in quats if quat is not None]
    quat = np.concatenate(turned) if len(turned) == len(takes) else None
    return np.concatenate(position), quat, np.concatenate([take.told(robot) for take in takes])


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
    there = take.number[: rows.n_rows] >= 0
    place, turn = frames.poses(*take.tracked)
    position, quat = np.full((rows.n_rows, 3), np.nan), None
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


# The noise of imported poses: within dwells, and between visits, which show more.
#
# An error that stays the same for a whole dwell, such as a tracker's in its volume or a platform
# that sticks, is in no scatter within dwells. What repeats at one place in every visit is in
# neither.

# From so many further visits on the size is known to a factor of 1.4, as a stated one is: that of
# three coordinates has a relative error of 1 / sqrt(6 n), twice which is 0.4.
_LEAST_VISITS = 4
_NOISE_DIGITS = 3

# Samples that scatter by less than this part of the least change between them show the last digit
# written and no noise. From q / 2 on, the mean of numbers rounded to q is off by 0.002 q at most:
# q exp(-2 (pi / 2)^2) / pi, the first term of the Fourier series of the rounding error.
_DIGITS = 0.5


def noise_of_dwells(takes: Sequence[Take], tensions: Sequence[Array]) -> Sigma:
    """The noise of means, over all dwells; None if the rounding in the files hides it."""

    def pooled(values: Array) -> float | None:
        rms = _rms(values)
        return float(f"{rms:.3g}") if rms > LEAST else None

    def of_means(unit: str) -> float | None:
        error, scatter, step = (
            np.concatenate([getattr(t.dwells, f"{what}_{unit}")[t.used] for t in takes])
            for what in ("error", "scatter", "step")
        )
        hidden = _rms(scatter) < _DIGITS * np.min(step, initial=np.inf)
        return None if hidden else pooled(error)

    pulls = np.concatenate([noise[noise > 0.0] for noise in tensions])
    return Sigma(of_means("m"), of_means("rad"), pooled(pulls))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def noise_words(measured: Measurements) -> str:
    """How large the noise of means is, and of which kind it is not stated."""
    sigma, parts = measured.sigma, []
    if sigma.position_m:
        parts.append(f"position {1e3 * sigma.position_m:.2g} mm")
    if sigma.orientation_rad:
        parts.append(f"orientation {np.degrees(sigma.orientation_rad):.2g} deg")
    if sigma.tension_N:
        parts.append(f"tension {sigma.tension_N:.2g} N")
    out = (
        "noise of the means, estimated from the means of parts of each dwell: "
        f"{', '.join(parts) or 'none'}"
    )
    hidden = ["position"] * (sigma.position_m is None)
    hidden += ["orientation"] * (sigma.orientation_rad is None and measured.quat_wxyz is not None)
    if not hidden:
        return out
    return (
        f"{out}; {' and '.join(hidden)} not stated: within a dwell only the last digit changes, if "
        "any, which shows no noise; other commands estimate it"
    )


def repeated(data: Measurements, scatter: Sigma) -> tuple[Sigma, str, str]:
    """The noise that revisited poses show, if enough were, or else that of dwells.

    Visits are compared that have one command and load, and came from one command before: what
    depends on the way there, such as backlash, is no noise.

    Args:
        data: a row for each dwell. scatter: the noise of their means, from within dwells.

    Returns:
        the noise to state, the larger one of each kind; where it comes from; and a sentence.
    """
    visits = [rows for rows in _visits(data) if len(rows) > 1]
    quat = data.quat_wxyz
    kinds = {
        "position_m": [_off(data.position[rows]) for rows in visits],
        "orientation_rad": [] if quat is None else [about_mean(quat[rows])[1] for rows in visits],
        "tension_N": [_off(data.tensions[rows]) for rows in visits],
    }
    further = sum(len(rows) - 1 for rows in visits)
    sizes = {kind: _pooled(some, visits) for kind, some in kinds.items()}
    if further < _LEAST_VISITS or not sizes["position_m"]:
        said = "no pose was revisited often enough to tell how well poses repeat"
        return scatter, "dwell_scatter", f"{said}: the true noise may be larger"
    own = vars(scatter)
    stated = {kind: max(size, own[kind] or 0.0) for kind, size in sizes.items() if size}
    said = f"revisited poses ({counted(further, 'further visit')}) repeat to "
    said += f"{1e3 * float(sizes['position_m']):.2g} mm"
    if sizes["orientation_rad"]:
        said += f" and {np.degrees(sizes['orientation_rad']):.2g} deg"
    return replace(scatter, **stated), "revisited", f"{said}: the larger is stated as the noise"


def _visits(data: Measurements) -> list[list[int]]:
    """Rows that were read with one command and load, after the same command; runs begin at rest."""
    told = data.command_pose if data.command_lengths is None else data.command_lengths
    assert told is not None
    load = np.zeros((data.n_rows, 1)) if data.loads is None else data.loads.mass[:, None]
    keys = np.concatenate([told, load], axis=1).round(9)
    same_run = np.concatenate([[False], data.run[1:] == data.run[:-1]])
    before = np.where(same_run[:, None], np.roll(keys, 1, axis=0), np.inf)
    groups: dict[bytes, list[int]] = {}
    whole = np.isfinite(data.position).all(axis=1)
    for row in np.flatnonzero(whole).tolist():
        groups.setdefault(keys[row].tobytes() + before[row].tobytes(), []).append(row)
    return list(groups.values())


def _off(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=0))


def _pooled(off: list[Array], visits: list[list[int]]) -> float | None:
    """The rms of what visits are off their means, in each part that was read; None of nothing."""
    squares = sum(float(np.nansum(one**2)) for one in off)
    count = sum(
        (len(rows) - 1) * int(np.isfinite(one).all(axis=0).sum())
        for one, rows in zip(off, visits, strict=False)
    )
    return float(f"{np.sqrt(squares / count):.{_NOISE_DIGITS}g}") if squares > 0.0 else None
