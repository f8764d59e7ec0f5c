"""The rows of ``sweep.json`` and ``sweep.csv``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from seecr.columns.csv import table_text
from seecr.commands import Loads
from seecr.pose import Array
from seecr.prediction.uncertainty import Spread
from seecr.report.commanded import load_columns
from seecr.result import COORDINATES, Record
from seecr.statics.solution import Solution
from seecr.workspace.bars import BarManifold, midline_points

__all__ = ["SweepRows"]


@dataclass(frozen=True, eq=False)
class SweepRows:
    """Results for n commands as written to files, one row per command, SI units.

    Attributes:
        solution: of n commands.
        lengths: (n, m) [m] commanded instead of poses.
        wanted: (n, 7) poses that these lengths were for, NaN where a row has none or a part of one.
        more: further values of each row, by name.
        spread: standard deviations of poses and tensions, if the model has a covariance.
        loads: known loads, if any.
        bar: tilts beside the paper's manifold, if the robot is a bar on two cables.
    """

    solution: Solution
    lengths: Array | None = None
    more: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    spread: Spread | None = None
    wanted: Array | None = None
    loads: Loads | None = None
    bar: BarManifold | None = None

    @property
    def aimed(self) -> bool:
        """Whether deviations are from wanted poses: every row has one."""
        return self.wanted is not None and bool(np.isfinite(self.wanted).all())

    def as_json(self) -> list[Record]:
        """``rows`` in ``sweep.json``."""
        found, spread = self.solution, self.spread
        commanded, none = self.lengths is None, [None] * len(found)
        aimed = commanded or self.aimed
        columns = {
            **({} if found.line is None else {"line": found.line}),
            **self.more,
            "command": found.command if commanded else none,
            **({} if self.lengths is None else {"command_lengths_m": self.lengths}),
            **({} if self.wanted is None else {"wanted": self.wanted}),
            "pose": found.pose,
            "deviation_m": found.deviation[:, :3] if aimed else none,
            "rotation_rad": found.deviation[:, 3:] if aimed else none,
            "tensions_N": found.tensions,
            "slack": self._slack(),
            "rest_lengths_m": found.rest_lengths,
            "status": found.status,
            "iterations": found.iterations,
            "residual": found.residual,
            "smallest_eigenvalue": found.smallest_eigenvalue,
            **({} if found.jumps is None else {"jumps": found.jumps}),
        }
        if (met := midline_points(found)) is not None:
            columns |= {"midlines_meet_m": met.points, "beside_weight_m": met.beside}
        columns |= self._tilts()
        if spread is not None:
            columns |= {
                "position_stderr_m": spread.position,
                "rotation_stderr_rad": spread.rotation,
                "seen_stderr": spread.seen,
                "tensions_stderr_N": spread.tensions,
            }
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def csv_text(self) -> str:
        """``sweep.csv``; with ``sweep.toml`` it can be read as the same commands.

        Numbers have all their digits; cells without a number are empty.
        """
        found, spread = self.solution, self.spread
        cables = [str(k + 1) for k in range(found.robot.n_cables)]
        columns = {k: self.more[k] for k in ("run", "t_s", "temperature_C") if k in self.more}
        if self.lengths is None:
            columns |= _named("cmd_{}", COORDINATES, found.command)
        else:
            columns |= _named("length_{}_m", cables, self.lengths)
        if self.wanted is not None:
            columns |= _named("want_{}", COORDINATES, self.wanted)
        columns |= load_columns(self.loads)
        columns |= _named("pose_{}", COORDINATES, found.pose)
        if self.lengths is None or self.aimed:
            columns |= _named("deviation_{}_m", "xyz", found.deviation[:, :3])
            columns |= _named("rotation_{}_rad", "xyz", found.deviation[:, 3:])
        columns |= _named("tension_{}_N", cables, found.tensions)
        if spread is not None:
            columns |= _named("pose_{}_stderr_m", "xyz", spread.position)
            columns |= _named("rotation_{}_stderr_rad", "xyz", spread.rotation)
            columns |= _named("tension_{}_stderr_N", cables, spread.tensions)
        columns |= {
            "status": [status.name.lower() for status in found.status],
            "residual": found.residual.tolist(),
            "smallest_eigenvalue": found.smallest_eigenvalue.tolist(),
            "slack": [" ".join(names) for names in self._slack()],
        }
        if (met := midline_points(found)) is not None:
            columns |= _named("midlines_{}_m", "xyz", met.points)
            columns["beside_weight_m"] = met.beside.tolist()
        columns |= self._tilts()
        return table_text(columns)

    def _tilts(self) -> dict[str, list[float]]:
        """Of a bar on two cables, beside those of the manifold."""
        rows = [] if self.bar is None else self.bar.records()
        names = rows[0] if rows else ()
        return {name: [row[name] for row in rows] for name in names}

    def _slack(self) -> list[list[str]]:
        """Names of the slack cables of each row."""
        names = np.array(self.solution.robot.cable_names)
        return [names[row].tolist() for row in self.solution.slack]


def _named(pattern: str, names: Sequence[str], values: Array) -> dict[str, Sequence[Any]]:
    """Columns of a table (n, k), with names from the pattern."""
    columns = zip(names, values.T.tolist(), strict=True)
    return {pattern.format(name): column for name, column in columns}
