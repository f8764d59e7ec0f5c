"""Cables that are strained very much: most likely a mistake in units, of a robot or a command."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import STRAIN
from seecr.counted import some
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.pose import Array
from seecr.statics.solution import Solution

__all__ = ["strained", "strained_rows"]

# Twice the strain up to which ``correct`` seeks poses where no highest tension is given.
_ODD = 0.1
_MOST_NAMES = 2


def strained(robot: Robot) -> tuple[str, ...]:
    """A sentence about cables that are strained by a tenth or more, if any are."""
    strains = _strains(robot)
    odd = np.flatnonzero(strains >= _ODD)
    if len(odd) == 0:
        return ()
    return (
        f"{_who(robot, odd)}{_by(strains.max())} at the reference pose, which is much for a rope: "
        "is springlength about the distance of the sites [m], are stiffness in N/m and mass in kg?",
    )


def strained_rows(solution: Solution) -> tuple[str, ...]:
    """The same about the row with the largest strain, where the robot itself has no such note.

    Rows that do not rest do not count.
    """
    known = np.isfinite(solution.tensions).all(axis=1)
    robot, rests = solution.robot, np.flatnonzero(solution.converged & known)
    strains = solution.evaluation.states[rests, :, STRAIN]
    if not np.any(strains >= _ODD) or strained(robot):
        return ()
    at = int(np.argmax(strains.max(axis=1)))
    alone = len(solution) == 1 and solution.line is None
    where = "where the platform rests" if alone else f"at {solution.place(rests[at])}"
    return (
        f"{_who(robot, np.flatnonzero(strains[at] >= _ODD))}{_by(strains[at].max())} {where}, "
        "which is much for a rope: are commands in m, and loads in N?",
    )


def _who(robot: Robot, odd: NDArray[np.intp]) -> str:
    """The start of a sentence about cables with large strains."""
    names = some([robot.cable_names[k] for k in odd], _MOST_NAMES)
    verb, upto = ("is", "") if len(odd) == 1 else ("are", "up to ")
    return f"{robot.source or robot.name}: {names} {verb} strained by {upto}"


def _by(strain: float) -> str:
    return f"{100.0 * strain:.3g} %"


def _strains(robot: Robot) -> Array:
    """Strains (m,) at the reference pose as it is drawn, or where the platform rests if larger.

    A hanging platform that is drawn too low rises until its cables are not strained.
    """
    drawn = robot.reference_lengths / robot.rest_lengths - 1.0
    home = solve(robot, robot.reference_pose)
    if not home.converged[0]:
        return np.asarray(drawn)
    return np.asarray(np.maximum(drawn, home.tensions[0] / robot.ea))
