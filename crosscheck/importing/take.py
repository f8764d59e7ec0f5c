"""One recording: read, divided into dwells, each with its command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.importing.align import size_of_cloud
from crosscheck.importing.capture import read_motive, read_vicon
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.dwells import (
    LEAST,
    Dwells,
    HeldCommands,
    commanded,
    find_dwells,
    held_commands,
    matched,
    owners,
    sample_noise,
)
from crosscheck.importing.logs import Logged, Stream
from crosscheck.importing.poses import body_of_markers, read_poses
from crosscheck.measurements.data import Measurements
from seecr.counted import between, counted, some
from seecr.description.robot import Robot
from seecr.pose import Array

# Refuses a recorded body that stands still while the robot is commanded to move: a wrong one.

# A body moves if it is farther from its middle than this many times its noise, or than rounding
# [m]. It should, if commands are so many times as far from theirs.
_NOISE, _ROUNDED, _COMMANDED = 6.0, 1e-9, 10.0
_MOST_NAMED = 12


def refuse_still(stream: Stream, export: Logged, log: Measurements, choices: ImportChoices) -> None:
    """Refuse a body that never moves, such as one on the robot's frame.

    Raises:
        InputFileError: it does not move, and the commands do.
    """
    seen = stream.position[stream.seen]
    if len(seen) < LEAST:  # which is refused for that
        return
    moved = size_of_cloud(seen)
    if moved > max(_NOISE * sample_noise(stream), _ROUNDED) or not _told_to_move(log, moved):
        return
    others = [name for name in export.bodies if name != choices.body]
    there = f" The file also has {some(others, _MOST_NAMED)}." if others else ""
    within = f"{1e3 * moved:.2g}" if moved > _ROUNDED else "0"
    name = f"the body {choices.body}" if choices.body else "the body"
    if choices.markers:
        name = f"the body of {', '.join(choices.markers)}"
    raise stream.error(
        f"{name} never moves: it stays within {within} mm (rms), while the "
        f"commands of {log.path.name} move the platform; expected the body on the platform: is it "
        f"another one (--body)?{there}"
    )


def _told_to_move(log: Measurements, moved: float) -> bool:
    """Whether commands move the platform by much more than ``moved`` [m]."""
    least = _COMMANDED * max(moved, _ROUNDED)
    if log.command_pose is not None:
        return size_of_cloud(log.command_pose[:, :3]) > least
    return bool(np.any(np.ptp(np.asarray(log.command_lengths), axis=0) > least))


# Offset between the tracker's clock and that of the commands, found from the resting poses.
#
# Two programs that log at the same time seldom share a clock. The distance between two resting
# poses is the same in any frame: with the right offset the tracked distances are those between
# commands.

# Least number of rests that show a pattern.
_LEAST = 4
# Number of offsets tried: those at which most commands begin as the platform leaves a rest.
_MOST = 40
# Of more commands so many are asked, evenly spaced: pairs of a thousand are a million, and tell as
# much. Those of 15,000 took 15 GB.
_MOST_ASKED = 1000
# Distances that are off by this part of their usual size still match. An offset is accepted if all
# others are worse by this factor, and no offset is preferred unless it is worse by as much.
_ALIKE, _CLEAR = 0.2, 1.5
# If the clocks match as they are, moves must begin late or early by times that differ by less than
# this part of the shift, for most commands, to say what the shift is.
_STEADY, _BULK = 0.25, 0.75


@dataclass(frozen=True)
class Clock:
    """An offset between two clocks.

    Attributes:
        shift: [s] tracker's clock minus commands'.
        said: how it was found; empty if the clocks agree or nothing can be inferred.
    """

    shift: float
    said: tuple[str, ...] = ()


def find_clock(held: HeldCommands, told: Array, rests: Dwells, least: float = 0.0) -> Clock:
    """The offset that matches the rests with the commands.

    A small offset leaves most rests with their commands, and so does a robot that begins to move
    late, or slowly. Readings do not tell which it is: that is said, and the offset is left alone.

    Args:
        held: by the clock of the commands. told: (k, 3) [m] where they should bring the platform.
        rests: of the whole stream, not cut where commands begin.
        least: [s] offsets smaller than this do not matter.
    """
    assert held.begin_s is not None and held.end_s is not None
    if min(len(held.row), len(rests)) < _LEAST:
        return Clock(0.0)
    shifts = _likely(held.begin_s, rests.end_s)
    whose = [owners(held.shifted(shift), rests) for shift in shifts]
    off = np.array([_off(told, rests.position, number) for number in whose])
    best = int(np.argmin(off))
    if off[0] <= _CLEAR * off[best]:
        best = 0
    others = [o for o, number in zip(off, whose, strict=True) if _other(number, whose[best])]
    if off[best] >= _ALIKE or off[best] * _CLEAR >= min(others, default=np.inf):
        return Clock(0.0)
    late = _late(held.end_s, rests, whose[best])
    if best == 0 and len(late) == 0:
        return Clock(0.0)
    shift, n = float(np.median(late)) if len(late) else float(shifts[best]), len(late)
    if best == 0:
        unsteady = float(np.quantile(np.abs(late - shift), _BULK)) > _STEADY * abs(shift)
        small = abs(shift) < max(least, 1e-9)
        when = "after" if shift > 0.0 else "before"
        said = (
            f"moves begin about {abs(shift):.3f} s {when} they are commanded; if that is the "
            f"clocks and not the robot, give --clock {shift:.3f}"
        )
        return Clock(0.0, () if small or unsteady else (said,))
    sign = "more" if shift > 0.0 else "less"
    moves = f"{counted(n, 'command')} at which the platform starts to move"
    said = (
        f"the tracker's clock shows {abs(shift):.3f} s {sign} than that of the commands, estimated "
        f"from {moves if n else 'where the platform rests'} (--clock {shift:.3f})"
    )
    return Clock(shift, (said,))


def _likely(begin: Array, end: Array) -> Array:
    """Offsets [s], zero first, at which many commands begin as a rest ends."""
    every = np.sort((end[None, :] - begin[1 + _asked(len(begin) - 1), None]).ravel())
    gap = 0.25 * float(np.min(np.diff(begin)))
    votes = np.searchsorted(every, every + gap) - np.searchsorted(every, every - gap)
    found: list[float] = [0.0]
    for k in np.argsort(-votes, kind="stable"):
        if all(abs(every[k] - other) > gap for other in found[1:]):
            found.append(float(every[k]))
        if len(found) > _MOST:
            break
    return np.array(found)


def _off(told: Array, place: Array, number: NDArray[np.int64]) -> float:
    """Relative error of the distances between rests, compared with those between commands.

    Missing rests count as if their distances were zero.
    """
    if np.sum(number >= 0) < _LEAST:
        return np.inf
    some = _asked(len(told))
    every = round(min(len(told), len(place)) * len(some) / len(told))
    told, number = told[some], number[some]
    there = number >= 0
    wanted, got = _distances(told[there]), _distances(place[number[there]])
    usual = float(np.mean(_distances(told) ** 2))
    n = int(there.sum())
    lacking = max(every**2 - n**2, 0) * usual
    return float(np.sqrt((np.sum((wanted - got) ** 2) + lacking) / (max(every, n) ** 2 * usual)))


def _asked(count: int) -> NDArray[np.intp]:
    """Which of so many commands are asked: all, or of many some, evenly spaced."""
    return np.linspace(0, count - 1, min(count, _MOST_ASKED)).astype(np.intp)


def _distances(points: Array) -> Array:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=-1))


def _other(number: NDArray[np.int64], best: NDArray[np.int64]) -> bool:
    """Whether rests belong to other commands, not only one more or less at an end."""
    both = (number >= 0) & (best >= 0)
    return bool(np.any(number[both] != best[both]) or 2 * both.sum() < (best >= 0).sum())


def _late(end: Array, rests: Dwells, number: NDArray[np.int64]) -> Array:
    """Times [s] from the end of each held command to that of its rest, if another one follows.

    A command ends with the next set point, which may only be passed on the way to the next rest.
    """
    k = np.flatnonzero((number[:-1] >= 0) & (number[1:] >= 0))
    return np.asarray(rests.end_s[number[k]] - end[k])


READERS: Mapping[str, Callable[[Path, ImportChoices], Logged]] = {
    "motive": lambda path, choices: read_motive(path),
    "vicon": lambda path, choices: read_vicon(
        path, choices.rotation, bodies_too=not choices.markers
    ),
    "poses": lambda path, choices: read_poses(path, choices.unit),
}
"""Formats by name."""


@dataclass(frozen=True, eq=False)
class Take:
    """One recording: its stream, the commands held in it, the dwells, and each command's dwell."""

    stream: Stream
    export: Logged
    held: HeldCommands
    dwells: Dwells
    number: NDArray[np.int64]

    @property
    def used(self) -> NDArray[np.int64]:
        """Dwells that belong to a command, in the order of the commands."""
        return self.number[self.number >= 0]

    @property
    def tracked(self) -> tuple[Array, Array | None]:
        """Positions (n, 3) and quaternions (n, 4), if any, of these dwells, as tracked."""
        quat = self.dwells.quat_wxyz
        return self.dwells.position[self.used], None if quat is None else quat[self.used]

    def told(self, robot: Robot) -> Array:
        """Commanded poses (n, 7) of these dwells."""
        return commanded(robot, self.held.log.rows(self.held.row[self.number >= 0]))


