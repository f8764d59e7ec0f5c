"""Nearest poses at which the platform stays, where searches end at those where it would not.

Balance knows nothing of stability, nor all of heavy cables: many ends of searches may lie where the
platform would leave, and pass by a farther one where it stays. So here every pose is checked first,
exactly: starts are taken as far to the wanted pose as the platform stays, searches begin there, and
the best goes on at random, which needs no rates of what ends a stable region.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.inverse.nearest.inward import inward, tightened
from seecr.inverse.nearest.problem import Reaching, Rows
from seecr.inverse.nearest.screen import spread, toward
from seecr.inverse.nearest.seeds import Candidates, about_wanted, from_sample
from seecr.pose import Array

# Searches of a row; every so-many-th candidate is checked exactly, which takes long with sag.
_SEARCHES, _EVERY = 1, 3
# Parts of the ways from where searches end.
_PARTS = 0.5 ** np.arange(16)
# Rounds at random, tries of each, the first spread [of the distance], its factors, the way inward.
_ROUNDS, _TRIES, _SPREAD, _WIDER, _NARROWER, _PULL = 16, 32, 0.1, 1.5, 0.6, 0.5


def part_of(problem: Reaching, rows: Rows) -> Reaching:
    """The problem of some of its rows."""
    return replace(
        problem, wanted=problem.wanted[rows],
        values=None if problem.values is None else problem.values[rows],
        balance=lambda poses, some, about=None: problem.balance(poses, rows[some], about),
        stays=lambda poses, some: problem.stays(poses, rows[some]),
        least=problem.least[rows], most=problem.most[rows], scale=problem.scale[rows],
    )  # fmt: skip


def firm_ends(problem: Reaching, poses: Array, ends: Array) -> Candidates:
    """Poses where the platform stays, near the wanted ones.

    Args:
        poses: (k, 7) a sample of what can be held.
        ends: (n, d) [m] away from the wanted poses where searches ended, but it would not stay.
    """
    first = from_sample(problem, poses).and_more(about_wanted(problem))
    firm = _firm_of(problem, Candidates(first.away[::_EVERY], first.rows[::_EVERY]))
    first = Candidates(*toward(problem, firm.away, firm.rows, problem.firm))
    few = spread(problem, first.away, first.rows, _SEARCHES)
    start = problem.start(first.away[few], first.rows[few])
    found = inward(problem, tightened(problem, start))
    first = first.and_more(_firm_of(problem, Candidates(found.away, found.rows)))
    return first.and_more(_out_to(problem, first, ends))


def _out_to(problem: Reaching, firm: Candidates, ends: Array) -> Candidates:
    """Where the platform stays on straight ways from ends (n, d) home, and to the nearest firm."""
    n, near = len(ends), ends.copy()
    home = problem.to(np.tile(problem.robot.reference_pose, (n, 1)), np.arange(n))
    best, rows = nearest_of(firm)
    near[rows] = best
    twice = np.tile(ends, (2, 1))
    ways = problem.allowed(np.concatenate([home, near]) - twice)
    many = twice[:, None] + _PARTS[:, None] * ways[:, None]
    each = np.repeat(np.tile(np.arange(n), 2), len(_PARTS))
    return _firm_of(problem, Candidates(many.reshape(len(each), -1), each))


def _firm_of(problem: Reaching, some: Candidates) -> Candidates:
    """Those at which the platform stays."""
    firm = problem.firm(some.away, some.rows)
    return Candidates(some.away[firm], some.rows[firm])


def nearest_of(some: Candidates) -> tuple[Array, Rows]:
    """The nearest (k, d) of each row that has any, and those rows (k,)."""
    order = np.lexsort((np.linalg.norm(some.away, axis=1), some.rows))
    rows, place = np.unique(some.rows[order], return_index=True)
    return some.away[order[place]], rows


def at_random(problem: Reaching, away: Array, rows: Rows) -> Array:
    """Nearer poses (k, d) at which the platform stays, about those of rows (k,) that do.

    Each round takes the nearest of some drawn about the best; rounds that gain widen the spread.
    """
    random, best = np.random.default_rng(5), away.copy()
    wide, shape = np.full((len(rows), 1, 1), _SPREAD), (len(rows), _TRIES)
    for _ in range(_ROUNDS):
        size = np.linalg.norm(best, axis=1)[:, None]
        drawn = random.normal(size=(*shape, best.shape[1])) / np.sqrt(best.shape[1])
        inward_by = _PULL * wide * random.random((*shape, 1))
        tries = (1.0 - inward_by) * best[:, None] + wide * size[..., None] * drawn
        tries = problem.allowed(tries)
        far = np.linalg.norm(tries, axis=2)
        k, j = np.nonzero(far < size)
        firm = problem.firm(tries[k, j], rows[k])
        nearer = np.full(shape, np.inf)
        nearer[k[firm], j[firm]] = far[k[firm], j[firm]]
        gains = np.isfinite(nearer).any(axis=1)
        best[gains] = tries[gains, nearer.argmin(axis=1)[gains]]
        wide *= np.where(gains, _WIDER, _NARROWER)[:, None, None]
    return best
