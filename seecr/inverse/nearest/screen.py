"""Which of many candidates searches begin at: the nearest that are held, each turned otherwise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.inward import tightened
from seecr.inverse.nearest.problem import Reaching, Rows, Spots
from seecr.inverse.nearest.seeds import Candidates
from seecr.pose import Array

# Halvings of the way to the wanted poses; after some only the nearer half goes on, but not fewer.
_HALVINGS, _FEWER, _KEPT = 7, (2, 4), 120
# Where few are held, the starts are of so many times as many that lack least.
_LEAST = 8
# How far apart in orientation [rad] starts are to be, but not by more than the nearest's distance
# over the length; where not enough are: a half, a quarter.
_APART = (0.7, 0.35, 0.175)


def screened(problem: Reaching, candidates: Candidates, most: int) -> Spots:
    """Poses that are held, as far on the way to the wanted ones as they are: ``most`` of a row."""
    held = problem.held(candidates.away, candidates.rows)
    back = _brought_back(problem, candidates, held, most)
    away = np.concatenate([candidates.away[held], back.away])
    rows = np.concatenate([candidates.rows[held], back.rows])
    away, rows = toward(problem, away, rows, problem.held)
    few = spread(problem, away, rows, most)
    return tightened(problem, problem.start(away[few], rows[few]))


def _brought_back(
    problem: Reaching, candidates: Candidates, held: NDArray[np.bool_], most: int
) -> Spots:
    """Where few candidates of a row are held, as with fewer cables than freedoms: some near others.

    Of those that lack least such that are apart, and every so-many-th of a row's, as they were
    drawn: all over.
    """  # fmt: skip
    many = np.bincount(candidates.rows[held], minlength=len(problem.wanted))
    chosen: list[int] = []
    for row in np.flatnonzero(many < most):
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
    fine: Callable[[Array, Rows], NDArray[np.bool_]],
) -> tuple[Array, Rows]:
    """As far on straight ways to the wanted poses as is fine; half of them keep their turn."""
    inner, outer = np.zeros(len(rows)), np.ones(len(rows))
    turned = np.random.default_rng(4).random(len(rows)) < 0.5
    keeps = turned[:, None] & problem.robot.hinges & ~problem.robot.hinges.all()
    way = np.where(keeps, 0.0, away)
    for number in range(_HALVINGS):
        if number in _FEWER:
            size = np.linalg.norm(away - inner[:, None] * way, axis=1)
            few = _nearer_half(size, rows, len(problem.wanted))
            away, way, rows = away[few], way[few], rows[few]
            inner, outer = inner[few], outer[few]
        middle = 0.5 * (inner + outer)
        ok = fine(away - middle[:, None] * way, rows)
        inner, outer = np.where(ok, middle, inner), np.where(ok, outer, middle)
    return away - inner[:, None] * way, rows


def _nearer_half(size: Array, rows: Rows, n: int) -> Rows:
    """Which of each row's are its nearer half, but not too few."""
    order = np.lexsort((size, rows))
    many = np.bincount(rows, minlength=n)
    place = np.arange(len(rows)) - (np.cumsum(many) - many)[rows[order]]
    return order[place < np.maximum(_KEPT, many[rows[order]] // 2)]


def spread(problem: Reaching, away: Array, rows: Rows, most: int) -> list[int]:
    """The nearest of each row that are turned otherwise than those before."""
    chosen, size = [], np.linalg.norm(away, axis=1)
    hinges, length = problem.robot.hinges, problem.robot.length
    for row in range(len(problem.wanted)):
        mine = np.flatnonzero(rows == row)
        mine = mine[np.argsort(size[mine])]
        # what cannot turn is told apart by its place
        least = 1e-9 * length + size[mine[:1]].sum()
        unit = min(length, least) if hinges.any() else least
        place = (away[:, hinges] if hinges.any() else away) / unit
        taken: list[int] = []
        for gap in _APART:
            for j in mine:
                if len(taken) >= most:
                    break
                if np.all(np.linalg.norm(place[taken] - place[j], axis=1) > gap):
                    taken.append(int(j))
        chosen += taken
    return chosen
