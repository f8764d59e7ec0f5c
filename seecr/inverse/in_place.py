"""Positions that can be held in some orientation, for robots with fewer cables than freedoms.

The orientation that holds changes little from one position to the next. So searches from many
orientations are made for a few positions, and the others start from their neighbours' results. What
is found first is in balance with straight cables; see :mod:`seecr.compiled.orientation`. With sag,
pulleys or exit points that lift, that is where searches start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import LIFT, RADIUS, WEIGHT
from seecr.description.joints import freedoms
from seecr.description.robot import Robot
from seecr.inverse.nearest import Best, any_that_stays
from seecr.inverse.nearest_problem import NearestProblem, Rows
from seecr.inverse.nearest_sqp import tightened
from seecr.pose import Array, quat_conjugate, quat_from_rotvec, quat_multiply
from seecr.statics import batch
from seecr.statics.tables import Tables, by_row

# Nearest positions whose results are tried, and how many full searches are made at once.
_NEAREST, _AT_ONCE = 3, 8
# Neighbours of a position.
_NEIGHBOURS = 8
# Part of the remaining positions that get full searches at once, and no fewer than so many.
_PART, _FEWEST = 8, 16
# Orientations that a full search starts from, at the edge of what was found, and of these those
# about the vertical.
_STARTS, _MORE, _ABOUT = 24, 100, 4
# Tilts of a platform that turns about one axis: a bar on two cables has at most four equilibria.
_TILTS = 8


def poses_in_place(
    problem: NearestProblem, tables: Tables, thorough: bool = True
) -> tuple[Array, NDArray[np.bool_]]:
    """Stable poses (n, 7) at the wanted positions, and (n,) whether one was found.

    Full searches, where no straight cable and no neighbour leads to one, are for ``thorough`` ones.
    """
    turned = turned_in_place(problem.robot, tables, problem.least, problem.most)
    straight = not np.any(tables.cables[..., [RADIUS, WEIGHT, LIFT]])
    if straight and problem.robot.all_driven:  # what passive lines pull changes as it turns
        return turned.poses, turned.found
    best, rows = Best.none(problem), np.arange(len(problem.wanted))
    _try_all(best, np.zeros((len(rows), problem.robot.n_dof)), rows)
    # those of straight cables without pulleys are near
    some = rows[turned.found & ~best.stable]
    _try_all(best, problem.to(problem.coordinates(turned.poses[some]), some), some)
    left, fresh = ~best.stable, np.flatnonzero(best.stable)
    while left.any():
        if len(fresh):
            fresh = _from_neighbours(best, np.flatnonzero(left), fresh)
        elif not thorough:
            break
        else:
            some = _evenly(np.flatnonzero(left), _AT_ONCE)
            best.take(some, any_that_stays(problem.part(some)))
            left[some], fresh = False, some[best.stable[some]]
        left &= ~best.stable
    return problem.placed(best.away, rows), best.stable


def _try_all(best: Best, away: Array, rows: Rows) -> None:
    """Keep what reaches balance from displacements (k, d) of rows, without those of positions."""
    away = best.problem.motion.allowed(away, rows)
    best.keep(tightened(best.problem, best.problem.start(away, rows)))


def _evenly(rows: Rows, many: int) -> Rows:
    """At most so many of the rows, evenly spread in their order."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, many).round().astype(np.intp))]


def _from_neighbours(best: Best, rows: Rows, fresh: Rows) -> Rows:
    """Try the results at the nearest fresh positions; returns the rows that were solved by it."""
    from scipy.spatial import cKDTree  # takes a while to import

    problem, place = best.problem, best.problem.wanted[:, :3]
    near = cKDTree(place[fresh]).query(place[rows], k=min(_NEAREST, len(fresh)))[1]
    near = near.reshape(len(rows), -1)
    each, of = np.repeat(rows, near.shape[1]), fresh[near.ravel()]
    turned = problem.to(problem.moved(best.away[of], of), each)
    _try_all(best, turned, each)
    return rows[best.stable[rows]]


@dataclass(frozen=True, eq=False)
class Turned:
    """Orientations for n positions: deviations (n, 7) from the tables, joint values (n, d).

    ``margins`` (n,) [N] are those of all tensions; minus infinity if no orientation was found.
    """

    robot: Robot
    tables: Tables
    low: Array
    high: Array
    deviation: Array
    values: Array
    margins: Array

    @property
    def found(self) -> NDArray[np.bool_]:
        """(n,) whether some orientation holds the position."""
        return np.asarray(self.margins > -np.inf)

    @property
    def poses(self) -> Array:
        """(n, 7), those of the tables where none was found."""
        return batch.platform_poses(self.tables, self.deviation)

    def search(self, rows: Rows, starts: tuple[Array, Array], *, farther: bool = False) -> None:
        """Search from deviations (k, s, 7) and joint values (k, s, d) of rows (k,).

        ``farther``: try all starts, and turn on to where tensions are farther inside.
        """
        from seecr.compiled.orientation import turn_batch  # takes a while to import

        tables, part = self.tables, [self.deviation[rows], self.values[rows], self.margins[rows]]
        by_row(
            turn_batch, tables.cables[rows], tables.load[rows], tables.poses[rows],
            tables.screws[rows], freedoms(self.robot)[1], tables.length, tables.scale[rows],
            self.low[rows], self.high[rows], *(np.array(one, order="C") for one in starts), farther,
            *part,
        )  # fmt: skip
        self.deviation[rows], self.values[rows], self.margins[rows] = part


