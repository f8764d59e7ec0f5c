"""Positions that can be held in some orientation, for robots with fewer cables than freedoms.

Plain cables are straight, and :mod:`seecr.inverse.nearest.turned` is all they need. With sag,
pulleys or exit points that lift, its results are starting points: the orientation that holds
changes little, also from one position to the next. So a full search is made for a few positions,
and the others start from their results; any orientation will do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import LIFT, RADIUS, WEIGHT
from seecr.inverse.nearest.firm import part_of
from seecr.inverse.nearest.inward import tightened
from seecr.inverse.nearest.problem import Reaching, Rows
from seecr.inverse.nearest.search import Best, any_that_stays
from seecr.inverse.nearest.turned import turned_in_place
from seecr.pose import Array
from seecr.statics.tables import Tables

# Nearest positions whose results are tried, and how many full searches are made at once.
_NEIGHBOURS, _AT_ONCE = 3, 8


def poses_in_place(
    problem: Reaching, tables: Tables, thorough: bool = True
) -> tuple[Array, NDArray[np.bool_]]:
    """Stable poses (n, 7) at the wanted positions, and (n,) whether one was found.

    Args:
        problem: one in which positions may not change. tables: of its wanted poses.
        thorough: whether full searches are made where no straight cable and no neighbour leads to
            an orientation.
    """
    turned = turned_in_place(problem.robot, tables, problem.least, problem.most)
    if not np.any(tables.cables[..., [RADIUS, WEIGHT, LIFT]]):
        return turned.poses, turned.found
    best, rows = Best.none(problem), np.arange(len(problem.wanted))
    _try_all(best, np.zeros((len(rows), problem.robot.n_dof)), rows)
    # those of straight cables without pulleys are near
    some = rows[turned.found & ~best.firm]
    _try_all(best, problem.to(problem.coordinates(turned.poses[some]), some), some)
    left, fresh = ~best.firm, np.flatnonzero(best.firm)
    while left.any():
        if len(fresh):
            fresh = _from_neighbours(best, np.flatnonzero(left), fresh)
        elif not thorough:
            break
        else:
            some = _apart(np.flatnonzero(left))
            best.take(some, any_that_stays(part_of(problem, some)))
            left[some], fresh = False, some[best.firm[some]]
        left &= ~best.firm
    return problem.placed(best.away, rows), best.firm


def _try_all(best: Best, away: Array, rows: Rows) -> None:
    """Keep what reaches balance from displacements (k, d) of rows, without those of positions."""
    away = best.problem.motion.allowed(away, rows)
    best.keep(tightened(best.problem, best.problem.start(away, rows)))


def _apart(rows: Rows) -> Rows:
    """A few of the rows, evenly spread in their order."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, _AT_ONCE).round().astype(np.intp))]


def _from_neighbours(best: Best, rows: Rows, fresh: Rows) -> Rows:
    """Try the results at the nearest fresh positions; returns the rows that were solved by it."""
    from scipy.spatial import cKDTree  # takes a while to import

    problem, place = best.problem, best.problem.wanted[:, :3]
    near = cKDTree(place[fresh]).query(place[rows], k=min(_NEIGHBOURS, len(fresh)))[1]
    near = near.reshape(len(rows), -1)
    each, of = np.repeat(rows, near.shape[1]), fresh[near.ravel()]
    turned = problem.to(problem.moved(best.away[of], of), each)
    _try_all(best, turned, each)
    return rows[best.firm[rows]]
