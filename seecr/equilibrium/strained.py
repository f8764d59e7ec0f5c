"""Cables that are strained very much at the reference pose: most likely a mistake in units."""

from __future__ import annotations

import numpy as np

from seecr.counted import some
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.pose import Array

__all__ = ["strained"]

# Twice the strain up to which ``correct`` seeks poses where no highest tension is given.
_ODD = 0.1
_MOST_NAMES = 2


def strained(robot: Robot) -> tuple[str, ...]:
    """A sentence about cables that are strained by a tenth or more, if any are."""
    strains = _strains(robot)
    odd = np.flatnonzero(strains >= _ODD)
    if len(odd) == 0:
        return ()
    names = some([robot.cable_names[k] for k in odd], _MOST_NAMES)
    verb, upto = ("is", "") if len(odd) == 1 else ("are", "up to ")
    return (
        f"{robot.source or robot.name}: {names} {verb} strained by {upto}"
        f"{100.0 * strains.max():.3g} % at the reference pose, which is much for a rope: is "
        "springlength about the distance of the sites [m], are stiffness in N/m and mass in kg?",
    )


def _strains(robot: Robot) -> Array:
    """Strains (m,) at the reference pose as it is drawn, or where the platform rests if larger.

    A hanging platform that is drawn too low rises until its cables are not strained.
    """
    drawn = robot.reference_lengths / robot.rest_lengths - 1.0
    home = solve(robot, robot.reference_pose)
    if not home.converged[0]:
        return np.asarray(drawn)
    return np.asarray(np.maximum(drawn, home.tensions[0] / robot.ea))
