"""One recording: read, divided into dwells, each with its command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.clock import Clock, find_clock
from crosscheck.importing.dwells import Dwells, find_dwells
from crosscheck.importing.join import HeldCommands, commanded, held_commands, matched
from crosscheck.importing.logged import Logged, Stream
from crosscheck.importing.markers import body_of_markers
from crosscheck.importing.motive import read_motive
from crosscheck.importing.poses import read_poses
from crosscheck.importing.still import refuse_still
from crosscheck.importing.vicon import read_vicon
from crosscheck.measurements.data import Measurements
from seecr.counted import between, counted
from seecr.description.robot import Robot

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
    out += [
        (f"{counted(none, 'held command')} without a dwell: passed without a reading, not compared")
    ] * (none > 0)
    shorter = (
        f"{counted(rest, 'shorter dwell')} of the same commands, or outside all commands, left out"
    )
    out += [shorter] * (rest > 0)
    if take.held.passed:
        passed = counted(take.held.passed, "set point")
        out.append(f"{passed} between held commands left out: the path is taken as straight")
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
