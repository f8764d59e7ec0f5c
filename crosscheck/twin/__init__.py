"""Measurements with MuJoCo as the truth: a robot that really has its effects.

An effect's physics is built by MuJoCo's own means where it has them: pulleys as wrapped
cylinders on swivels, weight of cables as chains of point masses, polynomial tendons, exit
points on springs, elastic cable behind the exit point as a spring that the winch pulls on.
Shared with seecr are the effects' names and parameters and the robot's numbers, no physics.

What MuJoCo has no law for is added cable by cable, between settlings, until MuJoCo's own
equilibrium holds with it: hysteresis, creep and friction (see :mod:`crosscheck.twin.springs`).
"""

from __future__ import annotations

from crosscheck.twin.answer import unseal
from crosscheck.twin.make import FILES, Twin, make_twin

__all__ = ["FILES", "Twin", "make_twin", "unseal"]
