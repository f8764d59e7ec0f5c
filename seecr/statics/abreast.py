"""Descents of many poses at once in the lanes of :mod:`seecr.compiled.lanes`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import EXTERNAL_MOMENT
from seecr.parallel import in_parts
from seecr.pose import Array
from seecr.statics.tables import Tables, are_many, told_apart

# Axes and levers that differ by less than this are the same but for rounding.
_EVEN = 1e-12


class Rested:
    """Where lanes came to rest, and what is known there; all of it is arrays with n rows.

    Attributes:
        outcome: -1 where the descent is left to the compiled loop.
        count: evaluations. residual: relative to the load. energy: [J].
        deviation: (n, 7). values: (n, d) of joints. pulls: (n, m) tensions [N].
            longer: (n, m) cables that are longer than their span, where not lanes found the rest.
    """

    def __init__(self, n: int, m: int, d: int) -> None:
        self.outcome, self.count = np.full(n, -1), np.zeros(n, dtype=np.int64)
        self.residual, self.energy = np.empty(n), np.empty(n)
        self.deviation, self.values = np.empty((n, 7)), np.zeros((n, d))
        self.pulls, self.longer = np.zeros((n, m)), np.zeros((n, m), dtype=bool)

    def put(self, rows: NDArray[np.intp], found: Any, check: Any) -> None:
        """Overwrite rows with what the compiled loop found, and with an evaluation there."""
        self.outcome[rows], self.count[rows] = found.outcome, found.count
        self.deviation[rows], self.pulls[rows] = check.deviation, check.tension
        self.longer[rows] = check.loose
        self.values[rows] = check.values
        self.residual[rows], self.energy[rows] = check.residual, check.energy


def are_for_lanes(tables: Tables) -> bool:
    """Whether lanes know all that the cables, loads and joints of some tables do; and many rows."""
    if not are_many(len(tables)) or _places(tables) is None:
        return False
    from seecr.compiled.lanes import OUT_OF_SCOPE  # takes a while to import

    cables, _paid, load = told_apart(tables)
    moment = load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3]
    return not (moment.any() or cables[..., list(OUT_OF_SCOPE)].any())


def _places(tables: Tables) -> list[int] | None:
    """Which of three slides and a hinge each joint is; None for joints that lanes do not know.

    They know slides and after them a hinge through the platform's origin, whose axes stand still.
    """
    screws = tables.screws
    hinges = screws[0, :, 0] == 1.0
    slides = int(np.sum(~hinges))
    if screws.shape[1] == 0:
        return []
    if hinges[:-1].any() or slides > 3 or np.ptp(screws[..., :4], axis=0).max() > _EVEN:
        return None
    lever = np.cross(screws[0, -1, 1:4], screws[:, -1, 4:7] - tables.poses[:, :3])
    if hinges[-1] and np.abs(lever).max() > _EVEN * tables.length:
        return None
    return [*range(slides), *([3] if hinges[-1] else [])]


def descend_in_lanes(
    tables: Tables, start: Array | None, start_values: Array | None, limit: int,
    threads: int | None, out: Rested,
) -> None:  # fmt: skip
    """Descend from the deviations ``start`` (n, 7), none by default, and joints' values (n, d)."""
    from seecr.compiled.lanes import descend_abreast  # takes a while to import

    cables, paid, load = told_apart(tables)
    n, places, axes = len(paid), _places(tables), np.zeros((4, 3))
    first = np.zeros((n, 4 if places else 0))
    starts = np.zeros((0, 7)) if start is None else np.array(start, order="C")
    values = first.copy()
    if places:
        axes[places] = tables.screws[0, :, 1:4]
        if start_values is not None:
            first[:, places] = start_values

    def run(part: slice) -> None:
        descend_abreast(
            cables[part] if len(cables) > 1 else cables, paid[part],
            load[part] if len(load) > 1 else load, tables.poses[part], starts[part], axes,
            first[part], tables.length, tables.scale[part], 0.5 * tables.length,
            tables.reach[part], limit, out.outcome[part], out.count[part], out.residual[part],
            out.energy[part], out.deviation[part], values[part], out.pulls[part],
        )  # fmt: skip

    in_parts(run, n, threads)
    np.maximum(out.pulls, 0.0, out=out.pulls)  # negative where a cable is slack
    if places:
        out.values = values[:, places]


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
