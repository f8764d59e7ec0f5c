"""Measurements with MuJoCo as the truth: a robot that really has its effects.

The physics of an effect is built by MuJoCo's own means if it has them: pulleys as wrapped cylinders
on swivels, cable weight as chains of point masses, polynomial tendons, exit points on springs, and
elastic cable behind the exit point as a spring that holds the winch. Shared with seecr are the
effects' names and parameters and the robot's numbers, but no physics.

Laws that MuJoCo does not have are added cable by cable, between settlings, until MuJoCo's own
equilibrium is consistent with them: hysteresis, creep and friction
(:mod:`crosscheck.twin.build`).
"""

from __future__ import annotations

from crosscheck.twin.hidden import unseal
from crosscheck.twin.make import FILES, Twin, make_twin

__all__ = ["FILES", "Twin", "make_twin", "unseal"]
