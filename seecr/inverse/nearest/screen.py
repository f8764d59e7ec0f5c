"""Starting points among many candidates: the nearest held ones that differ in rotation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.inward import tightened
from seecr.inverse.nearest.problem import Reaching, Rows, Spots
from seecr.inverse.nearest.seeds import Candidates
from seecr.pose import Array

Fine = Callable[[Array, Rows], NDArray[np.bool_]]
"""Whether displacements (k, d) of rows (k,) are fine."""

# Bisections towards the wanted poses; after some only the nearer half goes on, but no fewer.
_HALVINGS, _FEWER, _KEPT = 7, (2, 4), 120
# If few are held, starts are taken from this many times as many with the smallest residuals.
_LEAST = 8
# Least difference in rotation [rad] between starts, but at most the nearest's distance over the
# length. If that leaves too few, a half and then a quarter of it is enough.
_APART = (0.7, 0.35, 0.175)


def screened(problem: Reaching, candidates: Candidates, most: int) -> Spots:
    """Held poses as near to the wanted ones as straight lines lead: ``most`` per row.

    Where the balance is not linear, lines end where it really holds, and others where it seems to:
    from there balance may be found still nearer, or not at all.
    """
    spots = _screened(problem, candidates, most, problem.held)
    if problem.holds is None:
        return spots
    return spots.and_more(_screened(problem, candidates, most, problem.seems_held))


def _screened(problem: Reaching, candidates: Candidates, most: int, fine: Fine) -> Spots:
    """The same, with one meaning of held."""
    held = fine(candidates.away, candidates.rows)
    back = _brought_back(problem, candidates, held, most)
    away = np.concatenate([candidates.away[held], back.away])
    rows = np.concatenate([candidates.rows[held], back.rows])
    away, rows = toward(problem, away, rows, fine)
    few = spread(problem, away, rows, most)
    return tightened(problem, problem.start(away[few], rows[few]))


def _brought_back(
    problem: Reaching, candidates: Candidates, held: NDArray[np.bool_], most: int
) -> Spots:
    """Poses brought to balance near candidates, for rows of which few candidates are held.

    This occurs with fewer cables than degrees of freedom. Tried are those with small residuals that
    differ in rotation, and an even selection of all.
    """
    rows, place = np.unique(candidates.rows, return_inverse=True)
    many = np.bincount(place[held], minlength=len(rows))
    chosen: list[int] = []
    for row in rows[many < most]:
        mine = np.flatnonzero(~held & (candidates.rows == row))
        lack = problem.lack(candidates.away[mine], candidates.rows[mine])[0]
        best = mine[np.argsort(lack)[: _LEAST * most]]
        apart = best[spread(problem, candidates.away[best], candidates.rows[best], most)]
        all_over = mine[:: max(1, len(mine) // most)]
        chosen += np.unique(np.concatenate([apart, all_over])).tolist()
    start = problem.start(candidates.away[chosen], candidates.rows[chosen])
    return tightened(problem, start)


def toward(
    problem: Reaching,
    away: Array,
    rows: Rows,
    fine: Fine,
) -> tuple[Array, Rows]:
    """As far on straight lines to the wanted poses as is fine; half of them keep their rotation."""
    inner, outer = np.zeros(len(rows)), np.ones(len(rows))
    turned = np.random.default_rng(4).random(len(rows)) < 0.5
    motion, way = problem.motion, away.copy()
    if motion.turns < away.shape[1]:
        way[turned] -= motion.brought(away[turned], rows[turned], np.zeros((turned.sum(), 3)))
    for number in range(_HALVINGS):
        if number in _FEWER:
            size = motion.far(motion.allowed(away - inner[:, None] * way, rows), rows)
            few = _nearer_half(size, rows, len(problem.wanted))
            away, way, rows = away[few], way[few], rows[few]
            inner, outer = inner[few], outer[few]
        middle = 0.5 * (inner + outer)
        ok = fine(motion.allowed(away - middle[:, None] * way, rows), rows)
        inner, outer = np.where(ok, middle, inner), np.where(ok, outer, middle)
    return motion.allowed(away - inner[:, None] * way, rows), rows


def _nearer_half(size: Array, rows: Rows, n: int) -> Rows:
    """The nearer half of each row's points, but no fewer than a minimum."""
    order = np.lexsort((size, rows))
    many = np.bincount(rows, minlength=n)
    place = np.arange(len(rows)) - (np.cumsum(many) - many)[rows[order]]
    return order[place < np.maximum(_KEPT, many[rows[order]] // 2)]


def spread(problem: Reaching, away: Array, rows: Rows, most: int) -> list[int]:
    """The nearest points of each row that differ in rotation from those before."""
    chosen, size = [], problem.motion.far(away, rows)
    turned, length = problem.motion.turned(away, rows), problem.robot.length
    order = np.lexsort((size, rows))
    for mine in np.split(order, np.searchsorted(rows[order], np.arange(1, len(problem.wanted)))):
        # a platform that cannot turn is compared by position
        least = 1e-9 * length + size[mine[:1]].sum()
        place = turned[mine] / (min(length, least) if problem.robot.turns else least)
        far = np.full(len(mine), np.inf)
        taken: list[int] = []
        for gap in _APART:
            while len(taken) < most and np.any(far > gap):
                k = int(np.argmax(far > gap))
                taken.append(int(mine[k]))
                far = np.minimum(far, np.linalg.norm(place - place[k], axis=1))
        chosen += taken
    return chosen
