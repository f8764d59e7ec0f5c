"""Dwells: where a stream rests, and its mean readings there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crosscheck.importing.logs import Stream
from crosscheck.measurements.data import Measurements
from crosscheck.measurements.dwells import mean_error, mean_rotation
from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import Array, quat_conjugate, quat_multiply, rotvec_from_quat
from seecr.prediction.experiment import Experiment

REST_FOR = 0.5
"""Shortest dwell [s]."""

# Speeds are differences of means over this time before and after [s].
_WINDOW = 0.1
# At rest is slower than this many times the speed that noise simulates, or this part of the usual
# speed of motion.
_NOISE, _PART = 6.0, 0.01
# Fewest samples of a dwell.
LEAST = 5
# Smaller changes [m, rad] are rounding of our own arithmetic.
_SAME = 1e-10
# Times are written with so many digits: differences are off by up to this part of an interval.
_ROUNDED = 1e-3


@dataclass(frozen=True, eq=False)
class Dwells:
    """Dwells of a stream, in time order.

    Attributes:
        start, stop: (k,) first row of each in the stream, and the row after its last.
        begin_s, end_s: (k,) [s].
        samples: (k,) rows in which the body was seen.
        position: (k, 3) [m] means. quat_wxyz: (k, 4) means as rotations, or None.
        scatter_m, scatter_rad: (k,) standard deviation of single samples, per coordinate.
        error_m, error_rad: (k,) standard error of the means: from means of parts, since
            neighbouring samples are correlated.
        step_m, step_rad: (k,) least change from a sample to the next; inf if all are the same.
        speed: [m/s] slower than this counted as rest.
    """

    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    begin_s: Array
    end_s: Array
    samples: NDArray[np.int64]
    position: Array
    quat_wxyz: Array | None
    scatter_m: Array
    scatter_rad: Array
    error_m: Array
    error_rad: Array
    step_m: Array
    step_rad: Array
    speed: float

    def __len__(self) -> int:
        return len(self.start)


def find_dwells(
    stream: Stream,
    breaks: Array,
    rest_for: float = REST_FOR,
    rest_speed: float | None = None,
    arm: float = 0.0,
) -> Dwells:
    """The dwells of a stream.

    Args:
        stream: as logged.
        breaks: [s] times at which a dwell ends at the latest, as another command begins.
        rest_for: [s] shortest dwell.
        rest_speed: [m/s] slower counts as rest; estimated from the stream by default.
        arm: [m] lever by which rotation counts as motion.

    Raises:
        InputFileError: nothing rests long enough, or for too few samples.
    """
    seen = stream.seen
    if seen.sum() < LEAST:
        raise stream.error(
            f"the body is seen in {counted(int(seen.sum()), 'row')}; expected at least {LEAST}"
        )
    step = float(np.median(np.diff(stream.t_s)))
    if LEAST * step > rest_for + _ROUNDED * step:
        shortest = np.ceil(100.0 * LEAST * step - _ROUNDED) / 100.0
        raise stream.error(
            f"expected at least {LEAST} samples in the shortest dwell, {rest_for:g} s, got one "
            f"every {step:.3g} s; log faster, give --rest-for {shortest:g} or longer, or, if "
            "each row is a resting pose already, write it as measurements",
            row=1,
        )
    half = max(1, round(_WINDOW / step))
    speed = np.hypot(
        _speed(stream, stream.position, half), arm * _turning(stream, half)
    )  # fmt: skip
    limit = rest_speed or _limit(stream, speed, half, step)
    bounds = _pieces(stream.t_s, speed <= limit, breaks)
    least = rest_for - _ROUNDED * step
    long = [(a, b) for a, b in bounds if stream.t_s[b - 1] - stream.t_s[a] >= least]
    good = [(a, b) for a, b in long if seen[a:b].sum() >= LEAST]
    if not good:
        raise stream.error(
            f"nothing rests for {rest_for:g} s: in its slowest tenth the body moves at "
            f"{1e3 * np.nanpercentile(speed, 10):.3g} mm/s or less, and counts as resting below "
            f"{1e3 * limit:.3g} mm/s; expected poses that are held; change --rest-for or "
            "--rest-speed"
        )
    return _averaged(stream, good, limit)


def _means(values: Array, half: int) -> tuple[Array, Array]:
    """Means (n, k) of the ``half`` rows before and after each row; NaN if none was seen."""
    there = np.isfinite(values)
    start = np.zeros((1, values.shape[1]))
    total = np.concatenate([start, np.cumsum(np.where(there, values, 0.0), axis=0)])
    count = np.concatenate([start, np.cumsum(there, axis=0)])
    n = len(values)
    row = np.arange(n)

    def mean(first: NDArray[np.int64], last: NDArray[np.int64]) -> Array:
        first, last = np.clip(first, 0, n), np.clip(last, 0, n)
        some = count[last] - count[first]
        gaps = np.full(values.shape, np.nan)
        return np.asarray(np.divide(total[last] - total[first], some, out=gaps, where=some > 0))

    return mean(row - half, row), mean(row + 1, row + 1 + half)


def _speed(stream: Stream, values: Array, half: int) -> Array:
    """(n,) rate of change of columns (n, k); at the ends that of the nearest whole window.

    Where nothing was seen in a window, it is the rate from the last row that was seen to the next.
    """
    before, after = _means(values, half)
    times = np.where(np.isfinite(values[:, :1]), stream.t_s[:, None], np.nan)
    early, late = _means(times, half)
    out = np.linalg.norm(after - before, axis=1) / (late - early)[:, 0]
    lost, seen = np.flatnonzero(~np.isfinite(out)), np.flatnonzero(np.isfinite(times[:, 0]))
    last, following = np.searchsorted(seen, lost) - 1, np.searchsorted(seen, lost, side="right")
    inside = (last >= 0) & (following < len(seen))
    first, then = seen[last[inside]], seen[following[inside]]
    way = np.linalg.norm(values[then] - values[first], axis=1)
    out[lost[inside]] = way / (stream.t_s[then] - stream.t_s[first])
    known = np.flatnonzero(np.isfinite(out))
    if len(known):
        out[: known[0]], out[known[-1] + 1 :] = out[known[0]], out[known[-1]]
    return np.asarray(out)


def _turning(stream: Stream, half: int) -> Array:
    """(n,) angular velocity [rad/s]."""
    if stream.quat_wxyz is None:
        return np.zeros(len(stream.t_s))
    quat = stream.quat_wxyz.copy()
    seen = np.flatnonzero(np.isfinite(quat[:, 0]))
    # q and -q are the same rotation: each takes the sign of the one before
    flips = np.cumsum(np.einsum("ij,ij->i", quat[seen[1:]], quat[seen[:-1]]) < 0.0)
    quat[seen[1:]] *= np.where(flips % 2, -1.0, 1.0)[:, None]
    return 2.0 * _speed(stream, quat, half)


def _limit(stream: Stream, speed: Array, half: int, step: float) -> float:
    """[m/s] Slower is at rest: the speed that noise simulates, or a part of the usual one."""
    feigned = sample_noise(stream) * np.sqrt(2.0 / half) / ((half + 1) * step)
    return float(max(_NOISE * feigned, _PART * np.nanpercentile(speed, 95), _SAME / _WINDOW))


def sample_noise(stream: Stream) -> float:
    """[m] Usual distance of single samples from their mean, by second differences of positions."""
    size = _bends(stream.position)
    if not np.isfinite(size).any():  # never seen three times in a row
        size = _bends(stream.position[stream.seen])
    return float(np.nanmedian(size)) / float(np.sqrt(6.0))


def _bends(position: Array) -> Array:
    """Sizes (n - 2,) of second differences of positions (n, 3)."""
    bend = position[2:] - 2.0 * position[1:-1] + position[:-2]
    return np.asarray(np.linalg.norm(bend, axis=1))


def _pieces(t_s: Array, still: NDArray[np.bool_], breaks: Array) -> list[tuple[int, int]]:
    """(first row, row after the last) of each stretch at rest, cut at the breaks."""
    edge = np.zeros(len(t_s) + 1, dtype=bool)
    edge[1:-1] = still[1:] != still[:-1]
    edge[np.searchsorted(t_s, breaks)] = True
    edge[0] = edge[-1] = True
    cuts = np.flatnonzero(edge)
    return [(int(a), int(b)) for a, b in pairwise(cuts) if still[a]]


def _averaged(stream: Stream, bounds: list[tuple[int, int]], limit: float) -> Dwells:
    start, stop = np.array(bounds).T
    seen = stream.seen
    rows = [a + np.flatnonzero(seen[a:b]) for a, b in bounds]
    quat = stream.quat_wxyz
    mean = np.array([stream.position[k].mean(axis=0) for k in rows])
    away = [stream.position[k] - m for k, m in zip(rows, mean, strict=True)]
    turns, turned = None, [np.zeros((len(k), 3)) for k in rows]
    if quat is not None:
        turns, turned = map(list, zip(*(about_mean(quat[k]) for k in rows), strict=True))
    return Dwells(
        start=start,
        stop=stop,
        begin_s=stream.t_s[start],
        end_s=stream.t_s[stop - 1],
        samples=np.array([len(k) for k in rows]),
        position=mean,
        quat_wxyz=None if turns is None else np.array(turns),
        scatter_m=np.array([_rms(d) for d in away]),
        scatter_rad=np.array([_rms(d) for d in turned]),
        error_m=np.array([mean_error(d) for d in away]),
        error_rad=np.array([mean_error(d) for d in turned]),
        step_m=np.array([_step(d) for d in away]),
        step_rad=np.array([_step(d) for d in turned]),
        speed=limit,
    )


def about_mean(quat: Array) -> tuple[Array, Array]:
    """The mean (4,) of rotations (n, 4), and rotation vectors (n, 3) [rad] from it to each."""
    mean = mean_rotation(quat)
    back = np.tile(quat_conjugate(mean), (len(quat), 1))
    return mean, rotvec_from_quat(quat_multiply(quat, back))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.sum(values**2) / (max(len(values) - 1, 1) * values.shape[1])))


def _step(values: Array) -> float:
    """The least change from a row (n, 3) to the next; inf if there is none."""
    size = np.linalg.norm(np.diff(values, axis=0), axis=1)
    return float(np.min(size[size > _SAME], initial=np.inf))


# Commands in time, and the dwell that belongs to each.

# Differences of times are off by so much [s]: those of the day, in seconds since 1970, are 2e-7
# apart at the least.
_TIME_STEP = 1e-6


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
        assert self.begin_s is not None and self.end_s is not None
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
    held = stop - begin >= rest_for - _TIME_STEP
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
