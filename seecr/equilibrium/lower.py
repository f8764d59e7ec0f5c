"""Lower equilibria beside those of many commands, found by a few starts for each.

With straight elastic cables the energy is convex in the platform's position: a length is, and so
is the square of what it exceeds the cable's own by. So each orientation has one best position, and
another equilibrium is turned against the first. Starts are turned, too. Descents from so far away
take long where cables sag or run over pulleys. So the search is for straight ones, and what it
finds is solved as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.description.robot import Robot
from seecr.equilibrium.following import moved
from seecr.equilibrium.saddles import ROUNDING, TWISTED, Barrier, barriers
from seecr.pose import Array, pose_difference, quat_to_matrix
from seecr.result import COORDINATES, Record, Result, named
from seecr.statics import batch
from seecr.statics.solution import Solution, certify, check_solution
from seecr.statics.starts import start_of
from seecr.statics.tables import Tables, portions, straightened, take
from seecr.units import joules, millimetres

# How far starts are turned [rad]: of all orientations within a right angle, half are nearer. The
# share of orientations within an angle a grows as a - sin a.
_TURN = 1.227


@dataclass(frozen=True, eq=False, repr=False)
class LowerEquilibria(Result):
    """Equilibria of less energy beside those of k rows of a solution.

    Attributes:
        beside: the solution of n commands.
        sought: beside how many of its rows one was sought: those at rest, with an energy.
        rows: (k,) its rows that have a lower one.
        found: the lowest that was found for each of these, k rows.
    """

    beside: Solution
    sought: int
    rows: NDArray[np.intp]
    found: Solution

    @cached_property
    def energy(self) -> Array:
        """(k,) [J] of the lower one minus that of the row: negative."""
        return np.asarray(self.found.energy - self.beside.energy[self.rows])

    @property
    def deepest(self) -> int:
        """Which of the k is lower by most."""
        return int(np.argmin(self.energy))

    @cached_property
    def barrier(self) -> Barrier:
        """What it takes to get to the deepest."""
        k = self.deepest
        return barriers(self.beside, self.found.rows([k]), int(self.rows[k]))[0]

    def lines(self) -> list[str]:
        """One line: how many rows have a lower one, and the deepest; nothing if none has."""
        if len(self.rows) == 0:
            return []
        k, row = self.deepest, int(self.rows[self.deepest])
        gap = pose_difference(self.found.pose[k], self.beside.pose[row])
        return [
            f"lower equilibria at {len(self.rows)} of {counted(len(self.beside), 'pose')} (a short "
            f"search, which may miss some); the deepest at {self.beside.place(row)}: could also "
            f"rest {millimetres(np.linalg.norm(gap[:3]))} and "
            f"{np.degrees(np.linalg.norm(gap[3:])):.4g} deg away, "
            f"{joules(self.energy[k], '+.4g')}; {self.barrier.words}"
        ]

    def records(self) -> list[Record]:
        """One row per lower equilibrium: the row it is beside, its pose, and how much lower."""
        return [
            {"row": int(row), **named("{}", COORDINATES, pose), "energy_change_J": float(energy)}
            for row, pose, energy in zip(self.rows, self.found.pose, self.energy, strict=True)
        ]

    def as_json(self) -> Record:
        """``lower`` in ``sweep.json`` and ``correction.json``: rows as in there, counted from 0."""
        any_of_them = len(self.rows) > 0
        return {
            "sought": self.sought,
            "deepest": self.rows[self.deepest] if any_of_them else None,
            "barrier": self.barrier if any_of_them else None,
            "rows": [
                {"row": row, "pose": pose, "energy_change_J": energy}
                for row, pose, energy in zip(self.rows, self.found.pose, self.energy, strict=True)
            ],
        }


def lower_equilibria(solution: Solution) -> LowerEquilibria:
    """Equilibria of less energy beside those of a solution, within a right angle of these.

    From each rest the platform is turned by 70 degrees, both ways about each of its axes or hinges,
    and solved again. This is a short search, of 6 starts a row where :func:`seecr.equilibria` makes
    2000, and may miss some.

    Args:
        solution: the equilibria of n commands. Beside rows that are not at rest, or have no energy
            as ``Solution.energy`` says, nothing is sought.

    Returns:
        the rows that have a lower one, with the lowest that was found, and the barrier to the
        deepest of all.

    Raises:
        InputError: no solution was given.

    Example:
        ``seecr.lower_equilibria(seecr.solve(robot, poses)).rows``
    """
    check_solution(solution, "lower_equilibria: ")
    robot, tables, own = solution.robot, solution.tables, solution.energy
    sought = solution.converged & np.isfinite(own) & np.isfinite(solution.pose).all(axis=1)
    most = own - ROUNDING * (tables.scale * robot.length + np.abs(own))
    start, below = np.full_like(solution.pose, np.nan), most.copy()
    for rows in portions(np.flatnonzero(sought)):
        some, poses = take(tables, rows), solution.pose[rows]
        straight = straightened(some)
        if straight is not some:  # whose energies are others
            below[rows] = np.inf
        for axis in np.flatnonzero(robot.hinges):
            for turn in (_TURN, -_TURN):
                end = _rest_from(robot, straight, _turned(robot, poses, int(axis), turn))
                lower = _are_lower(end, poses, below[rows])
                below[rows[lower]], start[rows[lower]] = end.energy[lower], end.pose[lower]
    rows = np.flatnonzero(np.isfinite(start[:, 0]))
    found = _rest_from(robot, take(tables, rows), start[rows])
    lower = _are_lower(found, solution.pose[rows], most[rows])
    return LowerEquilibria(solution, int(sought.sum()), rows[lower], found.rows(lower))


def _are_lower(found: Solution, poses: Array, below: Array) -> NDArray[np.bool_]:
    """(n,) which equilibria have less energy, and are within a right angle of poses (n, 7)."""
    turned = np.linalg.norm(pose_difference(found.pose, poses)[:, 3:], axis=1)
    return np.asarray(found.converged & (found.energy < below) & (turned < TWISTED))


def _turned(robot: Robot, poses: Array, axis: int, angle: float) -> Array:
    """Poses (n, 7) turned by an angle [rad], about a hinge or an axis of the platform's own."""
    steps = np.zeros((len(poses), robot.n_dof))
    if robot.joints:
        steps[:, axis] = angle * robot.length
    else:
        steps[:, 3:] = angle * robot.length * quat_to_matrix(poses[:, 3:])[:, :, axis - 3]
    return moved(robot, poses, steps)


def _rest_from(robot: Robot, tables: Tables, poses: Array) -> Solution:
    start, values = start_of(robot, tables, poses)
    return certify(robot, tables, batch.descend(tables, start, start_values=values))