def take_of(
    form: str, path: Path, robot: Robot, log: Measurements, choices: ImportChoices, said: list[str]
) -> Take:
    export = READERS[form](path, choices).seen_only()
    export = replace(export, up=choices.up or export.up).upright()
    stream, fit = _stream(export, choices)
    refuse_still(stream, export, log, choices)
    arm = float(np.sqrt(np.mean(np.sum(robot.anchor_points**2, axis=1))))
    clock = _clock(stream, robot, log, choices, arm, _apart(export.began, log.began))
    held = held_commands(log, choices.rest_for, clock.shift, float(stream.t_s[-1]))
    if len(held.row) == 0:
        raise CrosscheckError(
            f"{log.path}: no command is held for {choices.rest_for:g} s; expected poses that are "
            "held; give a shorter --rest-for"
        )
    breaks = np.zeros(0) if held.begin_s is None else held.begin_s
    dwells = find_dwells(stream, breaks, choices.rest_for, choices.rest_speed, arm)
    take = Take(stream, export, held, dwells, matched(stream, held, dwells))
    said += [f"{path.name}: {note}" for note in (*export.notes, *fit, *clock.said, *_told(take))]
    return take


def _apart(tracker: datetime | None, commands: datetime | None) -> float:
    """Clock offset [s] from the times of day, if both files state them, with zones or without."""
    if tracker is None or commands is None or (tracker.tzinfo is None) != (commands.tzinfo is None):
        return 0.0
    return (commands - tracker).total_seconds()


