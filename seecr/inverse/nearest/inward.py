"""From poses that are held to local minima of the way to wanted ones: Newton's method with bounds.

Sequential quadratic programs in two parts (Byrd, Gould, Nocedal and Waltz 2004): a projection on
the linearised balance says which tensions go to their limits, and a step of Newton's method on
those, curvature of the balance included, says how far to go. Far outside, curvature is all: the
projections alone go to and fro.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.newton import goal
from seecr.inverse.nearest.problem import Curved, Reaching, Spots
from seecr.pose import Array

# Balance that an answer has [of load], and a step over the length that ends a search.
TIGHT, ENOUGH = 1e-9, 1e-7
# Balance to rounding [of load].
_EXACT = 1e-13
# Most steps, how often each goes back to balance, and what may be left of that [of load].
_STEPS, _RESTORED, _LOOSE = 60, 3, 1e-3
# Damping: least of the first, its factor, the least it rises from, what is none, and the most.
_FIRST, _FACTOR, _RISE, _NONE, _MOST = 1.0, 5.0, 0.1, 1e-3, 1e8
# A search ends where so many steps gain less than this part.
_PATIENCE, _GAIN = 6, 1e-5
# After a number of steps, those farther than so many times the best of their row end.
_RACE = {8: 1.3, 14: 1.05, 20: 1.02, 30: 1.005}
# Rounds back to balance with new rates each, the longest step of one over the length.
_BACK, _LONGEST = 12, 2.0


def inward(problem: Reaching, start: Spots) -> Spots:
    """Go on from poses that are held: each to where it gets no nearer, the slow as far as it is."""
    race = _Race.begun(problem, start)
    for number in range(_STEPS):
        if len(race.still) == 0:
            break
        race.step()
        if number in _RACE:
            race.drop(_RACE[number])
    return race.ended()


@dataclass(eq=False)
class _Race:
    """Searches, those of a row against one another.

    Attributes:
        now: where they are, nearly in balance. held: the last places that are held.
        damping: (k,) beside one, which the way weighs. rose: (k,) bool, it just did.
        mark, idle: (k,) [m] when it last came nearer, (k,) steps since.
        still: those that go on.
    """

    problem: Reaching
    now: Spots
    held: Spots
    damping: Array
    rose: NDArray[np.bool_]
    mark: Array
    idle: NDArray[np.intp]
    still: NDArray[np.intp]

    @classmethod
    def begun(cls, problem: Reaching, start: Spots) -> _Race:
        k, size = len(start.rows), start.size()
        # the farther away, the more balance bends over a way
        damping = np.maximum(_FIRST, 0.5 * size / problem.robot.length)
        return cls(
            problem, start.copy(), start.copy(), damping, np.zeros(k, dtype=bool), size,
            np.zeros(k, dtype=np.intp), np.arange(k),
        )  # fmt: skip

    def step(self) -> None:
        """One step of those that go on, taken where way and balance together come out less."""
        problem, still = self.problem, self.still
        here = self.now.only(still)
        scale = problem.scale[here.rows]
        at = Curved.about(problem, here.away, here.tensions, here.rows)
        to, price, possible = goal(problem, at, here, self.damping[still])
        new, total = _back(problem, at, to)
        price = 2.0 * np.abs(price).max(axis=1)
        before = 0.5 * here.size() ** 2 + price * np.abs(at.left).sum(axis=1)
        after = 0.5 * new.size() ** 2 + price * total
        better = possible & (after < before) & (new.left <= _LOOSE)
        here.left[:] = np.abs(at.left).max(axis=1) / scale
        moved = np.linalg.norm(new.away - here.away, axis=1)
        self.now.put(still, here)
        self.now.put(still[better], new.only(better))
        self._damp(better)
        self._mark()
        here = self.now.only(still)
        tight = (here.left <= TIGHT) & (here.size() < self.held.size()[still])
        self.held.put(still[tight], here.only(tight))
        enough = ENOUGH * problem.robot.length
        done = (moved <= enough) & (here.left <= TIGHT) | (here.size() <= enough)
        damping = self.damping[still]
        done |= (damping > _MOST) | ((self.idle[still] >= _PATIENCE) & (damping > 0.0))
        self.still = still[~done]

    def _damp(self, better: NDArray[np.bool_]) -> None:
        """More where a step was not taken; less where one was, and the one before, too."""
        some = self.still
        less = self.damping[some] / np.where(self.rose[some], 1.0, _FACTOR)
        more = np.maximum(_FACTOR * self.damping[some], _RISE)
        new = np.where(better, less, more)
        self.damping[some], self.rose[some] = np.where(new < _NONE, 0.0, new), ~better

    def _mark(self) -> None:
        some, size = self.still, self.now.only(self.still).size()
        gained = size < (1.0 - _GAIN) * self.mark[some]
        self.mark[some] = np.where(gained, size, self.mark[some])
        self.idle[some] = np.where(gained, 0, self.idle[some] + 1)

    def drop(self, most: float) -> None:
        """Those end that are so much farther than the best of their row."""
        size, best = self.now.size(), np.full(len(self.problem.wanted), np.inf)
        np.minimum.at(best, self.now.rows, size)
        self.still = self.still[(size <= most * best[self.now.rows])[self.still]]

    def ended(self) -> Spots:
        """What is held: the last places that were, or what the ends are brought back to."""
        loose = np.flatnonzero((self.now.left > TIGHT) & (self.now.size() < self.held.size()))
        back = restored(self.problem, self.now.only(loose))
        better = (back.left <= TIGHT) & (back.size() < self.held.size()[loose])
        self.held.put(loose[better], back.only(better))
        return self.held


def _back(problem: Reaching, at: Curved, start: Spots) -> tuple[Spots, Array]:
    """Back to balance with the rates of before: where, and (k,) all that is left [N]."""
    away, pulls, rows = start.away, start.tensions, start.rows
    for _ in range(_RESTORED):
        matrix, load = problem.at(away, rows, pulls)
        new, taut, ok = problem.project(matrix, load, at.turn, away, (away, pulls), rows)
        away, pulls = np.where(ok[:, None], new, away), np.where(ok[:, None], taut, pulls)
    matrix, load = problem.at(away, rows, pulls)
    left = np.abs(np.einsum("ndm,nm->nd", matrix, pulls) - load)
    return Spots(away, rows, pulls, left.max(axis=1) / problem.scale[rows]), left.sum(axis=1)


def to_rounding(problem: Reaching, ends: Spots) -> Spots:
    """Ends of searches, balanced to rounding where there are fewer cables than freedoms.

    No tensions make up for what the pose of such a robot lacks: it is held as it is, or not.
    """
    if ends.tensions.shape[1] >= ends.away.shape[1]:
        return ends
    out, back = ends.copy(), restored(problem, ends, _EXACT)
    better = np.flatnonzero(back.left <= ends.left)
    out.put(better, back.only(better))
    return out


def restored(problem: Reaching, start: Spots, enough: float = 0.1 * TIGHT) -> Spots:
    """Where searches that are not in balance come to it, by Newton's method; some may not.

    Args:
        enough: what may be left [of load].
    """
    out, still = start.copy(), np.arange(len(start.rows))
    for _ in range(_BACK):
        if len(still) == 0:
            break
        here = out.only(still)
        at = Curved.about(problem, here.away, here.tensions, here.rows)
        here.left[:] = np.abs(at.left).max(axis=1) / problem.scale[here.rows]
        near = (here.away, here.tensions)
        to, taut, ok = problem.project(at.matrix, at.load, at.turn, here.away, near, here.rows)
        step = to - here.away
        size = np.maximum(np.linalg.norm(step, axis=1), 1e-300)
        part = np.minimum(1.0, _LONGEST * problem.robot.length / size)[:, None]
        go = ok & (here.left > enough)
        here.away[go] += (part * step)[go]
        here.tensions[go] += (part * (taut - here.tensions))[go]
        out.put(still, here)
        still = still[go]
    out.left[still] = np.inf
    return out


def tightened(problem: Reaching, start: Spots) -> Spots:
    """Those that are in balance, and those that come to it."""
    loose = np.flatnonzero(start.left > TIGHT)
    if len(loose):
        start = start.copy()
        start.put(loose, restored(problem, start.only(loose)))
    return start.only_tight(TIGHT)
