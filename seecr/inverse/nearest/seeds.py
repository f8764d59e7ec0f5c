"""Starting points for the nearest pose: samples of the workspace, and rotations about others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from seecr.description.joints import pose_of_values
from seecr.description.robot import Robot
from seecr.inverse.nearest.motion import PlatformMotion
from seecr.inverse.nearest.problem import Reaching, Rows
from seecr.pose import Array, quat_from_rotvec

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


@dataclass(frozen=True, eq=False)
class Candidates:
    """Displacements (k, d) from the wanted poses of rows (k,), held or not."""

    away: Array
    rows: Rows

    def and_more(self, other: Candidates) -> Candidates:
        return Candidates(
            np.concatenate([self.away, other.away]), np.concatenate([self.rows, other.rows])
        )

    def in_lots(self, count: int) -> Iterator[Candidates]:
        """The same, those of ``count`` rows at a time."""
        lots = np.searchsorted(np.unique(self.rows), self.rows) // count
        for lot in range(lots.max(initial=-1) + 1):
            yield Candidates(self.away[lots == lot], self.rows[lots == lot])


def sample(problem: Reaching) -> Array:
    """Coordinates (k, 7) or (k, d) of the reference pose, and of poses that can be held.

    They can be held under the first row's load. Only the reference pose if positions are kept,
    since the others are at other positions.
    """
    if problem.is_in_place:
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
    """Values of a platform's joints: the origin over the box, hinges at all angles.

    Slides are drawn as if the platform did not turn, and then follow it where it does.
    """
    values, box = np.zeros((_SAMPLE, robot.n_dof)), _box(robot) - robot.reference_pose[:3]
    for i, joint in enumerate(robot.joints):
        along = box @ joint.axis
        slides = joint.kind == "slide"
        low, high = (along.min(), along.max()) if slides else (-np.pi, np.pi)
        values[:, i] = random.uniform(low, high, _SAMPLE)
    sliding, metre = ~robot.hinges, np.where(robot.hinges, robot.length, 1.0)
    axes = np.array([joint.axis for joint in robot.joints])
    at_home = PlatformMotion.about(robot, *_home_of(robot), False)
    rows, places = np.zeros(_SAMPLE, dtype=np.intp), values[:, sliding] @ axes[sliding]
    return at_home.brought(values * metre, rows, places) / metre


def _home_of(robot: Robot) -> tuple[Array, Array]:
    """The reference pose (1, 7), and the joints there (1, d, 7)."""
    return pose_of_values(robot, np.zeros((1, robot.n_dof)))


def from_sample(problem: Reaching, places: Array) -> Candidates:
    """The reference pose, the poses nearest to each wanted one, and as many others."""
    random, out, rows = np.random.default_rng(1), [], []
    in_place = problem.is_in_place
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


def _in_place(problem: Reaching, row: int) -> Array:
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


def about_wanted(problem: Reaching) -> Candidates:
    """Rotated poses about the wanted ones, or about the nearest point of the box."""
    n, box = len(problem.wanted), _box(problem.robot)
    middle = np.zeros((n, problem.robot.n_dof))
    if problem.values is None:
        place = problem.wanted[:, :3]
        middle[:, :3] = np.clip(place, box.min(axis=0), box.max(axis=0)) - place
    rows, widest = np.arange(n), np.full(n, np.pi)
    return _about(problem, middle, rows, widest, _TURNED, np.random.default_rng(2))


def about_answers(problem: Reaching, away: Array, rows: Rows) -> Candidates:
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
    problem: Reaching,
    middle: Array,
    rows: Rows,
    widest: Array,
    count: int,
    random: np.random.Generator,
) -> Candidates:
    """Poses (k, d) of rows, rotated by up to ``widest`` (k,), half of them moved inward.

    Small rotations are more frequent than large ones. Two more keep the position, one of them with
    the reference orientation.
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
