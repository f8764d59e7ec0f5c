"""The nearest poses that can be held: the best of many local searches.

Minimised is position^2 + (length x rotation)^2 subject to balance, W(q) tau = -w(q), and limits.
The set of poses that can be held is not convex, and tilted platforms reach where level ones do not:
there are many local minima, a few per cent apart. So searches begin at the wanted pose itself, at
the ends of straight lines from a sample of held poses, and at the solutions of other rows, in many
rotations. If the nearest end is unstable, see :mod:`seecr.inverse.nearest.firm`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest.firm import at_random, firm_ends, nearest_of, part_of
from seecr.inverse.nearest.inward import ENOUGH, TIGHT, inward, tightened, to_rounding
from seecr.inverse.nearest.problem import Curved, Reaching, Rows, Spots
from seecr.inverse.nearest.screen import screened
from seecr.inverse.nearest.seeds import Candidates, about_answers, about_wanted, from_sample, sample
from seecr.pose import Array

# Searches per row from the sample, and from the solutions of other rows.
_FIRST, _SHARED = 14, 4
# Rows searched at once: each takes up to 8 MB meanwhile.
_AT_ONCE = 64
# Firm poses are sought if a search ended nearer by this part, but at an unstable pose.
_NEARER = 0.01
# Step towards the wanted pose [of the distance], and the part of it that a local minimum may gain.
_PART, _FLAT = 1e-3, 1e-3


@dataclass(frozen=True, eq=False)
class Nearest:
    """Results for n wanted poses.

    Attributes:
        poses: (n, 7). found: (n,) bool, the pose can be held.
        firm: (n,) bool, the platform is stable there.
        settled: (n,) bool, it meets the first-order conditions of a local minimum (Karush, Kuhn
            and Tucker): to first order no small change that can be held comes nearer.
    """

    poses: Array
    found: NDArray[np.bool_]
    firm: NDArray[np.bool_]
    settled: NDArray[np.bool_]


def nearest(problem: Reaching) -> Nearest:
    """The nearest poses that can be held, and whether any were found.

    Stable poses are preferred to all others; if none was found, the nearest unstable one is kept.

    Args:
        problem: the wanted poses, their balance, and what may change. The balance is linearised in
            the tensions, which is not exact for heavy cables.
    """
    best, rows = Best.none(problem), np.arange(len(problem.wanted))
    start = problem.start(np.zeros((len(rows), problem.robot.n_dof)), rows)
    best.keep(inward(problem, tightened(problem, start)))
    places = sample(problem)
    first = from_sample(problem, places).and_more(about_wanted(problem))
    best.search(first, _FIRST)
    if not best.found.any():
        return Nearest(problem.wanted.copy(), best.found, best.firm, best.found.copy())
    best.search(about_answers(problem, best.away, np.flatnonzero(best.found)), _SHARED)
    best.firm_ones(places)
    settled = best.settled() & best.firm
    return Nearest(problem.placed(best.away, rows), best.found, best.firm, settled)


def any_that_stays(problem: Reaching) -> Best:
    """Any poses at which the platform is held and stable, near or far, if some are found."""
    best, places = Best.none(problem), sample(problem)
    first = from_sample(problem, places).and_more(about_wanted(problem))
    spots = screened(problem, first, _FIRST)
    best.keep(spots)
    spots = spots.only(~best.firm[spots.rows])
    if len(spots.rows):
        best.keep(inward(problem, spots))
        best.firm_ones(places)
    return best


@dataclass(frozen=True, eq=False)
class Best:
    """The best results so far, updated in place.

    Attributes:
        away: (n, d) [m] from the wanted poses. tensions: (n, m) [N].
        found: (n,) bool. firm: (n,) bool, the platform is stable there.
        loose: (n, d) [m] the nearest unstable pose, infinite if there is none.
    """

    problem: Reaching
    away: Array
    tensions: Array
    found: NDArray[np.bool_]
    firm: NDArray[np.bool_]
    loose: Array

    @classmethod
    def none(cls, problem: Reaching) -> Best:
        n = len(problem.wanted)
        away, tensions = np.zeros((n, problem.robot.n_dof)), np.zeros(problem.least.shape)
        loose = np.full(away.shape, np.inf)
        return cls(problem, away, tensions, np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), loose)

    def search(self, candidates: Candidates, most: int) -> None:
        """Search from the best candidates, ``most`` of each row."""
        for lot in candidates.in_lots(_AT_ONCE):
            spots = screened(self.problem, lot, most)
            if spots.tensions.shape[1] < self.problem.robot.n_dof:
                # few poses are held at all; from stable ones searches may go on to unstable ones
                self.keep(spots)
            self.keep(inward(self.problem, spots))

    def keep(self, other: Spots) -> None:
        """Take results that are nearer, and stable ones rather than unstable ones."""
        motion = self.problem.motion
        other = to_rounding(self.problem, other.only_tight(TIGHT))
        other = other.only(motion.are_allowed(other.away, other.rows))
        if len(other.rows) == 0:
            return
        firm = self.problem.rests(other.away, other.rows)
        size, own, loose = self.problem.size(other), self._far(self.away), self._far(self.loose)
        for i in np.argsort(size):
            row = other.rows[i]
            nearer = not self.found[row] or size[i] < own[row]
            if firm[i] > self.firm[row] or (firm[i] == self.firm[row] and nearer):
                self.away[row], self.tensions[row] = other.away[i], other.tensions[i]
                self.found[row], self.firm[row], own[row] = True, firm[i], size[i]
            if not firm[i] and size[i] < loose[row]:
                self.loose[row], loose[row] = other.away[i], size[i]

    def _far(self, away: Array) -> Array:
        """(n,) [m] distances of displacements (n, d), infinite where these are."""
        out = np.full(len(away), np.inf)
        known: Rows = np.flatnonzero(np.isfinite(away).all(axis=1))
        out[known] = self.problem.motion.far(away[known], known)
        return out

    def take(self, rows: Rows, other: Best) -> None:
        """Copy the results of another search, which is for these rows only."""
        self.away[rows], self.tensions[rows] = other.away, other.tensions
        self.found[rows], self.firm[rows], self.loose[rows] = other.found, other.firm, other.loose

    def firm_ones(self, places: Array) -> None:
        """Where a search ended nearer but unstable: the nearest stable pose.

        Args:
            places: (k, 7) or (k, d) coordinates of a sample of poses that can be held.
        """
        size = np.where(self.firm, self._far(self.away), np.inf)
        end = self._far(self.loose)
        rows = np.flatnonzero(self.found & (end < (1.0 - _NEARER) * size))
        if len(rows) == 0:
            return
        part = part_of(self.problem, rows)
        away, some = nearest_of(part, firm_ends(part, places, self.loose[rows]))
        if len(some) == 0:
            return
        away = at_random(part, away, some)
        start = part.start(away, some)
        better = part.motion.far(away, some) < size[rows[some]]
        to = rows[some[better]]
        self.away[to], self.tensions[to] = away[better], start.tensions[better]
        self.firm[to] = True

    def settled(self) -> NDArray[np.bool_]:
        """(n,) whether a small step towards the wanted pose is lost on the way back to balance.

        This is the projected gradient, equivalent to the conditions of Karush, Kuhn and Tucker.
        """
        rows: Rows = np.flatnonzero(self.found)
        away, pulls, out = self.away[rows], self.tensions[rows], self.found.copy()
        at = Curved.about(self.problem, away, pulls, rows)
        near = (-_PART * at.along.slope, pulls)
        step, _, possible = self.problem.project(at.matrix, at.load, at.turn, near, rows)
        size = self.problem.motion.far(away, rows)
        gain = np.linalg.norm(step, axis=1) <= _FLAT * _PART * size
        out[rows] = (possible & gain) | (size <= ENOUGH * self.problem.robot.length)
        return out