def _clock(
    stream: Stream,
    robot: Robot,
    log: Measurements,
    choices: ImportChoices,
    arm: float,
    apart: float,
) -> Clock:
    """The clock offset, from the user or found, on top of that by times of day (``apart`` [s])."""
    if choices.clock is not None or log.t_s is None:
        return Clock(apart + (choices.clock or 0.0))
    held = held_commands(log, choices.rest_for, apart, np.inf)
    told = commanded(robot, log.rows(held.row))[:, :3]
    rests = find_dwells(stream, np.zeros(0), choices.rest_for, choices.rest_speed, arm)
    found = find_clock(held, told, rests, 0.5 * choices.rest_for)
    return Clock(apart + found.shift, found.said)


def _told(take: Take) -> list[str]:
    dwells, used = take.dwells, take.used
    n = dwells.samples[used]
    out = [
        f"{counted(len(used), 'dwell')} of {between(n.min(), n.max(), 'd')} samples (slower than "
        f"{1e3 * dwells.speed:.2g} mm/s), which scatter by "
        f"{1e3 * float(np.sqrt(np.mean(dwells.scatter_m[used] ** 2))):.2g} mm"
    ]
    none = int((take.number < 0).sum())
    rest = len(dwells) - len(used)
    for count, what, words in (
        (none, "held command", "without a dwell: passed without a reading, not compared"),
        (rest, "shorter dwell", "of the same commands, or outside all commands, left out"),
        (take.held.passed, "set point", "between held commands left out: the path is taken as "
         "straight"),
    ):  # fmt: skip
        out += [f"{counted(count, what)} {words}"] if count else []
    return out


def _stream(export: Logged, choices: ImportChoices) -> tuple[Stream, tuple[str, ...]]:
    if not choices.markers:
        return export.body(choices.body), ()
    lacking = [name for name in choices.markers if choices.shape and name not in choices.shape]
    if lacking:
        raise CrosscheckError(
            f"--shape has no position of {', '.join(lacking)}; expected a row for each of --markers"
        )
    shape = np.array([choices.shape[name] for name in choices.markers]) if choices.shape else None
    stream, said = body_of_markers(export, list(choices.markers), shape)
    return stream, (said,)
