"""How much of the load measured tensions carry, whatever else the model lacks.

Without pretension balance alone fixes the tensions, and with it still their resultant: wrong
stiffnesses, lengths and pretensions shift tensions between cables, but not what they hold together.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.problem import TENSION, Problem
from seecr.pose import Array, transform_points

# Where cables mostly pull against each other, small errors of direction outweigh what they hold.
_LEAST_HELD = 0.03


def carried(problem: Problem, pose: Array, expected: Array) -> Array:
    """Part (n,) of the expected resultant that the measured tensions have; NaN where none is known.

    Args:
        problem: the data. pose: (n, 7) predicted poses. expected: (n, m) [N] predicted tensions.
    """
    counted = problem.counted[:, TENSION] & np.isfinite(expected)
    read = np.where(counted, problem.data.tensions, 0.0)
    expected = np.where(counted, expected, 0.0)
    total = expected.sum(axis=1)
    if problem.robot.n_cables <= problem.robot.n_dof:
        return _part(read.sum(axis=1), total, total > 0.0)
    along = problem.robot.exit_points - transform_points(pose, problem.robot.anchor_points)
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    force = (along * expected[..., None]).sum(axis=1)
    size = np.linalg.norm(force, axis=1)
    there = ((along * read[..., None]).sum(axis=1) * force).sum(axis=1)
    # what an unread cable holds is not known
    known = counted.all(axis=1) & (size > _LEAST_HELD * total)
    return _part(there, size**2, known)


def _part(some: Array, whole: Array, known: Array) -> Array:
    return np.asarray(np.where(known, some / np.where(known, whole, 1.0), np.nan))
