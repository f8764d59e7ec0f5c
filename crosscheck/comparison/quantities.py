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

from crosscheck.comparison.cable_space import cable_lengths
from crosscheck.comparison.periodogram import periodogram
from crosscheck.comparison.travel import AXES, STILL, Travel
from crosscheck.fit.least_squares.problem import Problem
from seecr.pose import Array, rotvec_from_quat
from seecr.prediction.experiment import Prediction

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
    """

    kind: QuantityKind
    name: str
    values: NDArray[Any]
    unit: str = ""


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
    taut = np.where(slack, np.nan, prediction.tensions)
    some = np.isfinite(taut).any(axis=1)
    for name, pick in (("smallest", np.nanmin), ("mean", np.nanmean)):
        values = np.full(n, np.nan)
        values[some] = pick(taut[some], axis=1)
        yield Abscissa(QuantityKind.TENSION, f"{name} tension of the taut cables", values, "N")


def of_cables(problem: Problem, prediction: Prediction, way: Travel) -> tuple[Abscissa, ...]:
    """Quantities that change from cable to cable, with (n m,) values, row by row."""
    robot, n = problem.robot, problem.data.n_rows
    lengths = cable_lengths(problem, prediction)
    nominal = robot.nominal_lengths(way.pose)
    home = robot.nominal_lengths(robot.reference_pose[None])[0]
    paid = nominal - problem.experiment.commands.before(nominal, home)
    motion = np.select([paid > 0.0, paid < 0.0], ["paid out", "reeled in"], STILL)
    return (
        Abscissa(QuantityKind.CABLE, "the cable", np.tile(np.array(robot.cable_names), n)),
        Abscissa(QuantityKind.CABLE, "the cable's length", lengths.ravel(), "m"),
        Abscissa(QuantityKind.CABLE, "the cable's tension", prediction.tensions.ravel(), "N"),
        Abscissa(QuantityKind.CABLE, "whether the cable was paid out or reeled in", motion.ravel()),
    )


def in_time(problem: Problem, table: Array) -> tuple[Abscissa | None, int]:
    """The phase in the period that explains most, and how many periods were tried.

    Args:
        problem: the data. table: (n, c) whitened residuals, NaN where nothing was read.
    """
    period, tried = _period(problem, table)
    if period is None or problem.data.t_s is None:
        return None, tried
    phase = 360.0 * (problem.data.t_s / period % 1.0)
    return Abscissa(
        QuantityKind.TIME, (f"time, with a period of {period:.3g} s"), phase, "deg"
    ), tried


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
