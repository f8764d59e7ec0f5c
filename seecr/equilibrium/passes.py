"""Barriers: the height of the lowest pass between two equilibria of one command.

The path of least energy is found by the string method (E, Ren and Vanden-Eijnden, J. Chem. Phys.
126, 164103, 2007), with Newton steps of its images across the path. From its highest image the
saddle is found by following the one direction of negative curvature uphill (Cerjan and Miller, J.
Chem. Phys. 75, 1981).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seecr.compiled.outcomes import TOLERANCE
from seecr.equilibrium.following import evaluated, moved, step_between
from seecr.errors import InputError
from seecr.pose import Array, pose_difference
from seecr.result import COORDINATES, Record, Result, named
from seecr.statics.solution import Solution
from seecr.statics.tables import Tables, take
from seecr.units import joules

__all__ = ["Barrier", "barriers"]

# Images on the path, most rounds, and the gradient across the path at which they end [load].
_IMAGES, _ROUNDS, _ACROSS = 33, 300, 1e-3
# Most steps to the saddle, the longest [length], and the softest stiffness [load over length].
_STEPS, _LONGEST, _SOFTEST = 200, 0.1, 1e-2
# Poses closer than this, in parts of the robot's length, are one equilibrium.
_ALIKE = 1e-5
# A platform that is turned by more than this [rad] hangs twisted among its cables.
TWISTED = 0.5 * np.pi


@dataclass(frozen=True, eq=False, repr=False)
class Barrier(Result):
    """The pass between one equilibrium and another.

    Attributes:
        energy: [J] needed to get over it from the first equilibrium. NaN, like ``back`` and
            ``pose``, if there is no potential energy: under a moment, or with a cable law that has
                none.
        back: [J] needed from the other equilibrium.
        pose: (7,) at the top.
        exact: whether the top is a saddle: an equilibrium with one direction of negative curvature.
            Otherwise it is the highest point of the path that was found, and a lower path may
            exist.
        twisted: whether the other equilibrium is turned by more than a right angle from the first:
            its cables cross each other, and pushes do not lead back and forth.
    """

    energy: float
    back: float
    pose: Array
    exact: bool
    twisted: bool

    def as_json(self) -> Record:
        """One entry of ``barriers`` in ``pose.json``."""
        return {
            "energy_J": self.energy,
            "back_J": self.back,
            "pose": self.pose,
            "exact": self.exact,
            "twisted": self.twisted,
        }

    @property
    def words(self) -> str:
        """A sentence: whether pushes lead to the other equilibrium, and the energy it takes."""
        least = "" if self.exact else "at most "
        twisted = "twisted" if self.twisted else "reachable"
        if not np.isfinite(self.energy):
            return f"{twisted}; no barrier can be given: this load or law has no energy"
        # if the saddle was not found, the top may be the end of the path but for rounding
        back = joules(self.back) if self.back > 1e-12 * self.energy else "next to nothing"
        return f"{twisted}, {least}{joules(self.energy)} to get there, {back} back"

    def lines(self) -> list[str]:
        """One line: ``words``."""
        return [self.words]

    def records(self) -> Sequence[Record]:
        """One row: the energies and the pose at the top."""
        return [
            {
                "energy_J": float(self.energy),
                "back_J": float(self.back),
                **named("{}", COORDINATES, self.pose),
                "exact": self.exact,
                "twisted": self.twisted,
            }
        ]


def barriers(solution: Solution, others: Solution, i: int = 0) -> tuple[Barrier, ...]:
    """The barriers from the equilibrium of a command to each of its other equilibria.

    Args:
        solution: the equilibria of the commands.
        others: the equilibria of command i, as :func:`seecr.equilibria` returns them. If the one in
            ``solution`` is among them, its barrier is zero.
        i: which of the commands.

    Raises:
        InputError: the equilibria belong to another command or robot, or a row is not at rest.
    """
    lengths = solution.rest_lengths[i]
    if others.robot.n_cables != len(lengths) or not np.allclose(others.rest_lengths, lengths):
        raise InputError("barriers: expected equilibria of one command, got other rest lengths")
    if not (solution.converged[i] and others.converged.all()):
        raise InputError("barriers: expected equilibria, got a pose that is not at rest")
    return tuple(_barrier(solution.rows([i]), others.rows([k])) for k in range(len(others)))


def _barrier(one: Solution, other: Solution) -> Barrier:
    tables, robot = one.tables, one.robot
    turned = np.linalg.norm(pose_difference(other.pose[0], one.pose[0])[3:])
    twisted = bool(turned > TWISTED)
    if not (np.isfinite(one.energy[0]) and np.isfinite(other.energy[0])):
        return Barrier(np.nan, np.nan, np.full(7, np.nan), exact=False, twisted=twisted)
    size = np.where(np.arange(6) < 3, 1.0 / robot.length, 1.0)
    if np.linalg.norm(size * pose_difference(other.pose, one.pose)) < _ALIKE:
        return Barrier(0.0, 0.0, one.pose[0], exact=True, twisted=False)
    images = _string(one, other)
    energies = evaluated(robot, take(tables, np.zeros(_IMAGES, int)), images).energy
    top = images[[int(np.argmax(energies))]]
    saddle, exact = _saddle(one, tables, top)
    if exact:
        top = saddle
    height = float(evaluated(robot, tables, top).energy[0])
    own, there = float(one.energy[0]), float(other.energy[0])
    return Barrier(height - own, height - there, top[0], exact, twisted)


def _string(one: Solution, other: Solution) -> Array:
    """Images (k, 7) on the path of least energy between two equilibria, which are its ends."""
    robot, many = one.robot, take(one.tables, np.zeros(_IMAGES, int))
    softest = _SOFTEST * float(many.scale[0]) / robot.length
    whole = step_between(robot, other.pose, one.pose)
    parts = np.linspace(0.0, 1.0, _IMAGES)[:, None]
    images = moved(robot, np.repeat(one.pose, _IMAGES, axis=0), parts * whole)
    for _ in range(_ROUNDS):
        at = evaluated(robot, many, images)
        way = step_between(robot, images[2:], images[:-2])
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        across = np.eye(robot.n_dof) - way[:, :, None] * way[:, None, :]
        slope = np.einsum("nij,nj->ni", across, at.gradient[1:-1])
        if np.linalg.norm(slope, axis=1).max() < _ACROSS * many.scale[0]:
            break
        values, vectors = np.linalg.eigh(across @ at.hessian[1:-1] @ across)
        parts_of = np.einsum("nij,ni->nj", vectors, slope) / np.maximum(np.abs(values), softest)
        step = -np.einsum("nij,nj->ni", vectors, parts_of)
        gap = np.linalg.norm(step_between(robot, images[1:], images[:-1]), axis=1).mean()
        size = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1.0, 0.5 * gap / np.maximum(size, 1e-300))
        images[1:-1] = moved(robot, images[1:-1], step)
        images = _evenly(one, images)
    return images


def _evenly(one: Solution, images: Array) -> Array:
    """The same path with evenly spaced images."""
    steps = step_between(one.robot, images[1:], images[:-1])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    aim = np.linspace(0.0, along[-1], len(images))[1:-1]
    at = np.clip(np.searchsorted(along, aim, side="right") - 1, 0, len(steps) - 1)
    part = (aim - along[at]) / np.maximum(along[at + 1] - along[at], 1e-300)
    out = images.copy()
    out[1:-1] = moved(one.robot, images[at], part[:, None] * steps[at])
    return out


def _saddle(one: Solution, tables: Tables, pose: Array) -> tuple[Array, bool]:
    """The saddle (1, 7) near a pose, and whether it was found.

    Newton steps go uphill along the softest direction and downhill along all others.
    """
    robot = one.robot
    softest = _SOFTEST * float(tables.scale[0]) / robot.length
    for _ in range(_STEPS):
        at = evaluated(robot, tables, pose)
        if not np.isfinite(at.hessian).all():
            return pose, False
        values, vectors = np.linalg.eigh(at.hessian[0])
        if at.residual[0] < TOLERANCE:
            return pose, bool(values[0] < 0.0 < values[1])
        parts = vectors.T @ at.gradient[0] / np.maximum(np.abs(values), 1e-6 * softest)
        parts[0] = -parts[0]
        size = np.linalg.norm(parts)
        parts *= min(1.0, _LONGEST * robot.length / size)
        pose = moved(robot, pose, -(vectors @ parts)[None])
    return pose, False
