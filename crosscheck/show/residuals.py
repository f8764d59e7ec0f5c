"""Data and a model's errors, in words and in the scales that figures and recordings draw them with.

Words are the facts of every page that has data, and what errors depend on. Scales say where errors
are drawn, how long, and in which colours.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.diagnosis.path import Stage
from crosscheck.fit.problem import KINDS, POSITION, Kind, Problem, kinds_read
from crosscheck.fit.state import State
from crosscheck.show.blocks import Bar, Cell, Facts, Line, Panel, TextTable, section
from seecr.counted import counted
from seecr.pose import Array, quat_from_rxyz, rxyz_from_quat
from seecr.show.colours import round_up
from seecr.units import chance, in_unit, short

# --- scales ---------------------------------------------------------------------------------------

# The longest arrow, as a part of the widest side of the region, and the percentile of errors that
# is drawn with this length.
_ARROW, _LARGEST = 0.13, 98.0
# Colours end at this percentile of the errors.
_TOP = 95.0
# So many rows are drawn at most. A recorded pose takes 30 kB of memory while it is written, and no
# plot has as many points side by side.
_MOST_DRAWN = 5_000
# A side is flat if it is shorter than this part of the longest one.
_FLAT = 0.02


class Standing(NamedTuple):
    """A single model that can be drawn: ``label`` names it, ``state`` has its predictions."""

    label: str
    state: State


Drawn: TypeAlias = Standing | Stage
"""A model that can be drawn: it has a label and a state."""


@dataclass(frozen=True, eq=False)
class Misfit:
    """The measurements, and the scales with which all models are drawn.

    Attributes:
        problem: the data.
        first: the model whose errors set the scales, and whose predictions are the positions.
    """

    problem: Problem
    first: State

    @property
    def kinds(self) -> list[Kind]:
        """Kinds of reading in the data."""
        return kinds_read(self.problem)

    @cached_property
    def drawn(self) -> NDArray[np.int64]:
        """Indices of the rows that are drawn: all, or of too many those that
        :func:`drawn_words` names.
        """
        every = np.arange(self.problem.data.n_rows)
        if len(every) <= _MOST_DRAWN:
            return every
        half = _MOST_DRAWN // 2
        largest = np.argsort(-self._power, kind="stable")[:half]
        rest = np.delete(every, largest)
        evenly = rest[np.linspace(0, len(rest) - 1, half).astype(np.int64)]
        return np.sort(np.concatenate([largest, evenly]))

    @property
    def rows(self) -> NDArray[np.int64]:
        """Indices of the drawn rows that count."""
        return self.drawn[self.problem.use[self.drawn]]

    @property
    def starts(self) -> NDArray[np.bool_]:
        """(k,) drawn rows before which, since the drawn row before, a run starts."""
        run = np.cumsum(self.problem.experiment.commands.starts)[self.drawn]
        return np.asarray(np.diff(run, prepend=-1) > 0)

    @cached_property
    def _power(self) -> Array:
        """(n,) sum of squares of each row's errors that count, in units of the noise."""
        power = np.zeros(self.problem.data.n_rows)
        for errors, some in zip(self.first.table.T, self.problem.counted.T, strict=True):
            power += np.where(some, errors, 0.0) ** 2
        return power

    @property
    def place(self) -> Array:
        """(n, 3) [m] positions at which the rows are drawn."""
        return self.first.prediction.readings.position

    @cached_property
    def views(self) -> list[tuple[int, int]]:
        """Pairs of axes to show: from above and from the side, or the plane of a flat robot."""
        return views_of(self.place[self.rows])

    @cached_property
    def magnify(self) -> float:
        """Factor by which arrows of the position error are enlarged; 0 if there are none.

        It is a round number with which all but the largest arrows are shorter than a given part of
        the measured region.
        """
        size = KINDS[0].sizes(self.problem, self.first.raw)
        size = size[np.isfinite(size)]
        if len(size) == 0 or not np.any(size > 0):
            return 0.0
        span = float(np.max(np.ptp(self.place[self.rows], axis=0)))
        longest = max(float(np.percentile(size, _LARGEST)), 1e-12)
        factor = _ARROW * max(span, 1e-9) / longest
        power = 10.0 ** np.floor(np.log10(factor))
        return float(max(s for s in (1.0, 2.0, 5.0) if s * power <= factor) * power)

    @property
    def scale(self) -> str:
        """How long the arrows are, in words."""
        if self.magnify == 1.0:
            return "to scale"
        return f"at {self.magnify:g} times their length"

    def sizes(self, state: State, kind: Kind) -> Array:
        """(n,) errors of a model of one kind, in the unit for people; NaN where none was read."""
        return kind.factor * kind.sizes(self.problem, state.raw)

    def top(self, kind: Kind) -> float:
        """End of the colours of a kind, in its unit for people; a round number."""
        return round_up(float(np.nanpercentile(self.sizes(self.first, kind), _TOP)))

    def errors(self, state: State) -> Array:
        """(n, 3) [m] measured minus predicted position; 0 where it was not read."""
        return np.where(self.problem.counted[:, POSITION], state.raw[:, POSITION], 0.0)

    @property
    def measured(self) -> Array:
        """(n, 7) measured poses, completed by the first model's predictions."""
        data, readings = self.problem.data, self.first.prediction.readings
        position = np.where(np.isfinite(data.position), data.position, readings.position)
        if data.quat_wxyz is not None:
            known = np.isfinite(data.quat_wxyz)
            quat = np.where(known, data.quat_wxyz, readings.quat_wxyz)
        else:
            angles = rxyz_from_quat(readings.quat_wxyz)
            known = np.isfinite(data.angles_rad)
            quat = quat_from_rxyz(np.where(known, data.angles_rad, angles))
        return np.concatenate([position, quat], axis=1)

    @property
    def seen(self) -> Array:
        """(k, 7) poses that a scene has to show: those measured and those predicted."""
        return np.concatenate([self.measured[self.rows], predicted_poses(self.first)[self.rows]])

    @property
    def worst_row(self) -> int:
        """The row with the largest error, in units of the noise."""
        return int(np.argmax(self._power))


