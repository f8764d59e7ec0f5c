"""What measured tensions hold together, whatever else the model lacks.

Wrong stiffnesses, lengths and pretensions shift tensions between cables, but not their resultant,
which balances the load.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import TENSION, Problem
from seecr.pose import Array
from seecr.prediction.experiment import Prediction
from seecr.workspace.zones import balance_equations

# Where cables mostly pull against each other, small errors of direction outweigh what they hold.
_LEAST_HELD = 0.03


@dataclass(frozen=True, eq=False)
class Pulls:
    """Measured and predicted tensions, and what they hold along the platform's coordinates.

    Attributes:
        problem: the data. at: what the model as it stands predicts.
    """

    problem: Problem
    at: Prediction

    @cached_property
    def matrix(self) -> Array:
        """(n, d, m) forces per tension at the predicted poses, torques over the robot's length."""
        pose = np.where(self.at.solved[:, None], self.at.pose, self.problem.robot.reference_pose)
        return balance_equations(self.problem.robot, pose)[0]

    @cached_property
    def read(self) -> NDArray[np.bool_]:
        """(n, m) tensions that were read and that the model predicts."""
        counted: NDArray[np.bool_] = self.problem.counted[:, TENSION] & self.at.solved[:, None]
        return counted & np.isfinite(self.at.readings.tensions)

    @cached_property
    def measured(self) -> Array:
        """(n, m) [N], 0 where not read."""
        return np.where(self.read, self.problem.data.tensions, 0.0)

    @cached_property
    def expected(self) -> Array:
        """(n, m) [N], as predicted; 0 where not read."""
        return np.where(self.read, self.at.readings.tensions, 0.0)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(n,) rows in which all cables were read: what an unread one holds is not known."""
        return np.asarray(self.read.all(axis=1))

    def held(self, tensions: Array) -> Array:
        """The resultant (n, d) [N] of tensions (n, m)."""
        return np.asarray((self.matrix @ tensions[..., None])[..., 0])

    def carried(self) -> Array:
        """Part (n,) of the load that the measured tensions hold; NaN where it is not known.

        Without pretension balance alone fixes every tension, and any of them tells.
        """
        total = self.expected.sum(axis=1)
        if self.problem.robot.n_cables <= self.problem.robot.n_dof:
            return _part(self.measured.sum(axis=1), total, total > 0.0)
        force = self.held(self.expected)
        size = np.linalg.norm(force, axis=1)
        there = (self.held(self.measured) * force).sum(axis=1)
        return _part(there, size**2, self.whole & (size > _LEAST_HELD * total))


def _part(some: Array, whole: Array, known: NDArray[np.bool_]) -> Array:
    return np.where(known, some / np.where(known, whole, 1.0), np.nan)
