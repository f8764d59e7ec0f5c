"""Quantities that residuals may be associated with, row by row: commanded ones and the model's own.

Measured ones are not among them: a reading with an error would be associated with its own residual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from crosscheck.fit.problem import ORIENTATION, POSITION, Problem
from crosscheck.measurements.data import Names
from seecr.pose import Array, pose_difference, quat_rotate, rotvec_from_quat
from seecr.prediction.experiment import Prediction

# The periodogram of readings at uneven times, in a time that grows with their number.
#
# Sums of sines and cosines come from the fast Fourier transform of readings that are spread onto
# an even grid: Press and Rybicki, The Astrophysical Journal 338, 277 (1989). SciPy's `lombscargle`
# allocates a matrix of readings by frequencies, which for 15,000 rows is 16 GB.

# Cells of the grid in the shortest period. A reading is spread to the two cells next to it, which
# costs the shortest period two percent of its power, and longer ones less.
_CELLS = 16


def periodogram(t_s: Array, values: Array, step_Hz: float, count: int) -> Array:
    """Lomb-Scargle power (count,) at multiples of a step, scaled as by SciPy's ``lombscargle``.

    Times (n,) are in s, values (n,) have mean zero; the step is at most the inverse of the span.
    """
    size = fft.next_fast_len(_CELLS * count, real=True)
    place = (t_s - t_s.min()) * step_Hz * size
    once = _sums(place, values, size)[1 : count + 1]
    twice = _sums(place, np.ones(len(values)), size)[2 : 2 * count + 1 : 2]
    # sines and cosines are orthogonal relative to a time that is half the angle of the sum at twice
    # the frequency
    turned = once * np.exp(-0.5j * np.angle(twice))
    half, off = 0.5 * len(values), 0.5 * np.abs(twice)
    cosines, sines = half + off, np.maximum(half - off, 1e-9 * half)
    return np.asarray(0.5 * (turned.real**2 / cosines + turned.imag**2 / sines))


def _sums(place: Array, values: Array, size: int) -> Array:
    """Sums of values times exp(-i w t) at multiples of the frequency step."""
    below = np.floor(place).astype(np.int64)
    above = place - below
    grid = np.bincount(below % size, values * (1.0 - above), size)
    grid += np.bincount((below + 1) % size, values * above, size)
    return np.asarray(fft.rfft(grid))


# Pose errors converted to errors of cable length, which often show the kind of effect at a glance.
#
# The length error of each cable that would explain a pose error (dt, dw) is dl_i = -u_i . (dt + dw
# x R b_i), with u_i from the anchor to the exit point. A constant error hints at an offset, one
# proportional to length at a gain, a sine at a drum out of round, and one that changes sign with
# the motion at friction or backlash.


# Rows at a time, whose vectors of all cables take some megabytes.
_BLOCK = 8_000


def blocks(count: int) -> Iterator[slice]:
    """So many rows, some thousands at a time: what is computed of these needs little memory."""
    for begin in range(0, max(count, 1), _BLOCK):
        yield slice(begin, begin + _BLOCK)


def cable_errors(
    problem: Problem, raw: Array, prediction: Prediction, rows: Any = slice(None)
) -> tuple[Array, Array]:
    """Errors of cable length and their noise, each (k, m) [m], from residuals (k, 6 + m) of rows.

    Rows without a complete pose give NaN.
    """
    sigma, ratio = problem.sigma, problem.data.sigma_ratio[rows]
    raw, pose = np.asarray(raw), prediction.pose[rows]
    errors, noise = np.empty((2, len(raw), problem.robot.n_cables))
    # differences of Euler angles are not a rotation vector
    known = problem.use[rows] & (not problem.uses_angles)
    for at in blocks(len(raw)):
        unit, arm = _cables(problem, pose[at])
        turned = np.cross(raw[at, None, ORIENTATION], arm)
        off = -np.sum(unit * (raw[at, None, POSITION] + turned), axis=-1)
        errors[at] = np.where(known[at, None], off, np.nan)
        lever = np.linalg.norm(np.cross(arm, unit), axis=-1)
        turn = (sigma.orientation_rad or 0.0) * ratio[at, 1:2] * lever
        noise[at] = np.hypot((sigma.position_m or 0.0) * ratio[at, :1], turn)
    return errors, noise


def cable_lengths(problem: Problem, prediction: Prediction) -> Array:
    """Straight lengths (n, m) [m] of the cables at the predicted poses."""
    return problem.robot.nominal_lengths(prediction.pose)


def independent_part(problem: Problem, prediction: Prediction) -> float:
    """Fraction of the m errors of cable length whose noise is independent: they share one pose.

    The number of independent errors is m^2/tr(C^2) with the correlations C. That is m if they are
    independent, and the number of groups if they are identical within groups.
    """
    sigma, independent = problem.sigma, 0.0
    for at in blocks(len(prediction.pose)):
        unit, arm = _cables(problem, prediction.pose[at])
        turn = (sigma.orientation_rad or 0.0) * np.cross(arm, unit)
        columns = np.concatenate([(sigma.position_m or 0.0) * unit, turn], axis=-1)
        columns /= np.maximum(np.linalg.norm(columns, axis=-1, keepdims=True), 1e-300)
        together = np.einsum("nik,njk->nij", columns, columns)
        independent += float(np.sum(columns.shape[1] / np.sum(together**2, axis=(1, 2))))
    return independent / len(prediction.pose)


def _cables(problem: Problem, pose: Array) -> tuple[Array, Array]:
    """Unit vectors to the exit points and arms R b_i, (n, m, 3), at poses (n, 7)."""
    robot = problem.robot
    arm = quat_rotate(pose[:, None, 3:], robot.anchor_points[None])
    reach = robot.exit_points - pose[:, None, :3] - arm
    return reach / np.linalg.norm(reach, axis=-1, keepdims=True), arm


# The commanded motion of the platform to each row, and the region of the workspace of each row.

AXES = ("x", "y", "z", "rx", "ry", "rz")
STILL = "still"
# An axis is not divided if the commands spread along it by less than this part of the widest one.
_FLAT = 0.05
# Speeds this near to each other, relative to their size, are one; coarse times may ask for more.
_SAME_SPEED, _MOST_COARSE = 1e-9, 1e-3
# A position this near to the middle of an axis, relative to the spread, is on it.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Travel:
    """Commanded motion to each row, from the row before or, in a new run, from the reference pose.

    A run that starts at its first row has no motion to that.

    Attributes:
        pose: (n, 7) commanded poses; if lengths are commanded, the predicted ones.
        step: (n, 6) displacement [m] and rotation vector [rad].
        direction: (n,) sign and axis of the largest component of the step, rotations multiplied by
            the robot's length; "still" if nothing moves.
        speed: (n,) [m/s], rotations multiplied by the robot's length; NaN for the first row of a
            run and without times. Those that differ by rounding alone are equal.
    """

    pose: Array
    step: Array
    direction: Names
    speed: Array


def travel(problem: Problem, prediction: Prediction) -> Travel:
    """The commanded motion, never the measured one."""
    commands = problem.experiment.commands
    pose = commands.pose if commands.lengths is None else prediction.pose
    step = pose_difference(pose, commands.before(pose, problem.robot.reference_pose))
    weighed = step * np.repeat([1.0, problem.robot.length], 3)
    axis = np.argmax(np.abs(weighed), axis=1)
    most = weighed[np.arange(len(step)), axis]
    words = np.array([[sign + name for sign in "-+"] for name in AXES])
    moves = np.abs(most) > 1e-6 * problem.robot.length
    direction = np.where(moves, words[axis, (most > 0).astype(int)], STILL)
    speed = np.full(len(pose), np.nan)
    time = problem.data.t_s
    if time is not None:
        apart = np.concatenate([[0.0], np.diff(time)])
        known = ~commands.starts & (apart > 0)
        speed[known] = _levelled(
            np.linalg.norm(weighed[known], axis=1) / apart[known], _rounding(time, apart[known])
        )
    return Travel(pose, step, direction, speed)


def _rounding(time: Array, apart: Array) -> float:
    """What speeds may differ by, relative to their size: times since 1970 are coarse."""
    coarse = 4.0 * np.spacing(np.abs(time).max())
    return float(np.clip(coarse / apart.min(initial=np.inf), _SAME_SPEED, _MOST_COARSE))


def _levelled(speed: Array, rounding: float) -> Array:
    """Speeds (n,), each group of those that differ by rounding as the smallest of them."""
    order = np.argsort(speed)
    rising = speed[order]
    begins = np.diff(rising, prepend=-1.0) > rounding * rising
    out = np.empty_like(speed)
    out[order] = rising[begins][np.cumsum(begins) - 1]
    return out


def regions_of(problem: Problem, pose: Array) -> Names:
    """The region of each row (n,), by commanded poses: halves along each axis that is used, such as
    "x below 0.4 m, z from 0.15 m".
    """
    place = pose[:, :3]
    used = place[problem.use] if problem.use.any() else place
    low, high = used.min(axis=0), used.max(axis=0)
    spread = high - low
    names, number = [""], np.zeros(len(place), dtype=np.int64)
    for k, axis in enumerate("xyz"):
        if spread[k] <= _FLAT * spread.max() or spread[k] == 0:
            continue
        middle = 0.5 * (low[k] + high[k])
        edge = middle - _ROUNDING * spread[k]
        halves = [f"{axis} {word} {middle:.3g} m" for word in ("below", "from")]
        names = [f"{name}, {half}".lstrip(", ") for name in names for half in halves]
        number = 2 * number + (place[:, k] >= edge)
    return np.array([name or "everywhere" for name in names], dtype=np.str_)[number]


EVERYWHERE = "nothing: it is the same everywhere"
"""Name of the quantity that does not change from row to row."""

# Least number of cycles of a period, most frequencies tried, least number of rows.
_CYCLES, _FREQUENCIES, _FEWEST = 3.0, 20000, 24


class QuantityKind(Enum):
    """The kinds of quantities that residuals may be associated with."""

    EVERYWHERE = auto()
    PLACE = auto()
    RUN = auto()
    TRAVEL = auto()
    TIME = auto()
    TEMPERATURE = auto()
    TENSION = auto()
    CABLE = auto()


@dataclass(frozen=True, eq=False)
class Abscissa:
    """A quantity that residuals may be associated with.

    Attributes:
        kind: kind of the quantity. name: its name in words.
        values: (k,) numbers, or names of groups. unit: unit of the numbers.
        groups: names in alphabetical order, whose indices the values are, if there are any.
    """

    kind: QuantityKind
    name: str
    values: NDArray[Any]
    unit: str = ""
    groups: tuple[str, ...] = ()


def channels(problem: Problem) -> tuple[list[str], list[str]]:
    """Names and units of the 6 + m readings."""
    turns = [f"angle {a}" if problem.uses_angles else f"rotation about {a[1]}" for a in AXES[3:]]
    names = [*AXES[:3], *turns, *(f"tension of {c}" for c in problem.robot.cable_names)]
    return names, ["m"] * 3 + ["rad"] * 3 + ["N"] * problem.robot.n_cables


def of_rows(problem: Problem, prediction: Prediction, way: Travel) -> Iterator[Abscissa]:
    """Quantities that change from row to row."""
    n, data = problem.data.n_rows, problem.data
    yield Abscissa(QuantityKind.EVERYWHERE, EVERYWHERE, np.zeros(n))
    turn = rotvec_from_quat(way.pose[:, 3:])
    place = np.concatenate([way.pose[:, :3], turn], axis=1)
    for k, axis in enumerate(AXES):
        yield Abscissa(
            QuantityKind.PLACE, f"commanded {axis}", place[:, k], "m" if k < 3 else "rad"
        )
    yield Abscissa(QuantityKind.RUN, "the run", data.run)
    yield Abscissa(QuantityKind.TRAVEL, "direction of travel", way.direction)
    yield Abscissa(QuantityKind.TRAVEL, "speed of travel", way.speed, "m/s")
    if data.t_s is not None:
        yield Abscissa(QuantityKind.TIME, "time", data.t_s - data.t_s.min(), "s")
        if len(data.runs) > 1:
            starts = {name: data.t_s[data.run == name].min() for name in data.runs}
            into = data.t_s - np.array([starts[name] for name in data.run.tolist()])
            yield Abscissa(QuantityKind.TIME, "time since the start of the run", into, "s")
    if data.temperature_C is not None:
        yield Abscissa(QuantityKind.TEMPERATURE, "temperature", data.temperature_C, "C")
    slack = prediction.slack
    yield Abscissa(QuantityKind.TENSION, "number of slack cables", slack.sum(axis=1).astype(float))
    pulls = prediction.tensions
    taut = ~slack & np.isfinite(pulls)
    count = taut.sum(axis=1)
    least = np.min(np.where(taut, pulls, np.inf), axis=1, initial=np.inf)
    mean = np.where(taut, pulls, 0.0).sum(axis=1) / np.maximum(count, 1)
    for name, values in (("smallest", least), ("mean", mean)):
        told = np.where(count > 0, values, np.nan)
        yield Abscissa(QuantityKind.TENSION, f"{name} tension of the taut cables", told, "N")


def of_cables(problem: Problem, prediction: Prediction, way: Travel) -> Iterator[Abscissa]:
    """Quantities that change from cable to cable, with (n m,) values, row by row."""
    robot, n = problem.robot, problem.data.n_rows
    names, which = np.unique(np.array(robot.cable_names), return_inverse=True)
    each = which.astype(np.int32)
    yield Abscissa(QuantityKind.CABLE, "the cable", np.tile(each, n), groups=tuple(names.tolist()))
    # what was yielded is not kept here: of many rows it is large
    yield Abscissa(
        QuantityKind.CABLE, "the cable's length", cable_lengths(problem, prediction).ravel(), "m"
    )
    yield Abscissa(QuantityKind.CABLE, "the cable's tension", prediction.tensions.ravel(), "N")
    name = "whether the cable was paid out or reeled in"
    groups = ("paid out", "reeled in", STILL)
    yield Abscissa(QuantityKind.CABLE, name, _motions(problem, way).ravel(), groups=groups)


def _motions(problem: Problem, way: Travel) -> NDArray[np.int32]:
    """Whether each cable (n, m) was paid out (0), reeled in (1) or stood still (2)."""
    robot = problem.robot
    nominal = robot.nominal_lengths(way.pose)
    home = robot.nominal_lengths(robot.reference_pose[None])[0]
    paid = nominal - problem.experiment.commands.before(nominal, home)
    return np.select([paid > 0.0, paid < 0.0], [np.int32(0), np.int32(1)], np.int32(2))


def in_time(problem: Problem, table: Array) -> tuple[Abscissa | None, int]:
    """The phase in the period that explains most, and how many periods were tried.

    ``table`` (n, c) holds whitened residuals, NaN where nothing was read.
    """
    period, tried = _period(problem, table)
    if period is None or problem.data.t_s is None:
        return None, tried
    phase = 360.0 * (problem.data.t_s / period % 1.0)
    name = f"time, with a period of {period:.3g} s"
    return Abscissa(QuantityKind.TIME, name, phase, "deg"), tried


def _period(problem: Problem, table: Array) -> tuple[float | None, int]:
    """The period [s] that explains most, by Lomb-Scargle, and how many were tried."""
    t = problem.data.t_s
    some = np.isfinite(table).any(axis=1)
    if t is None or some.sum() < _FEWEST:
        return None, 0
    span, steps = float(np.ptp(t[some])), np.diff(np.unique(t[some]))
    if span <= 0.0:
        return None, 0
    # frequencies are a quarter of a cycle over the whole span apart, from a few cycles on
    step, first = 0.25 / span, round(4 * _CYCLES)
    count = min(int(0.5 / float(np.median(steps)) / step), _FREQUENCIES)
    if count <= first:
        return None, 0
    power = np.zeros(count)
    for column in table.T:
        read = np.isfinite(column)
        if read.sum() >= _FEWEST:
            power += periodogram(t[read], column[read] - column[read].mean(), step, count)
    best = first + int(np.argmax(power[first - 1 :]))
    return 1.0 / (best * step), count - first + 1
