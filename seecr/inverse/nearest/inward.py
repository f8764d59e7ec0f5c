"""From poses that are held to the nearest such poses: Newton's method with bounds.

It is sequential quadratic programming in two parts (Byrd, Gould, Nocedal and Waltz 2004). A
projection onto the linearised balance decides which tensions go to their limits. A Newton step on
those, with the curvature of the balance, decides how far to go. Far from the wanted pose the
curvature dominates: the projections alone oscillate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.newton import goal
from seecr.inverse.nearest.problem import Curved, Reaching, Spots
from seecr.pose import Array

# Residual of the balance at a solution [load], and the step that ends a search [robot's length].
TIGHT, ENOUGH = 1e-9, 1e-7
# Residual that is mere rounding [load].
_EXACT = 1e-13
# Most steps, corrections back to balance after each, and the residual allowed after these [load].
_STEPS, _RESTORED, _LOOSE = 60, 3, 1e-3
# Damping: least first value, factor, value from which it rises, value taken as zero, largest.
_FIRST, _FACTOR, _RISE, _NONE, _MOST = 1.0, 5.0, 0.1, 1e-3, 1e8
# A search ends if so many steps gain less than this part.
_PATIENCE, _GAIN = 6, 1e-5
# After so many steps, searches farther away than this many times their row's best are dropped.
_RACE = {8: 1.3, 14: 1.05, 20: 1.02, 30: 1.005}
# Newton steps back to balance, and the longest of them [robot's length].
_BACK, _LONGEST = 12, 2.0


def inward(problem: Reaching, start: Spots) -> Spots:
    """Continue from poses that are held until they get no nearer; slow searches stop earlier."""
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
    """Searches in parallel; those of one row compete.

    Attributes:
        now: current points, nearly in balance. held: last points that are in balance.
        damping: (k,) relative to the distance, which has weight one. rose: (k,) bool, it just rose.
        mark, idle: (k,) [m] distance when a search last gained, (k,) steps since then.
        still: the searches that go on.
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
        k, size = len(start.rows), problem.size(start)
        # the balance curves more over a longer distance
        damping = np.maximum(_FIRST, 0.5 * size / problem.robot.length)
        return cls(
            problem, start.copy(), start.copy(), damping, np.zeros(k, dtype=bool), size,
            np.zeros(k, dtype=np.intp), np.arange(k),
        )  # fmt: skip

    def step(self) -> None:
        """One step of the searches that go on, if distance and residual together decrease."""
        problem, still = self.problem, self.still
        here = self.now.only(still)
        scale = problem.scale[here.rows]
        at = Curved.about(problem, here.away, here.tensions, here.rows)
        to, price, possible = goal(problem, at, here, self.damping[still])
        new, total = _back(problem, at, to)
        price = 2.0 * np.abs(price).max(axis=1)
        before = 0.5 * problem.size(here) ** 2 + price * np.abs(at.left).sum(axis=1)
        after = 0.5 * problem.size(new) ** 2 + price * total
        better = possible & (after < before) & (new.left <= _LOOSE)
        here.left[:] = np.abs(at.left).max(axis=1) / scale
        moved = np.linalg.norm(new.away - here.away, axis=1)
        self.now.put(still, here)
        self.now.put(still[better], new.only(better))
        self._damp(better)
        self._mark()
        here = self.now.only(still)
        size = problem.size(here)
        tight = (here.left <= TIGHT) & (size < problem.size(self.held.only(still)))
        self.held.put(still[tight], here.only(tight))
        enough = ENOUGH * problem.robot.length
        done = (moved <= enough) & (here.left <= TIGHT) | (size <= enough)
        damping = self.damping[still]
        done |= (damping > _MOST) | ((self.idle[still] >= _PATIENCE) & (damping > 0.0))
        self.still = still[~done]

    def _damp(self, better: NDArray[np.bool_]) -> None:
        """More damping after a rejected step, less after two accepted ones."""
        some = self.still
        less = self.damping[some] / np.where(self.rose[some], 1.0, _FACTOR)
        more = np.maximum(_FACTOR * self.damping[some], _RISE)
        new = np.where(better, less, more)
        self.damping[some], self.rose[some] = np.where(new < _NONE, 0.0, new), ~better

    def _mark(self) -> None:
        some, size = self.still, self.problem.size(self.now.only(self.still))
        gained = size < (1.0 - _GAIN) * self.mark[some]
        self.mark[some] = np.where(gained, size, self.mark[some])
        self.idle[some] = np.where(gained, 0, self.idle[some] + 1)

    def drop(self, most: float) -> None:
        """End searches that are so much farther away than the best of their row."""
        size, best = self.problem.size(self.now), np.full(len(self.problem.wanted), np.inf)
        np.minimum.at(best, self.now.rows, size)
        self.still = self.still[(size <= most * best[self.now.rows])[self.still]]

    def ended(self) -> Spots:
        """The last points in balance, or the current ones if they can be balanced."""
        size, held = self.problem.size(self.now), self.problem.size(self.held)
        loose = np.flatnonzero((self.now.left > TIGHT) & (size < held))
        back = restored(self.problem, self.now.only(loose))
        better = (back.left <= TIGHT) & (self.problem.size(back) < held[loose])
        self.held.put(loose[better], back.only(better))
        return self.held


