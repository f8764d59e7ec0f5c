"""The nearest poses that can be held: many searches, of which the nearest answer is kept.

Least position^2 + (length x rotation)^2 subject to balance, W(q) tau = -w(q), and limits. What can
be held is not convex, and turned platforms reach where level ones do not: there are many local
minima, a few per cent apart. So searches begin at the wanted pose itself; where the ways from a
sample of poses that are held end to be; and at other rows' answers, those turned by all angles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.joints import values_of_pose
from seecr.nearest.inward import ENOUGH, TIGHT, inward, restored
from seecr.nearest.problem import Balance, Curved, Reaching, Rows, Spots, Stays
from seecr.nearest.screen import screened
from seecr.nearest.seeds import Candidates, about_answers, about_wanted, from_sample, sample
from seecr.pose import Array
from seecr.robot import Robot

# A pose this near to the limit is held with something to spare: tensions, relative to the load.
_INSIDE = 1e-6
# Searches of each row from the sample, and from other rows' answers.
_FIRST, _SHARED = 14, 4
# Halvings of the way home for an answer that does not stay, and of the last of these.
_PARTS, _HALVINGS = 16, 4
# A step of this part of the way, and how much of it may come nearer at a local minimum.
_PART, _FLAT = 1e-3, 1e-3


@dataclass(frozen=True, eq=False)
class Nearest:
    """What was found for n wanted poses.

    Attributes:
        poses: (n, 7). found: (n,) bool, there is one that can be held.
        settled: (n,) bool, it is a local minimum: no small change that can be held comes nearer.
    """

    poses: Array
    found: NDArray[np.bool_]
    settled: NDArray[np.bool_]


def nearest(
    robot: Robot,
    wanted: Array,
    balance: Balance,
    stays: Stays,
    low: Array,
    high: Array,
    scale: Array,
    fix_position: bool = False,
) -> Nearest:
    """The nearest poses that can be held, and whether any were found.

    Args:
        robot: as described.
        wanted: (n, 7).
        balance: what holds at a pose.
        stays: whether the platform does, exactly. Balance is linear in the tensions here, from
            where cables just pull: of heavy ones it is not quite right. An answer that does not
            stay is moved towards home until it does; where it never does it is kept.
        low, high: (m,) limits [N].
        scale: (n,) [N] load.
        fix_position: the position is kept, only the orientation gives way.
    """
    inside = _INSIDE * scale[:, None]
    least = np.minimum(low + inside, 0.5 * (low + np.minimum(high, 1e300)))
    most = np.maximum(high - inside, least)
    values = values_of_pose(robot, wanted)[0] if robot.joints else None
    free = np.full(robot.n_dof, np.inf)
    if fix_position:
        free[~robot.hinges] = 0.0
    problem = Reaching(robot, wanted, values, balance, stays, least, most, scale, free)
    best = _Best.none(problem)
    rows = np.arange(len(wanted))
    start = problem.start(np.zeros((len(wanted), robot.n_dof)), rows)
    best.keep(inward(problem, restored(problem, start).only_tight(TIGHT)))
    first = from_sample(problem, sample(problem)).and_more(about_wanted(problem))
    best.search(first, _FIRST)
    if not best.found.any():
        return Nearest(wanted.copy(), best.found, best.found.copy())
    best.search(about_answers(problem, best.away, np.flatnonzero(best.found)), _SHARED)
    settled = best.settled() & best.firm
    best.inward_to_firm()
    return Nearest(problem.placed(best.away, rows), best.found, settled)


@dataclass(frozen=True, eq=False)
class _Best:
    """The nearest answers so far, changed in place; ``firm`` (n,) bool where the platform stays."""

    problem: Reaching
    away: Array
    tensions: Array
    found: NDArray[np.bool_]
    firm: NDArray[np.bool_]

    @classmethod
    def none(cls, problem: Reaching) -> _Best:
        n = len(problem.wanted)
        away, tensions = np.zeros((n, len(problem.free))), np.zeros(problem.least.shape)
        return cls(problem, away, tensions, np.zeros(n, dtype=bool), np.zeros(n, dtype=bool))

    def search(self, candidates: Candidates, most: int) -> None:
        """Searches from the best of candidates, ``most`` of each row."""
        self.keep(inward(self.problem, screened(self.problem, candidates, most)))

    def keep(self, other: Spots) -> None:
        """Take what is held and nearer, and what stays rather than what does not."""
        other = other.only_tight(TIGHT)
        if len(other.rows) == 0:
            return
        firm = self.problem.stays(self.problem.placed(other.away, other.rows), other.rows)
        size = other.size()
        for i in np.argsort(size):
            row = other.rows[i]
            nearer = not self.found[row] or size[i] < np.linalg.norm(self.away[row])
            if firm[i] > self.firm[row] or (firm[i] == self.firm[row] and nearer):
                self.away[row], self.tensions[row] = other.away[i], other.tensions[i]
                self.found[row], self.firm[row] = True, firm[i]

    def inward_to_firm(self) -> None:
        """Answers at which the platform would not stay go towards home, by as little as will do."""
        problem, rows = self.problem, np.flatnonzero(self.found & ~self.firm)
        if len(rows) == 0:
            return
        reference = np.tile(problem.robot.reference_pose, (len(rows), 1))
        way = problem.allowed(problem.to(reference, rows) - self.away[rows])
        parts = 0.5 ** np.arange(_PARTS)
        many = (self.away[rows][:, None] + parts[:, None] * way[:, None]).reshape(-1, way.shape[1])
        each = np.repeat(rows, _PARTS)
        firm = problem.stays(problem.placed(many, each), each).reshape(-1, _PARTS)
        last = _PARTS - 1 - np.argmax(firm[:, ::-1], axis=1)
        outer = np.where(firm.any(axis=1), parts[last], 0.0)
        inner = 0.5 * outer
        for _ in range(_HALVINGS):
            middle = 0.5 * (inner + outer)
            away = self.away[rows] + middle[:, None] * way
            ok = problem.stays(problem.placed(away, rows), rows)
            outer, inner = np.where(ok, middle, outer), np.where(ok, inner, middle)
        self.away[rows] += outer[:, None] * way

    def settled(self) -> NDArray[np.bool_]:
        """(n,) whether a small step towards the wanted poses is lost on the way back to balance.

        The projected gradient: nothing but the conditions of Karush, Kuhn and Tucker.
        """
        rows: Rows = np.flatnonzero(self.found)
        away, pulls, out = self.away[rows], self.tensions[rows], self.found.copy()
        at = Curved.about(self.problem, away, pulls, rows)
        near = ((1.0 - _PART) * away, pulls)
        to, _, possible = self.problem.project(at.matrix, at.load, at.turn, away, near, rows)
        size = np.linalg.norm(away, axis=1)
        gain = np.linalg.norm(to - away, axis=1) <= _FLAT * _PART * size
        out[rows] = (possible & gain) | (size <= ENOUGH * self.problem.robot.length)
        return out
