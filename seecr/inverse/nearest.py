"""The nearest poses that can be held: the best of many local searches.

Minimised is position^2 + (length x rotation)^2 subject to balance, W(q) tau = -w(q), and limits.
The set of poses that can be held is not convex: there are many local minima, a few per cent apart.
So searches begin at the wanted pose, at the ends of straight lines from a sample of held poses, and
at the solutions of other rows, in many rotations. Where the nearest end is unstable, starts are
moved as far towards the wanted pose as the platform stays, and the best is improved by random
tries, which need no derivatives of the border of stability.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.inverse.nearest_problem import Curved, NearestProblem, Rows, Spots
from seecr.inverse.nearest_sqp import ENOUGH, TIGHT, solve_sqp, tightened, to_rounding
from seecr.inverse.nearest_starts import (
    Candidates,
    about_answers,
    about_wanted,
    from_sample,
    prune_starts,
    sample,
    toward,
)
from seecr.pose import Array
from seecr.statics.tables import ByRow

# Searches per row from the sample, and from the solutions of other rows.
_FIRST, _SHARED = 14, 4
# Rows searched at once: each takes up to 8 MB meanwhile.
_AT_ONCE = 64
# Stable poses are sought if a search ended nearer by this part, but at an unstable pose.
_NEARER = 0.01
# Step towards the wanted pose [of the distance], and the part of it that a local minimum may gain.
_PART, _FLAT = 1e-3, 1e-3
# Where stability is asked for, every so-many-th candidate is checked: that is slow with sag.
_EVERY = 3
# Fractions of the straight lines from the ends of searches.
_PARTS = 0.5 ** np.arange(16)
# Random tries: rounds, tries per round, first spread [of the distance], its factors, pull inward.
_ROUNDS, _TRIES, _SPREAD, _WIDER, _NARROWER, _PULL = 16, 32, 0.1, 1.5, 0.6, 0.5


@dataclass(eq=False)
class Nearest(ByRow):
    """Poses (n, 7) for wanted ones, and (n,) whether they can be held and are stable.

    ``settled`` (n,): to first order no small change that can be held comes nearer (the conditions
    of Karush, Kuhn and Tucker).
    """

    poses: Array
    found: NDArray[np.bool_]
    stable: NDArray[np.bool_]
    settled: NDArray[np.bool_]


def nearest(problem: NearestProblem) -> Nearest:
    """The nearest poses that can be held; stable ones if there are any."""
    best, rows = Best.none(problem), np.arange(len(problem.wanted))
    start = problem.start(np.zeros((len(rows), problem.robot.n_dof)), rows)
    best.keep(solve_sqp(problem, tightened(problem, start)))
    places = sample(problem)
    first = from_sample(problem, places).and_more(about_wanted(problem))
    best.search(first, _FIRST)
    if not best.found.any():
        return Nearest(problem.wanted.copy(), best.found, best.stable, best.found.copy())
    best.search(about_answers(problem, best.away, np.flatnonzero(best.found)), _SHARED)
    best.stable_ones(places)
    settled = best.settled() & best.stable
    return Nearest(problem.placed(best.away, rows), best.found, best.stable, settled)


def any_that_stays(problem: NearestProblem) -> Best:
    """Any poses at which the platform is held and stable, near or far, if some are found."""
    best, places = Best.none(problem), sample(problem)
    first = from_sample(problem, places).and_more(about_wanted(problem))
    spots = prune_starts(problem, first, _FIRST)
    best.keep(spots)
    spots = spots.only(~best.stable[spots.rows])
    if len(spots.rows):
        best.keep(solve_sqp(problem, spots))
        best.stable_ones(places)
    return best


@dataclass(frozen=True, eq=False)
class Best:
    """The best results so far, updated in place: displacements (n, d) [m] and tensions (n, m) [N].

    ``loose`` (n, d) [m] is the nearest unstable pose, infinite if there is none.
    """

    problem: NearestProblem
    away: Array
    tensions: Array
    found: NDArray[np.bool_]
    stable: NDArray[np.bool_]
    loose: Array

    @classmethod
    def none(cls, problem: NearestProblem) -> Best:
        n = len(problem.wanted)
        away, tensions = np.zeros((n, problem.robot.n_dof)), np.zeros(problem.least.shape)
        loose = np.full(away.shape, np.inf)
        return cls(problem, away, tensions, np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), loose)

    def search(self, candidates: Candidates, most: int) -> None:
        """Search from the best candidates, ``most`` of each row."""
        for lot in candidates.in_lots(_AT_ONCE):
            spots = prune_starts(self.problem, lot, most)
            if spots.tensions.shape[1] < self.problem.robot.n_dof:
                # few poses are held at all; from stable ones searches may go on to unstable ones
                self.keep(spots)
            self.keep(solve_sqp(self.problem, spots))

    def keep(self, other: Spots) -> None:
        """Take results that are nearer, and stable ones rather than unstable ones."""
        motion = self.problem.motion
        other = to_rounding(self.problem, other.only(other.left <= TIGHT))
        other = other.only(motion.are_allowed(other.away, other.rows))
        if len(other.rows) == 0:
            return
        stable = self.problem.rests(other.away, other.rows)
        size, own, loose = self.problem.size(other), self._far(self.away), self._far(self.loose)
        for i in np.argsort(size):
            row = other.rows[i]
            nearer = not self.found[row] or size[i] < own[row]
            if stable[i] > self.stable[row] or (stable[i] == self.stable[row] and nearer):
                self.away[row], self.tensions[row] = other.away[i], other.tensions[i]
                self.found[row], self.stable[row], own[row] = True, stable[i], size[i]
            if not stable[i] and size[i] < loose[row]:
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
        self.found[rows], self.stable[rows], self.loose[rows] = (
            other.found,
            other.stable,
            other.loose,
        )

    def stable_ones(self, places: Array) -> None:
        """The nearest stable pose where a search ended nearer but unstable."""
        size = np.where(self.stable, self._far(self.away), np.inf)
        end = self._far(self.loose)
        rows = np.flatnonzero(self.found & (end < (1.0 - _NEARER) * size))
        if len(rows) == 0:
            return
        part = self.problem.part(rows)
        away, some = nearest_of(part, stable_ends(part, places, self.loose[rows]))
        if len(some) == 0:
            return
        away = at_random(part, away, some)
        start = part.start(away, some)
        better = part.motion.far(away, some) < size[rows[some]]
        to = rows[some[better]]
        self.away[to], self.tensions[to] = away[better], start.tensions[better]
        self.stable[to] = True

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


def stable_ends(problem: NearestProblem, places: Array, ends: Array) -> Candidates:
    """Stable poses near the wanted ones, from a sample of held ones and unstable ends (n, d)."""
    first = from_sample(problem, places).and_more(about_wanted(problem))
    stable = _stable_of(problem, first.only(np.arange(0, len(first.rows), _EVERY)))
    first = Candidates(*toward(problem, stable.away, stable.rows, problem.stable))
    return first.and_more(_out_to(problem, first, ends))


def _out_to(problem: NearestProblem, stable: Candidates, ends: Array) -> Candidates:
    """Stable poses on lines from ends (n, d) to the reference and the nearest stable poses."""
    n, near = len(ends), ends.copy()
    home = problem.to(np.tile(problem.home, (n, 1)), np.arange(n))
    best, rows = nearest_of(problem, stable)
    near[rows] = best
    twice = np.tile(ends, (2, 1))
    own = np.tile(np.arange(n), 2)
    ways = problem.motion.allowed(np.concatenate([home, near]), own) - twice
    many, each = twice[:, None] + _PARTS[:, None] * ways[:, None], np.repeat(own, len(_PARTS))
    away = problem.motion.allowed(many.reshape(len(each), -1), each)
    return _stable_of(problem, Candidates(away, each))


def _stable_of(problem: NearestProblem, some: Candidates) -> Candidates:
    """Those of the candidates that are stable."""
    return some.only(problem.stable(some.away, some.rows))


def nearest_of(problem: NearestProblem, some: Candidates) -> tuple[Array, Rows]:
    """The nearest candidate (k, d) of each row that has any, and those rows (k,)."""
    order = np.lexsort((problem.motion.far(some.away, some.rows), some.rows))
    rows, place = np.unique(some.rows[order], return_index=True)
    return some.away[order[place]], rows


def at_random(problem: NearestProblem, away: Array, rows: Rows) -> Array:
    """Nearer stable poses (k, d), by rounds of random draws about those of rows (k,)."""
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
        stable = problem.stable(tries[k, j], rows[k])
        nearer = np.full(shape, np.inf)
        nearer[k[stable], j[stable]] = far[k[stable], j[stable]]
        gains = np.isfinite(nearer).any(axis=1)
        best[gains] = tries[gains, nearer.argmin(axis=1)[gains]]
        wide *= np.where(gains, _WIDER, _NARROWER)[:, None, None]
    return best