def drawn_words(count: int) -> str:
    """Which of so many rows are drawn, in a sentence; "" if all are."""
    if count <= _MOST_DRAWN:
        return ""
    half = _MOST_DRAWN // 2
    return (
        f"Drawn are {_MOST_DRAWN} of {counted(count, 'row')}: the {half} with the largest errors "
        f"in units of the noise, and {half} evenly spaced among the others."
    )


def predicted_poses(state: State) -> Array:
    """(n, 7) poses that would be read according to the model."""
    readings = state.prediction.readings
    return np.concatenate([readings.position, readings.quat_wxyz], axis=1)


def views_of(place: Array) -> list[tuple[int, int]]:
    """Pairs of axes in which positions (n, 3) [m] are to be seen."""
    span = np.ptp(place, axis=0)
    wide = span > _FLAT * max(float(span.max()), 1e-12)
    if wide.all():
        return [(0, 1), (0, 2)]
    first, second = sorted(sorted((0, 2, 1), key=lambda k: not wide[k])[:2])
    return [(first, second)]


# --- words ----------------------------------------------------------------------------------------


def title_of(problem: Problem) -> str:
    """The robot and its data."""
    return f"{problem.robot.name} · {problem.data.name}"


def facts_of(problem: Problem, *more: tuple[str, str], noise: str = "noise") -> Facts:
    """What was measured, in a few words, and what else is known.

    Args:
        problem: the data. more: names and values to add. noise: what its stated noise is called.
    """
    data, sigma, robot = problem.data, problem.sigma, problem.robot
    passive = f", passive: {', '.join(robot.passive_names)}" if robot.passive_names else ""
    values = {"position": sigma.position_m, "orientation": sigma.orientation_rad,
              "tension": sigma.tension_N}  # fmt: skip
    sizes = [
        f"{kind.name} {short(value * kind.factor, 2)} {kind.unit}"
        for kind in kinds_read(problem)
        if (value := values[kind.name]) is not None
    ]
    if sigma.length_m:
        sizes.append(f"commanded lengths {short(1e3 * sigma.length_m, 2)} mm")
    rows = str(int(problem.use.sum()))
    rows += "" if problem.use.all() else f" of {data.n_rows}"
    if ways := int((~data.read).sum()):
        rows += f", {counted(ways, 'way point')}"
    return Facts([
            ("robot", f"{robot.name}, {counted(robot.n_driven, 'cable')}{passive}"),
            ("data", data.name),
            ("rows", rows),
            ("runs", str(len(data.runs))),
            ("readings", str(problem.n_readings)),
            (noise, ", ".join(sizes)),
            *more,
        ])  # fmt: skip


def association_section(title: str, rows: Iterable[Association]) -> Panel | None:
    """What errors depend on."""
    some = [_association(row) for row in rows]
    return section(title, Panel("", some, "beside")) if some else None


def _association(row: Association) -> Panel:
    """An association in the units that people read, with a bar for each of its bins."""
    factor, unit = in_unit(row.unit)
    top = max((abs(part.mean) for part in row.bins if part.mean is not None), default=0.0)
    bins: list[list[Cell]] = [
        [
            part.label if len(row.bins) > 1 else "all",
            counted(part.rows, "row"),
            Bar(0.0 if not top or part.mean is None else part.mean / top, middle=True),
            short(None if part.mean is None else factor * part.mean),
        ]
        for part in row.bins
    ]
    words = (
        f"explains {100 * row.share:.0f} % of the variance of the {row.of}, p {chance(row.p)}; "
        f"strongest in {row.strongest} [{unit}]:"
    )
    return Panel(
        str(row.against),
        [Line(words, "dim"), TextTable(["", "#", "", "#"], bins, kind="bins")],
        "part",
    )