def turned_in_place(robot: Robot, tables: Tables, low: Array, high: Array) -> Turned:
    """Orientations that hold the positions of tables with tensions within limits (n, m) [N]."""
    n, home = len(tables), batch.Evaluation.empty(len(tables), robot.n_cables, robot.n_dof)
    out = Turned(robot, tables, low, high, home.deviation, home.values, np.full(n, -np.inf))
    out.search(np.arange(n), (home.deviation[:, None].copy(), home.values[:, None].copy()))
    turns = freedoms(robot)[1]
    if turns == 0:
        return out
    near = _neighbours(tables.poses[:, :3])
    _spread(out, near, np.flatnonzero(out.found))
    tilts = turns == 1  # several may hold, and some hold from few starts
    _search_all(out, near, np.ones(n, dtype=bool), _MORE if tilts else _STARTS)
    if tilts:  # the best one counts
        some = np.flatnonzero(out.found)
        out.search(some, _many_starts(out, some, _TILTS), farther=True)
    _improve(out, near[:, :0])
    _spread(out, near, np.flatnonzero(out.found))  # again, from farther inside
    if robot.n_driven + turns > robot.n_dof + 1:
        # each orientation is one of many, and some of these are cut off by the limits
        _search_all(out, near, np.any(out.found[near], axis=1), _MORE)
    _improve(out, near)
    return out


def _search_all(out: Turned, near: Rows, asked: NDArray[np.bool_], count: int) -> None:
    """Search from many orientations at those asked for (n,) that are left, a few at once."""
    tried = out.found | ~asked
    while True:
        left = np.flatnonzero(~(tried | out.found))
        if len(left) == 0:
            return
        some = _evenly(left, max(_FEWEST, len(left) // _PART))
        out.search(some, _many_starts(out, some, count))
        tried[some] = True
        _spread(out, near, some[out.found[some]])


def _neighbours(places: Array) -> Rows:
    """(n, k) the nearest other positions of each."""
    from scipy.spatial import cKDTree  # takes a while to import

    count = min(_NEIGHBOURS + 1, len(places))
    near = cKDTree(places).query(places, k=count)[1].reshape(len(places), -1)
    return np.asarray(near[:, 1:], dtype=np.intp)


def _spread(out: Turned, near: Rows, fresh: Rows) -> None:
    """Start the neighbours of fresh results from these, and their neighbours, until none is left.

    Each row tries each of its neighbours at most once, when that has just been solved.
    """
    while len(fresh):
        new = np.zeros(len(near), dtype=bool)
        new[fresh] = True
        row, k = np.nonzero(new[near] & ~out.found[:, None])
        for number in range(near.shape[1]):
            some = (k == number) & ~out.found[row]
            if np.any(some):
                out.search(row[some], _starts_of(out, near[row[some], k[some]][:, None], row[some]))
        fresh = np.unique(row[out.found[row]])


def _improve(out: Turned, near: Rows) -> None:
    """Turn rows on to where tensions are farther inside, from their best neighbours if any."""
    own = np.arange(len(near))
    every = np.concatenate([own[:, None], near], axis=1)
    best = every[own, np.argmax(out.margins[every], axis=1)]
    rows = np.flatnonzero(out.found & ((best != own) | (near.shape[1] == 0)))
    out.search(rows, _starts_of(out, best[rows, None], rows), farther=True)


def _starts_of(out: Turned, others: Rows, rows: Rows) -> tuple[Array, Array]:
    """The orientations of other rows (k, s) as deviations and joint values for rows (k,)."""
    deviation = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (*others.shape, 1))
    tables = out.tables
    if out.robot.joints:
        return deviation, out.values[others]
    values = np.zeros((*others.shape, out.values.shape[1]))
    turn = quat_multiply(out.deviation[others, 3:], tables.poses[others, 3:])
    back = np.broadcast_to(quat_conjugate(tables.poses[rows, 3:])[:, None], turn.shape)
    deviation[..., 3:] = quat_multiply(turn, back)
    return deviation, values


def _many_starts(out: Turned, rows: Rows, count: int) -> tuple[Array, Array]:
    """For each of rows (k,): orientations about the vertical, and random ones, ``count`` in all."""
    robot, random = out.robot, np.random.default_rng(count)
    deviation = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(rows), count, 1))
    values = np.zeros((len(rows), count, out.values.shape[1]))
    if robot.joints:
        hinges = np.flatnonzero(robot.hinges)
        spread = np.linspace(-np.pi, np.pi, count, endpoint=False)
        every = np.stack([random.permutation(spread) for _ in hinges], axis=1)
        values[..., hinges] = robot.length * every
        return deviation, values
    about = 2.0 * np.pi / _ABOUT * np.arange(_ABOUT)[:, None] * robot.up
    turn = random.normal(size=(count - _ABOUT, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    home = np.broadcast_to(robot.reference_pose[3:], (_ABOUT, 4))
    turn = np.concatenate([quat_multiply(quat_from_rotvec(about), home), turn])
    back = quat_conjugate(out.tables.poses[rows, 3:])[:, None]
    both = np.broadcast_shapes(back.shape, turn[None].shape)
    deviation[..., 3:] = quat_multiply(np.broadcast_to(turn, both), np.broadcast_to(back, both))
    return deviation, values
