"""Commands in time, and the dwell that belongs to each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.importing.dwells import Dwells
from crosscheck.importing.logs import Stream
from crosscheck.measurements.data import Measurements
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import Array
from seecr.prediction.experiment import Experiment

# Differences of times are off by so much [s]: those of the day, in seconds since 1970, are 2e-7
# apart at the least.
_ROUNDED = 1e-6


@dataclass(frozen=True, eq=False)
class HeldCommands:
    """Commands that were held, each from its first row on.

    Attributes:
        log: all rows. row: (k,) first row of each held command.
        begin_s, end_s: (k,) [s] by the tracker's clock; None without times.
        passed: number of set points on the way between them.
        clock: [s] tracker's clock minus commands'.
    """

    log: Measurements
    row: NDArray[np.int64]
    begin_s: Array | None
    end_s: Array | None
    passed: int
    clock: float = 0.0

    def shifted(self, clock: float) -> HeldCommands:
        """The same with a clock offset that is larger by so much [s]."""
        if self.begin_s is None or self.end_s is None:
            return self
        return replace(
            self, begin_s=self.begin_s + clock, end_s=self.end_s + clock, clock=self.clock + clock
        )


def commanded(robot: Robot, log: Measurements) -> Array:
    """Commanded poses (n, 7), or the plain model's poses for commanded lengths."""
    if log.command_pose is not None:
        return log.command_pose
    return Experiment(robot, log.as_commands(robot)).predict(()).pose


def held_commands(log: Measurements, rest_for: float, clock: float, end: float) -> HeldCommands:
    """The commands of a log that were held for ``rest_for`` [s] or longer.

    ``clock`` [s] is the tracker's clock minus the commands', ``end`` [s] the end of its stream.
    """
    command = log.command_pose if log.command_lengths is None else log.command_lengths
    assert command is not None
    changes = np.any(np.abs(np.diff(command, axis=0)) > 1e-9, axis=1)
    if log.loads is not None:  # another load at the same command is another rest
        changes |= log.loads.changes[1:]
    if log.t_s is None:  # a command given twice in succession rests only once
        return HeldCommands(log, np.concatenate([[0], 1 + np.flatnonzero(changes)]), None, None, 0)
    changes |= log.run[1:] != log.run[:-1]
    first = np.concatenate([[0], 1 + np.flatnonzero(changes)])
    begin = log.t_s[first] + clock
    stop = np.append(begin[1:], max(end, begin[-1]))
    held = stop - begin >= rest_for - _ROUNDED
    passed = int((~held).sum())
    return HeldCommands(log, first[held], begin[held], stop[held], passed, clock)


def owners(held: HeldCommands, dwells: Dwells) -> NDArray[np.int64]:
    """(k,) the dwell of each held command: the longest whose middle is in it; -1 for none."""
    assert held.begin_s is not None and held.end_s is not None
    middle = 0.5 * (dwells.begin_s + dwells.end_s)
    number = np.searchsorted(held.begin_s, middle, side="right") - 1
    inside = (number >= 0) & (middle <= held.end_s[np.maximum(number, 0)])
    out = np.full(len(held.row), -1)
    for k in np.argsort(dwells.end_s - dwells.begin_s, kind="stable"):  # the longest comes last
        if inside[k]:
            out[number[k]] = k
    return out


def matched(stream: Stream, held: HeldCommands, dwells: Dwells) -> NDArray[np.int64]:
    """The dwell of each held command, -1 for none.

    Raises:
        InputFileError: without times, if there are not as many dwells as commands; with times, if
            no dwell falls into a command.
    """
    if held.begin_s is None or held.end_s is None:
        if len(dwells) != len(held.row):
            raise stream.error(
                f"rests {counted(len(dwells), 'time')}; expected one rest for each of the "
                f"{counted(len(held.row), 'command')} in {held.log.path.name}, which has no times "
                "to match them by; add a column t_s there, or change --rest-for or --rest-speed"
            )
        return np.arange(len(dwells))
    out = owners(held, dwells)
    if np.all(out < 0):
        raise InputFileError.at(
            held.log.path,
            f"has commands from {held.begin_s[0]:.6g} to {held.end_s[-1]:.6g} s of the tracker's "
            f"clock, but {stream.path.name} rests from {dwells.begin_s[0]:.6g} to "
            f"{dwells.end_s[-1]:.6g} s; expected these times to overlap; give with --clock how far "
            "the tracker's clock is ahead",
        )
    return out


def joined(
    held: HeldCommands, dwells: Dwells, number: NDArray[np.int64]
) -> tuple[Measurements, Array]:
    """The held commands as rows without poses yet, and the noise (k,) of averaged tensions.

    Times are the middles of the dwells; tensions are those of the log, averaged over each dwell.
    """
    last = int(np.flatnonzero(number >= 0)[-1]) + 1
    rows = held.log.rows(held.row[:last])
    number = number[:last]
    middle = 0.5 * (dwells.begin_s + dwells.end_s)
    if rows.t_s is None:
        there = np.flatnonzero(number >= 0)
        t_s = np.interp(np.arange(len(number)), there, middle[number[there]])
    else:
        t_s = np.where(number >= 0, middle[number], rows.t_s + held.clock)
    tensions, error = np.full_like(rows.tensions, np.nan), np.zeros(last)
    if held.log.t_s is not None:
        clocked = held.log.t_s + held.clock
        for row, k in enumerate(number):
            if k >= 0:
                some = (clocked >= dwells.begin_s[k]) & (clocked <= dwells.end_s[k])
                tensions[row], error[row] = _average(held.log.tensions[some])
    return replace(rows, t_s=t_s, tensions=tensions), error


def _average(values: Array) -> tuple[Array, float]:
    """Means (m,) of rows (n, m), NaN if not read, and their rms standard error."""
    there = np.isfinite(values)
    count = there.sum(axis=0)
    mean = np.divide(np.where(there, values, 0.0).sum(axis=0), count,
                     out=np.full(values.shape[1], np.nan), where=count > 0)  # fmt: skip
    several = count > 1
    if not several.any():
        return mean, 0.0
    spread = np.nansum((values - mean) ** 2, axis=0)[several]
    return mean, float(np.sqrt(np.mean(spread / (count[several] * (count[several] - 1)))))
