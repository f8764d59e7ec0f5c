"""Descents of many poses at once in the lanes of :mod:`seecr.compiled.lanes`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import EXTERNAL_MOMENT
from seecr.parallel import in_parts
from seecr.pose import Array
from seecr.statics.tables import MANY, Tables, told_apart


class Rested:
    """Where lanes came to rest, and what is known there; all of it is arrays with n rows.

    Attributes:
        outcome: -1 where the descent is left to the compiled loop.
        count: evaluations. residual: relative to the load. energy: [J].
        deviation: (n, 7). pull: (n, m) tensions [N], negative where a cable is slack.
    """

    def __init__(self, n: int, m: int) -> None:
        self.outcome, self.count = np.full(n, -1), np.zeros(n, dtype=np.int64)
        self.residual, self.energy = np.empty(n), np.empty(n)
        self.deviation, self.pull = np.empty((n, 7)), np.empty((n, m))

    def put(self, rows: NDArray[np.intp], found: Any, check: Any) -> None:
        """Overwrite rows with what the compiled loop found, and with an evaluation there."""
        self.outcome[rows], self.count[rows] = found.outcome, found.count
        self.deviation[rows], self.pull[rows] = check.deviation, check.pull
        self.residual[rows], self.energy[rows] = check.residual, check.energy


def are_for_lanes(tables: Tables) -> bool:
    """Whether lanes know all that the cables and loads of some tables do, and there are many."""
    if len(tables) < MANY or tables.n_dof != 6 or tables.screws.shape[1]:
        return False
    from seecr.compiled.lanes import OUT_OF_SCOPE  # takes a while to import

    cables, _paid, load = told_apart(tables)
    moment = load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3]
    return not (moment.any() or cables[..., list(OUT_OF_SCOPE)].any())


def descend_in_lanes(
    tables: Tables, start: Array | None, limit: int, threads: int | None
) -> Rested:
    """Descend from the deviations ``start`` (n, 7), none by default."""
    from seecr.compiled.lanes import descend_abreast  # takes a while to import

    cables, paid, load = told_apart(tables)
    out = Rested(*paid.shape[:2])
    starts = np.zeros((0, 7)) if start is None else np.array(start, order="C")

    def run(part: slice) -> None:
        descend_abreast(
            cables[part] if len(cables) > 1 else cables, paid[part],
            load[part] if len(load) > 1 else load, tables.poses[part], starts[part],
            tables.length, tables.scale[part], 0.5 * tables.length, tables.reach[part], limit,
            out.outcome[part], out.count[part], out.residual[part], out.energy[part],
            out.deviation[part], out.pull[part],
        )  # fmt: skip

    in_parts(run, len(tables), threads)
    return out


def stiffness_in_lanes(tables: Tables, deviation: Array) -> Array:
    """Stiffness (n, 6, 6) [N/m] at deviations (n, 7), of tables that are for lanes."""
    from seecr.compiled.lanes import stiffness_abreast  # takes a while to import

    cables, paid, load = told_apart(tables)
    out = np.empty((len(tables), 6, 6))

    def run(part: slice) -> None:
        stiffness_abreast(
            cables[part] if len(cables) > 1 else cables, paid[part],
            load[part] if len(load) > 1 else load, tables.poses[part], deviation[part],
            tables.length, tables.scale[part], out[part],
        )  # fmt: skip

    in_parts(run, len(tables))
    return out
