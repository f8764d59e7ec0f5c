"""Commands to the winches, row by row, and the play between commanded and actual motion."""

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
    """The commands to a robot, row by row, in time order within a run.

    Attributes:
        pose: (n, 7) commanded poses; if lengths are commanded, where the solver starts.
        lengths: (n, m) [m] commanded rest lengths, or None.
        run: (n,) int, number of the continuous motion that a row belongs to.
        time: (n,) [s] or None.
        temperature: (n,) [deg C] or None.
        passed: (k, n, m) [m] commanded changes of length (or lengths) passed on the way to each
            row, in order: at its start and where cables reverse; None if no effect needs them.
        told: whether lengths are in the plain model's terms: at the reference pose they are the
            robot's rest lengths, and from there the winch turns by the difference. Otherwise they
            are absolute: the whole cable from the exit point on.
        loads: known loads, or None.
        stands: (n,) bool, rows whose run starts at its first row, at rest; other runs start at the
            reference pose. None means that all of them do.
        clock: (n,) int, number of the clock of ``time``; None if there is only one.
        parts: names (n,) of the "file" and the "run" of each row, for effects that have values of
            their own for each.
        line: (n,) line of each row in its file; None without a file.
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
        """(n,) rows that start a run: the first, and those with another run than the row before."""
        fresh = np.zeros(len(self), dtype=bool)
        fresh[:1] = True
        if self.run is not None:
            fresh[1:] = self.run[1:] != self.run[:-1]
        return fresh

    @property
    def absolute(self) -> bool:
        """Whether absolute lengths are commanded."""
        return self.lengths is not None and not self.told

    @property
    def starts_here(self) -> NDArray[np.bool_]:
        """(n,) rows that start a run where they are, not at the reference pose."""
        return self.starts & (False if self.stands is None else self.stands)

    def change(self, robot: Robot) -> Array:
        """Commanded changes of length (n, m) [m] since the winches were zeroed.

        For absolute lengths these are the lengths themselves.
        """
        if self.lengths is None:
            return self.nominal_change(robot)
        return self.lengths - robot.rest_lengths if self.told else self.lengths

    def home(self, robot: Robot) -> Array:
        """The value of ``change`` at the reference pose, (m,) [m]."""
        return robot.rest_lengths if self.absolute else np.zeros(robot.n_cables)

    def before(self, rows: Array, home: Array) -> Array:
        """The values of ``rows`` (n, k) at the start of the way to each row.

        They are those of the row before, or ``home`` (k,) if a run starts there, or those of the
        row itself if its run starts where it is.
        """
        before = np.roll(rows, 1, axis=0)
        before[self.starts] = home
        return np.where(self.starts_here[:, None], rows, before)

    def nominal_change(self, robot: Robot) -> Array:
        """Straight lengths at the commanded poses minus those at the reference pose, (n, m) [m]."""
        if not self._kept or self._kept[0][0] is not robot:
            change = robot.nominal_lengths(self.pose) - robot.reference_lengths
            self._kept[:] = [(robot, change)]
        return self._kept[0][1]

    # for the last robot asked for, since every trial of a fit asks again
    _kept: list[tuple[Robot, Array]] = field(default_factory=list, repr=False, init=False)


def play(
    told: Array, starts: NDArray[np.bool_], half_width: Array, passed: Array | None = None
) -> Array:
    """The play operator: an output that lags its input (n, m) by up to the half-width (m,).

    It starts centred at the start of each run (``starts`` (n,)): on that row, or on ``passed[0]``.
    Between rows the input passes through ``passed`` (k, n, m), if given, monotonically in between.
    """
    way = told[None] if passed is None else np.concatenate([passed, told[None]])
    low, high = way[0] - half_width, way[0] + half_width
    low[starts] = high[starts] = way[0, starts]
    # an input moves the output to the nearest point of a band about it. A sequence of inputs acts
    # as one band, too: computed for each row first, then for 2, 4, 8, ... rows
    for at in way[1:]:
        low, high = _band_of_both(low, high, at - half_width, at + half_width)
    rows = 1
    while np.any(low < high):
        low[rows:], high[rows:] = _band_of_both(low[:-rows], high[:-rows], low[rows:], high[rows:])
        rows *= 2
    return np.asarray(low)


def _band_of_both(low: Array, high: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """The band equivalent to ``low`` and ``high`` followed by ``least`` and ``most``."""
    return np.clip(low, least, most), np.clip(high, least, most)
