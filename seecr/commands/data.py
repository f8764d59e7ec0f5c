"""What the winches were told, row by row, and play between what they were told and what they do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.commands.loads import Loads
from seecr.description.robot import Robot
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Commands:
    """What the robot was told, row by row, in time order within a run.

    Attributes:
        pose: (n, 7) commanded poses; for lengths, where the solver starts from.
        lengths: (n, m) [m] commanded rest lengths, or None.
        run: (n,) int, number of the continuous motion a row belongs to.
        time: (n,) [s] or None.
        temperature: (n,) [deg C] or None.
        passed: (k, n, m) [m] commanded changes of length (or lengths) that the way to each row
            passes, in order: where it starts and where cables turn round; None where nobody asks.
        told: whether lengths are what the winches were told, counted as the plain robot counts: its
            rest lengths at the reference pose, and from there the winch turns by the difference.
            Lengths that are not told are absolute: all the cable there is from the exit point on.
        loads: what the platform carried, or None.
        stands: (n,) bool, rows whose run starts at its first row, at rest; the others' runs start
            at the reference pose. None: all of them.
        clock: (n,) int, number of the clock that ``time`` is read from; None for one alone.
        parts: names (n,) of the "file" and the "run" that each row is of, for effects that have
            values of their own for each.
        line: (n,) of the file that rows were read from; None where there is none.
    """

    pose: Array
    lengths: Array | None = None
    run: NDArray[np.int64] | None = None
    time: Array | None = None
    temperature: Array | None = None
    passed: Array | None = None
    told: bool = False
    loads: Loads | None = None
    stands: NDArray[np.bool_] | None = None
    clock: NDArray[np.int64] | None = None
    parts: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    line: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.pose)

    def rows(self, index: NDArray[np.integer]) -> Commands:
        """Some rows, for what does not depend on the rows before."""

        def of(values: NDArray[Any] | None) -> NDArray[Any] | None:
            return None if values is None else values[index]

        return Commands(
            pose=self.pose[index], lengths=of(self.lengths), run=of(self.run), time=of(self.time),
            temperature=of(self.temperature), told=self.told, stands=of(self.stands),
            clock=of(self.clock), line=of(self.line),
            loads=None if self.loads is None else self.loads.rows(index),
            parts={kind: names[index] for kind, names in self.parts.items()},
        )  # fmt: skip

    @property
    def starts(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run: the first, and those whose run is another than before."""
        fresh = np.zeros(len(self), dtype=bool)
        fresh[:1] = True
        if self.run is not None:
            fresh[1:] = self.run[1:] != self.run[:-1]
        return fresh

    @property
    def absolute(self) -> bool:
        """Whether lengths are commanded that no reference applies to."""
        return self.lengths is not None and not self.told

    @property
    def starts_here(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run where they are, not at the reference pose."""
        return self.starts & (False if self.stands is None else self.stands)

    def change(self, robot: Robot) -> Array:
        """Lengths (n, m) [m] that winches were told to pay out since they were zeroed.

        For absolute lengths these themselves.
        """
        if self.lengths is None:
            return self.nominal_change(robot)
        return self.lengths - robot.rest_lengths if self.told else self.lengths

    def home(self, robot: Robot) -> Array:
        """What ``change`` is where a run starts, at the reference pose, (m,) [m]."""
        return robot.rest_lengths if self.absolute else np.zeros(robot.n_cables)

    def before(self, rows: Array, home: Array) -> Array:
        """What ``rows`` (n, k) are at the start of the way to each row.

        That is the row before, ``home`` (k,) where a run starts, or the row itself if it starts
        there.
        """
        before = np.roll(rows, 1, axis=0)
        before[self.starts] = home
        return np.where(self.starts_here[:, None], rows, before)

    def nominal_change(self, robot: Robot) -> Array:
        """Straight lengths at the commanded poses less those at the reference, (n, m) [m]."""
        if not self._kept or self._kept[0][0] is not robot:
            change = robot.nominal_lengths(self.pose) - robot.reference_lengths
            self._kept[:] = [(robot, change)]
        return self._kept[0][1]

    # of the last robot asked for: every trial of a fit asks again
    _kept: list[tuple[Robot, Array]] = field(default_factory=list, repr=False, init=False)


def play(
    told: Array, starts: NDArray[np.bool_], half_width: Array, passed: Array | None = None
) -> Array:
    """The play operator: an output that lags its input (n, m) by up to the half-width (m,).

    It starts centred where each run starts: on the rows of ``starts`` (n,), or on ``passed[0]``
    there. Between rows the input goes through ``passed`` (k, n, m), if given, and one way in
    between.
    """
    way = told[None] if passed is None else np.concatenate([passed, told[None]])
    low, high = way[0] - half_width, way[0] + half_width
    low[starts] = high[starts] = way[0, starts]
    # an input moves the output to the nearest point of a band about it, and so do many inputs
    # in turn, with one band for all: that of each row first, then of 2, 4, 8, ... rows
    for at in way[1:]:
        low, high = _band_of_both(low, high, at - half_width, at + half_width)
    rows = 1
    while np.any(low < high):
        low[rows:], high[rows:] = _band_of_both(low[:-rows], high[:-rows], low[rows:], high[rows:])
        rows *= 2
    return np.asarray(low)


def _band_of_both(low: Array, high: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """The band that limits to ``low`` and ``high`` and then to ``least`` and ``most``."""
    return np.clip(low, least, most), np.clip(high, least, most)