def _back(problem: Reaching, at: Curved, start: Spots) -> tuple[Spots, Array]:
    """Points balanced again with the derivatives ``at`` the start, and residuals (k,) [N]."""
    away, pulls, rows = start.away, start.tensions, start.rows
    none = np.zeros_like(away)
    for _ in range(_RESTORED):
        matrix, load = problem.at(away, rows, pulls)
        step, taut, ok = problem.project(matrix, load, at.turn, (none, pulls), rows)
        new = problem.motion.stepped(away, rows, at.along.basis, step)
        away, pulls = np.where(ok[:, None], new, away), np.where(ok[:, None], taut, pulls)
    matrix, load = problem.at(away, rows, pulls)
    left = np.abs(np.einsum("ndm,nm->nd", matrix, pulls) - load)
    return Spots(away, rows, pulls, left.max(axis=1) / problem.scale[rows]), left.sum(axis=1)


def to_rounding(problem: Reaching, ends: Spots) -> Spots:
    """Ends of searches, balanced to rounding if there are fewer cables than degrees of freedom.

    Tensions of such a robot cannot make up for an error of the pose: it is held exactly or not at
    all.
    """
    if ends.tensions.shape[1] >= ends.away.shape[1]:
        return ends
    out, back = ends.copy(), restored(problem, ends, _EXACT)
    better = np.flatnonzero(back.left <= ends.left)
    out.put(better, back.only(better))
    return out


def restored(problem: Reaching, start: Spots, enough: float = 0.1 * TIGHT) -> Spots:
    """Points brought to balance by Newton's method; this may fail for some.

    Args:
        enough: allowed residual [load].
    """
    out, still = start.copy(), np.arange(len(start.rows))
    for _ in range(_BACK):
        if len(still) == 0:
            break
        here = out.only(still)
        at = Curved.about(problem, here.away, here.tensions, here.rows)
        here.left[:] = np.abs(at.left).max(axis=1) / problem.scale[here.rows]
        near = (np.zeros_like(here.away), here.tensions)
        step, taut, ok = problem.project(at.matrix, at.load, at.turn, near, here.rows)
        size = np.maximum(np.linalg.norm(step, axis=1), 1e-300)
        part = np.minimum(1.0, _LONGEST * problem.robot.length / size)[:, None]
        go = ok & (here.left > enough)
        to = problem.motion.stepped(here.away, here.rows, at.along.basis, part * step)
        here.away[go] = to[go]
        here.tensions[go] += (part * (taut - here.tensions))[go]
        out.put(still, here)
        still = still[go]
    out.left[still] = np.inf
    return out


def tightened(problem: Reaching, start: Spots) -> Spots:
    """The points in balance, including those that can be brought to it."""
    loose = np.flatnonzero(start.left > TIGHT)
    if len(loose):
        start = start.copy()
        start.put(loose, restored(problem, start.only(loose)))
    return start.only_tight(TIGHT)
