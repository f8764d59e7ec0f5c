"""Starting points for the nearest pose: the best of samples of the workspace and rotated poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import pose_of_values
from seecr.description.robot import Robot
from seecr.inverse.nearest_problem import Holds, NearestProblem, PlatformMotion, Rows, Spots
from seecr.inverse.nearest_sqp import tightened
from seecr.pose import Array, quat_from_rotvec
from seecr.statics.tables import ByRow

# Poses sampled over the workspace; of the held ones, so many nearest and other ones per row.
_SAMPLE, _NEAR = 24000, 128
# Rotations sampled if only the orientation may change, and how many that are nearly held are kept.
_IN_PLACE, _NEARLY = 8000, 128
# Rotated poses about each wanted pose, and about each solution with as many solutions of other
# rows.
_TURNED, _ABOUT = 256, 64
# Largest rotation of half of the sample [rad], and largest part by which poses move inward.
_LEVEL, _INWARD = 1.0, 0.4
# Solutions are rotated by up to so many times their distance over the length [rad].
_WIDEST = 4.0
# Bisections towards the wanted poses; after some only the nearer half goes on, but no fewer.
_HALVINGS, _FEWER, _KEPT = 7, (2, 4), 120
# If few are held, starts are taken from this many times as many with the smallest residuals.
_LEAST = 8
# Least difference in rotation [rad] between starts, but at most the nearest's distance over the
# length. If that leaves too few, a half and then a quarter of it is enough.
_APART = (0.7, 0.35, 0.175)


@dataclass(eq=False)
class Candidates(ByRow):
    """Displacements (k, d) from the wanted poses of rows (k,), held or not."""

    away: Array
    rows: Rows

    def in_lots(self, count: int) -> Iterator[Candidates]:
        """The same, those of ``count`` rows at a time."""
        lots = np.searchsorted(np.unique(self.rows), self.rows) // count
        for lot in range(lots.max(initial=-1) + 1):
            yield self.only(lots == lot)


def sample(problem: NearestProblem) -> Array:
    """Coordinates (k, 7) or (k, d) of the reference pose, and of poses that can be held.

    They are held under the first row's load. Only the reference pose if positions are kept.
    """
    if problem.motion.is_in_place:
        return problem.home
    random = np.random.default_rng(0)
    draw = _turned if problem.values is None else _on_joints
    places = draw(problem.robot, random)
    rows = np.zeros(len(places), dtype=np.intp)
    held = problem.seems_held(problem.to(places, rows), rows)
    return np.concatenate([problem.home, places[held]])


def _box(robot: Robot) -> Array:
    """(k, 3) points whose bounding box is sampled."""
    return np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])


def _turned(robot: Robot, random: np.random.Generator) -> Array:
    """Poses of a free platform over the box, half of them in all orientations."""
    box, half = _box(robot), _SAMPLE // 2
    turn = random.normal(size=(_SAMPLE, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    axis = turn[:half, 1:] / np.linalg.norm(turn[:half, 1:], axis=1, keepdims=True)
    turn[:half] = quat_from_rotvec(axis * random.uniform(0.0, _LEVEL, (half, 1)))
    places = random.uniform(box.min(axis=0), box.max(axis=0), (_SAMPLE, 3))
    return np.concatenate([places, turn], axis=1)


def _on_joints(robot: Robot, random: np.random.Generator) -> Array:
    """Values of joints: the origin over the box, hinges at all angles, slides following."""
    values, box = np.zeros((_SAMPLE, robot.n_dof)), _box(robot) - robot.reference_pose[:3]
    for i, joint in enumerate(robot.joints):
        along = box @ joint.axis
        slides = joint.kind == "slide"
        low, high = (along.min(), along.max()) if slides else (-np.pi, np.pi)
        values[:, i] = random.uniform(low, high, _SAMPLE)
    sliding, metre = ~robot.hinges, np.where(robot.hinges, robot.length, 1.0)
    axes = np.array([joint.axis for joint in robot.joints])
    at_home = PlatformMotion.about(robot, *pose_of_values(robot, np.zeros((1, robot.n_dof))), False)
    rows, places = np.zeros(_SAMPLE, dtype=np.intp), values[:, sliding] @ axes[sliding]
    return at_home.brought(values * metre, rows, places) / metre


def from_sample(problem: NearestProblem, places: Array) -> Candidates:
    """The reference pose, the poses nearest to each wanted one, and as many others."""
    random, out, rows = np.random.default_rng(1), [], []
    in_place = problem.motion.is_in_place
    for row in range(len(problem.wanted)):
        mine = np.full(len(places), row)
        every = _in_place(problem, row) if in_place else problem.to(places, mine)
        some = min(_NEAR, len(every))
        near = np.argsort(problem.motion.far(every, np.full(len(every), row)))[:some]
        pick = np.concatenate([[0], near, random.choice(len(every), some, replace=False)])
        out.append(every[pick])
        rows.append(np.full(len(pick), row))
    each = np.concatenate(rows)
    return Candidates(problem.motion.allowed(np.concatenate(out), each), each)


def _in_place(problem: NearestProblem, row: int) -> Array:
    """The reference orientation, and sampled ones at a position that are held or nearly so (k, d).

    The orientations that hold may be less than a thousandth of all, in separate parts.
    """
    robot, random = problem.robot, np.random.default_rng(6)
    rows = np.full(_IN_PLACE, row)
    if problem.values is None:
        poses = np.repeat(problem.wanted[row][None], _IN_PLACE, axis=0)
        poses[:, 3:] = random.normal(size=(_IN_PLACE, 4))
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        every = problem.to(poses, rows)
    else:
        every = robot.length * random.uniform(-np.pi, np.pi, (_IN_PLACE, robot.n_dof))
        every[:, ~robot.hinges] = 0.0
    home = problem.to(problem.home, rows[:1])
    every = problem.motion.allowed(np.concatenate([home, every]), np.append(rows[:1], rows))
    lack, held = problem.lack(every[1:], rows)
    best = np.argsort(np.where(held, 0.0, lack))[: held.sum() + _NEARLY]
    return np.asarray(np.concatenate([every[:1], every[1:][best]]))


def about_wanted(problem: NearestProblem) -> Candidates:
    """Rotated poses about the wanted ones, or about the nearest point of the box."""
    n, box = len(problem.wanted), _box(problem.robot)
    middle = np.zeros((n, problem.robot.n_dof))
    if problem.values is None:
        place = problem.wanted[:, :3]
        middle[:, :3] = np.clip(place, box.min(axis=0), box.max(axis=0)) - place
    rows, widest = np.arange(n), np.full(n, np.pi)
    return _about(problem, middle, rows, widest, _TURNED, np.random.default_rng(2))


def about_answers(problem: NearestProblem, away: Array, rows: Rows) -> Candidates:
    """For some rows: their own solutions (n, d), rotated, and the nearest of other rows."""
    places, count = problem.moved(away[rows], rows), min(_ABOUT, len(rows))
    far = problem.motion.far(away[rows], rows) / problem.robot.length
    widest = np.minimum(_WIDEST * far, np.pi)
    own = _about(problem, away[rows], rows, widest, _ABOUT, np.random.default_rng(3))
    others = np.empty((len(rows), count, away.shape[1]))
    for k, row in enumerate(rows):
        there = problem.to(places, np.full(len(places), row))
        size = problem.motion.far(there, np.full(len(there), row))
        others[k] = there[np.argsort(size)[:count]]
    each = np.repeat(rows, count)
    shared = problem.motion.allowed(others.reshape(-1, away.shape[1]), each)
    return own.and_more(Candidates(shared, each))


def _about(
    problem: NearestProblem, middle: Array, rows: Rows, widest: Array, count: int,
    random: np.random.Generator,
) -> Candidates:  # fmt: skip
    """Poses (k, d) of rows, rotated by up to ``widest`` (k,), half of them moved inward.

    Two more keep the position, one of them with the reference orientation.
    """
    robot, hinges, motion = problem.robot, problem.robot.hinges, problem.motion
    home = problem.to(np.tile(problem.home, (len(rows), 1)), rows)
    place, inner = (motion.apart(there, rows)[:, None, :3] for there in (middle, home))
    out = np.repeat(middle[:, None], count, axis=1)
    turn = random.normal(size=(*out.shape[:2], int(hinges.sum())))
    angle = widest[:, None, None] * robot.length * random.random((*out.shape[:2], 1)) ** 2
    out[..., hinges] += angle * turn / np.maximum(np.linalg.norm(turn, axis=2, keepdims=True), 1e-9)
    part = np.maximum(_INWARD * (2.0 * random.random((*out.shape[:2], 1)) - 1.0), 0.0)
    level = np.where(hinges, home, middle)
    every = np.concatenate([out, level[:, None], middle[:, None]], axis=1)
    to = np.concatenate([place + part * (inner - place), place, place], axis=1)
    each = np.repeat(rows, every.shape[1])
    away = motion.brought(every.reshape(len(each), -1), each, to.reshape(len(each), 3))
    return Candidates(motion.allowed(away, each), each)


def prune_starts(problem: NearestProblem, candidates: Candidates, most: int) -> Spots:
    """Held poses as near to the wanted ones as straight lines lead: ``most`` per row.

    Where the balance is not linear, lines end where it really holds, and others where it seems to:
    from there balance may be found still nearer, or not at all.
    """
    spots = _pruned(problem, candidates, most, problem.held)
    if problem.holds is None:
        return spots
    return spots.and_more(_pruned(problem, candidates, most, problem.seems_held))


def _pruned(problem: NearestProblem, candidates: Candidates, most: int, fine: Holds) -> Spots:
    """The same, with one meaning of held."""
    held = fine(candidates.away, candidates.rows)
    back = _brought_back(problem, candidates, held, most)
    away = np.concatenate([candidates.away[held], back.away])
    rows = np.concatenate([candidates.rows[held], back.rows])
    away, rows = toward(problem, away, rows, fine)
    few = spread(problem, away, rows, most)
    return tightened(problem, problem.start(away[few], rows[few]))


def _brought_back(
    problem: NearestProblem, candidates: Candidates, held: NDArray[np.bool_], most: int
) -> Spots:
    """Poses brought to balance near candidates, for rows of which few candidates are held.

    Tried are those with small residuals that differ in rotation, and an even selection of all.
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


def toward(problem: NearestProblem, away: Array, rows: Rows, fine: Holds) -> tuple[Array, Rows]:
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


def spread(problem: NearestProblem, away: Array, rows: Rows, most: int) -> list[int]:
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
