"""Nearest poses that are stable, for rows whose searches end at unstable ones.

The balance says nothing about stability, and not everything about heavy cables. Many searches may
therefore end where the platform would leave, and miss a farther pose where it stays. So here each
pose is first checked exactly: starts are moved as far towards the wanted pose as the platform
stays, searches begin there, and the best is improved by random tries, which need no derivatives of
the border of stability. Poses where the platform stays are called firm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.inverse.nearest.inward import inward, tightened
from seecr.inverse.nearest.problem import Reaching, Rows
from seecr.inverse.nearest.screen import spread, toward
from seecr.inverse.nearest.seeds import Candidates, about_wanted, from_sample
from seecr.pose import Array
from seecr.statics.tables import take

# Searches per row; every so-many-th candidate is checked exactly, which is slow with sag.
_SEARCHES, _EVERY = 1, 3
# Fractions of the straight lines from the ends of searches.
_PARTS = 0.5 ** np.arange(16)
# Random tries: rounds, tries per round, first spread [of the distance], its factors, pull inward.
_ROUNDS, _TRIES, _SPREAD, _WIDER, _NARROWER, _PULL = 16, 32, 0.1, 1.5, 0.6, 0.5


def part_of(problem: Reaching, rows: Rows) -> Reaching:
    """The problem for some of its rows."""
    return replace(
        problem, wanted=problem.wanted[rows],
        values=None if problem.values is None else problem.values[rows],
        balance=lambda poses, some, about=None: problem.balance(poses, rows[some], about),
        stays=lambda poses, some: problem.stays(poses, rows[some]),
        least=problem.least[rows], most=problem.most[rows], scale=problem.scale[rows],
        motion=problem.motion.part(rows),
        straight=None if problem.straight is None else take(problem.straight, rows),
    )  # fmt: skip


def firm_ends(problem: Reaching, places: Array, ends: Array) -> Candidates:
    """Firm poses near the wanted ones.

    Args:
        places: (k, 7) or (k, d) coordinates of a sample of poses that can be held.
        ends: (n, d) [m] displacements from the wanted poses to unstable ends of searches.
    """
    first = from_sample(problem, places).and_more(about_wanted(problem))
    firm = _firm_of(problem, Candidates(first.away[::_EVERY], first.rows[::_EVERY]))
    first = Candidates(*toward(problem, firm.away, firm.rows, problem.firm))
    few = spread(problem, first.away, first.rows, _SEARCHES)
    start = problem.start(first.away[few], first.rows[few])
    found = inward(problem, tightened(problem, start))
    first = first.and_more(_firm_of(problem, Candidates(found.away, found.rows)))
    return first.and_more(_out_to(problem, first, ends))


def _out_to(problem: Reaching, firm: Candidates, ends: Array) -> Candidates:
    """Firm poses on straight lines from ends (n, d) to the reference and the nearest firm poses."""
    n, near = len(ends), ends.copy()
    home = problem.to(np.tile(problem.home, (n, 1)), np.arange(n))
    best, rows = nearest_of(problem, firm)
    near[rows] = best
    twice = np.tile(ends, (2, 1))
    own = np.tile(np.arange(n), 2)
    ways = problem.motion.allowed(np.concatenate([home, near]), own) - twice
    many, each = twice[:, None] + _PARTS[:, None] * ways[:, None], np.repeat(own, len(_PARTS))
    away = problem.motion.allowed(many.reshape(len(each), -1), each)
    return _firm_of(problem, Candidates(away, each))


def _firm_of(problem: Reaching, some: Candidates) -> Candidates:
    """Those of the candidates that are firm."""
    firm = problem.firm(some.away, some.rows)
    return Candidates(some.away[firm], some.rows[firm])


def nearest_of(problem: Reaching, some: Candidates) -> tuple[Array, Rows]:
    """The nearest candidate (k, d) of each row that has any, and those rows (k,)."""
    order = np.lexsort((problem.motion.far(some.away, some.rows), some.rows))
    rows, place = np.unique(some.rows[order], return_index=True)
    return some.away[order[place]], rows


def at_random(problem: Reaching, away: Array, rows: Rows) -> Array:
    """Nearer firm poses (k, d), found about the firm poses of rows (k,).

    Each round takes the nearest of some random draws about the best; rounds that gain widen the
    spread, others narrow it.
    """
    random, best, motion = np.random.default_rng(5), away.copy(), problem.motion
    wide, shape = np.full((len(rows), 1, 1), _SPREAD), (len(rows), _TRIES)
    each = np.repeat(rows, _TRIES)
    for _ in range(_ROUNDS):
        size = motion.far(best, rows)[:, None]
        basis = motion.directions(best, rows).basis
        drawn = random.normal(size=(*shape, best.shape[1])) / np.sqrt(best.shape[1])
        inward_by = _PULL * wide * random.random((*shape, 1))
        if basis is not None:
            drawn = drawn @ basis.swapaxes(1, 2)
        tries = (1.0 - inward_by) * best[:, None] + wide * size[..., None] * drawn
        tries = motion.allowed(tries.reshape(len(each), -1), each)
        far, tries = motion.far(tries, each).reshape(shape), tries.reshape(*shape, -1)
        k, j = np.nonzero(far < size)
        firm = problem.firm(tries[k, j], rows[k])
        nearer = np.full(shape, np.inf)
        nearer[k[firm], j[firm]] = far[k[firm], j[firm]]
        gains = np.isfinite(nearer).any(axis=1)
        best[gains] = tries[gains, nearer.argmin(axis=1)[gains]]
        wide *= np.where(gains, _WIDER, _NARROWER)[:, None, None]
    return best
