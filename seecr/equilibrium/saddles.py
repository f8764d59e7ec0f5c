"""Barriers: the height of the lowest pass between two equilibria of one command.

The path of least energy is found by the string method (below). Its highest point is made exact by
following the one falling direction (Cerjan and Miller, J. Chem. Phys. 75, 1981), and counts if it
is the highest point of a path from one equilibrium to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.compiled.columns import EXTERNAL_MOMENT, TOLERANCE
from seecr.equilibrium.following import (
    Coordinates,
    apart_from,
    evaluated,
    moved,
    rest_below,
    step_between,
)
from seecr.errors import InputError
from seecr.pose import Array, pose_difference
from seecr.result import COORDINATES, Record, Result, named
from seecr.statics.solution import Solution, check_solution
from seecr.statics.tables import Tables, take
from seecr.units import joules

# Paths of least energy between equilibria.
#
# The string method (E, Ren and Vanden-Eijnden, J. Chem. Phys. 126, 164103, 2007): images of the
# platform are moved across the path by Newton's steps, then evenly spaced along it.

# Images on the path, most rounds, and the gradient across the path at which they end [load].
_IMAGES, _ROUNDS, _ACROSS = 33, 300, 1e-3
SOFTEST = 1e-2
"""The softest stiffness that a Newton step assumes, over the load and the robot's length."""


def strings(one: Solution, others: Solution, longest: float) -> tuple[Array, NDArray[np.bool_]]:
    """Images (b, k, 7) on paths of least energy to b other equilibria, and (b,) who settled.

    ``longest`` is the step of an image [of the gap between two].
    """
    by, count = Coordinates(one.robot), len(others)
    ends = by.of(np.concatenate([one.pose, others.pose, one.tables.poses[:1]]))
    first, commanded = ends[:1], ends[-1:]
    whole = by.between(ends[1:-1], np.repeat(first, count, axis=0))
    parts = np.linspace(0.0, 1.0, _IMAGES)[:, None] * whole[:, None]
    every = _moved(by, np.broadcast_to(first, (count, _IMAGES, first.shape[1])), parts)
    settled = np.zeros(count, dtype=bool)
    for _ in range(_ROUNDS):
        left = np.flatnonzero(~settled)
        if len(left) == 0:
            break
        every[left], settled[left] = _round(one, by, every[left], commanded, longest)
    poses = by.poses(every.reshape(-1, every.shape[2]))
    return poses.reshape(count, _IMAGES, 7), settled


def _round(
    one: Solution, by: Coordinates, images: Array, commanded: Array, longest: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Images (b, k, ...) after a step across their paths, and which of these needed none."""
    (b, k), d = images.shape[:2], one.robot.n_dof
    many = take(one.tables, np.zeros(b * k, int))
    softest = SOFTEST * float(many.scale[0]) / one.robot.length
    at = by.evaluated(many, images.reshape(b * k, -1), commanded)
    gradient = at.gradient.reshape(b, k, -1)[:, 1:-1]
    hessian = at.hessian.reshape(b, k, d, d)[:, 1:-1]
    steps = _steps_between(by, images[:, 1:], images[:, :-1])
    gap = np.linalg.norm(steps, axis=2).mean(axis=1)[:, None, None]
    along = _tangents(steps, at.energy.reshape(b, k))
    across = np.eye(d) - along[..., :, None] * along[..., None, :]
    slope = np.einsum("bnij,bnj->bni", across, gradient)
    settled = np.linalg.norm(slope, axis=2).max(axis=1) < _ACROSS * many.scale[0]
    values, vectors = np.linalg.eigh(across @ hessian @ across)
    # The slope s along the path carries the deviation n of an image on to those below: across it
    # the force is value n + s dn/dl, and with gaps h between images a step by the value alone lets
    # deviations grow by s / (value h) where the path is steep and its sides are soft. Differences
    # to the higher neighbour add s / h to the value; then the sum is what an image itself feels
    # most, and steps by it settle.
    carried = np.abs(np.sum(along * gradient, axis=2, keepdims=True)) / gap
    parts_of = np.einsum("bnij,bni->bnj", vectors, slope)
    parts_of /= np.maximum(np.abs(values) + carried, softest)
    step = -np.einsum("bnij,bnj->bni", vectors, parts_of)
    size = np.linalg.norm(step, axis=2, keepdims=True)
    step *= np.minimum(1.0, longest * gap / np.maximum(size, 1e-300))
    out = images.copy()
    out[:, 1:-1] = _moved(by, images[:, 1:-1], step)
    return np.where(settled[:, None, None], images, _evenly(by, out)), settled


def _tangents(steps: Array, energies: Array) -> Array:
    """Unit vectors (b, k - 2, d) along paths, of their steps (b, k - 1, d) and energies (b, k).

    They point from or to the higher neighbour, and on tops and in valleys in between, by the
    differences of energy (Henkelman and Jonsson, J. Chem. Phys. 113, 9978, 2000).
    """
    rise = np.nan_to_num(np.diff(energies, axis=1))
    last, next_ = rise[:, :-1], rise[:, 1:]
    top = (last > 0.0) & (next_ < 0.0)
    # where all is level, both count alike
    behind = np.where(top, -next_, np.maximum(-last, 0.0)) + 1e-300
    ahead = np.where(top, last, np.maximum(next_, 0.0)) + 1e-300
    part = (ahead / (ahead + behind))[..., None]
    along = part * steps[:, 1:] + (1.0 - part) * steps[:, :-1]
    return np.asarray(along / np.linalg.norm(along, axis=2, keepdims=True))


def _evenly(by: Coordinates, images: Array) -> Array:
    """The same paths (b, k, ...) with evenly spaced images."""
    steps = _steps_between(by, images[:, 1:], images[:, :-1])
    along = np.pad(np.cumsum(np.linalg.norm(steps, axis=2), axis=1), ((0, 0), (1, 0)))
    aim = np.linspace(0.0, along[:, -1], images.shape[1], axis=1)[:, 1:-1]
    at = np.sum(along[:, None, :] <= aim[:, :, None], axis=2) - 1
    at = np.clip(at, 0, steps.shape[1] - 1)
    row = np.arange(len(images))[:, None]
    part = (aim - along[row, at]) / np.maximum(along[row, at + 1] - along[row, at], 1e-300)
    out = images.copy()
    out[:, 1:-1] = _moved(by, images[row, at], part[..., None] * steps[row, at])
    return out


def _moved(by: Coordinates, there: Array, steps: Array) -> Array:
    """Coordinates (b, k, ...) after steps (b, k, d)."""
    flat = there.reshape(-1, there.shape[2])
    return by.moved(flat, steps.reshape(len(flat), -1)).reshape(there.shape)


def _steps_between(by: Coordinates, there: Array, before: Array) -> Array:
    """Steps (b, k, d) from coordinates ``before`` to others (b, k, ...)."""
    steps = by.between(there.reshape(-1, there.shape[2]), before.reshape(-1, there.shape[2]))
    return steps.reshape(*there.shape[:2], -1)


# Longest steps of images [of the gap between them]; each is tried where the one before did not end.
_PARTS = (0.5, 0.1)
# Points between images at which the path's energy is computed, first and then about its highest.
_FINE, _ZOOMS = 8, 3
# Steps to the saddle at most, and the longest, over the length.
_STEPS, _LONGEST = 200, (0.1, 0.01)
# Energies alike but for rounding [of load times length, and of the energy].
ROUNDING = 1e-9
# First step down from a saddle [of the length].
_ASIDE = 1e-3
# Poses nearer than this [of the length] are one equilibrium.
_ALIKE = 1e-5
_OF_MOMENT = (
    "what a moment does on a platform that turns freely depends on the way, so it has no energy"
)
_OF_CABLE = "what its cables take depends on the way, or has no formula, so they have no energy"
NO_BARRIER = "no barrier can be given"
# A platform that is turned by more than this [rad] hangs twisted among its cables.
TWISTED = 0.5 * np.pi


@dataclass(frozen=True, eq=False, repr=False)
class Barrier(Result):
    """The pass between one equilibrium and another.

    Attributes:
        energy: [J] needed to get over it from the first equilibrium. NaN, like ``back`` and
            ``pose``, if there is no potential energy, as ``Solution.energy`` says.
        back: [J] needed from the other equilibrium.
        pose: (7,) at the top.
        exact: whether the top is a saddle (balanced, with one falling direction) from which paths
            that only fall, or that stay below it, lead to both equilibria. Else it is the highest
            point of the path that was found, and the lowest path may be lower.
        twisted: whether the other is turned by more than a right angle from the first: pushes lead
            back and forth no more, cables lie across each other.
        why_not: why there is no energy; "" if there is.
    """

    energy: float
    back: float
    pose: Array
    exact: bool
    twisted: bool
    why_not: str = ""

    def as_json(self) -> Record:
        """One entry of ``barriers`` in ``pose.json``."""
        return {
            "energy_J": self.energy,
            "back_J": self.back,
            "pose": self.pose,
            "exact": self.exact,
            "twisted": self.twisted,
            "why_not": self.why_not or None,
        }

    @property
    def kind(self) -> str:
        """In a word: whether pushes lead to the other equilibrium."""
        return "twisted" if self.twisted else "reachable"

    @property
    def words(self) -> str:
        """A sentence: whether pushes lead to the other equilibrium, and the energy it takes."""
        least = "" if self.exact else "at most "
        if not np.isfinite(self.energy):
            return f"{self.kind}; {NO_BARRIER}: {self.why_not}"
        # the top of a path that was not made exact may be its end
        back = joules(self.back) if self.back > 1e-12 * self.energy else "next to nothing"
        return f"{self.kind}, {least}{joules(self.energy)} to get there, {back} back"

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

    Returns:
        one for each of the others, in their order.

    Raises:
        InputError: the equilibria belong to another command or robot, or a row is not at rest.

    Example:
        ``seecr.barriers(solution, seecr.equilibria(robot, poses[0]))``
    """
    for one in (solution, others):
        check_solution(one, "barriers: ")
    lengths = solution.rest_lengths[i]
    if others.robot.n_cables != len(lengths) or not np.allclose(others.rest_lengths, lengths):
        raise InputError("barriers: expected equilibria of one command, got other rest lengths")
    if not (solution.converged[i] and others.converged.all()):
        raise InputError("barriers: expected equilibria, got a pose that is not at rest")
    one = solution.rows([i])
    each = [_known_without_path(one, others.rows([k])) for k in range(len(others))]
    open_ones = [k for k, known in enumerate(each) if known is None]
    paths = iter(_paths(one, others.rows(open_ones))) if open_ones else iter(())
    return tuple(
        _barrier(one, others.rows([k]), next(paths)) if known is None else known
        for k, known in enumerate(each)
    )


def _is_twisted(one: Solution, other: Solution) -> bool:
    turned = np.linalg.norm(pose_difference(other.pose[0], one.pose[0])[3:])
    return bool(turned > TWISTED)


def _known_without_path(one: Solution, other: Solution) -> Barrier | None:
    """The barrier if that needs no path: without energies, and to the same equilibrium."""
    if not (np.isfinite(one.energy[0]) and np.isfinite(other.energy[0])):
        nowhere, twisted = np.full(7, np.nan), _is_twisted(one, other)
        return Barrier(np.nan, np.nan, nowhere, False, twisted, _why_no_energy(one))
    size = np.where(np.arange(6) < 3, 1.0 / one.robot.length, 1.0)
    if np.linalg.norm(size * pose_difference(other.pose, one.pose)) < _ALIKE:
        return Barrier(0.0, 0.0, one.pose[0], exact=True, twisted=False)
    return None


def _why_no_energy(one: Solution) -> str:
    """Whether it is the moment or a cable that has none."""
    tables = take(one.tables, np.zeros(1, int))
    tables.load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] = 0.0
    of_moment = np.isfinite(evaluated(one.robot, tables, one.pose).energy[0])
    return _OF_MOMENT if of_moment else _OF_CABLE


def _barrier(one: Solution, other: Solution, path: _Path) -> Barrier:
    tables, robot = one.tables, one.robot
    top, exact = _top(one, tables, path)
    height = float(evaluated(robot, tables, top).energy[0])
    own, there = float(one.energy[0]), float(other.energy[0])
    # the top is as high as both ends; only rounding puts it lower
    height = max(height, own, there)
    return Barrier(height - own, height - there, top[0], exact, _is_twisted(one, other))


@dataclass(frozen=True, eq=False)
class _Path:
    """Poses (k, 7) from one equilibrium to another, and their energies (k,) [J]."""

    poses: Array
    energies: Array

    @property
    def highest(self) -> int:
        return int(np.argmax(self.energies))


def _paths(one: Solution, others: Solution) -> list[_Path]:
    """Paths of least energy to b others, looked at closely; where none settled the lowest tried."""
    out: list[_Path | None] = [None] * len(others)
    left = list(range(len(others)))
    for part in _PARTS:
        every, settled = strings(one, others.rows(left), part)
        for k, images, done in zip(left, every, settled, strict=True):
            path, before = _closely(one, images), out[k]
            lower = before is None or path.energies.max() < before.energies.max()
            out[k] = path if done or lower else before
        left = [k for k, done in zip(left, settled, strict=True) if not done]
        if not left:
            break
    return [path for path in out if path is not None]


def _closely(one: Solution, images: Array) -> _Path:
    """Energies on the path through images (k, 7), and between those about its highest point."""
    poses = _between(one, images)
    path = _Path(poses, _energies(one, poses))
    for _ in range(_ZOOMS):
        k = path.highest
        part = slice(max(k - 1, 0), k + 2)
        poses = _between(one, path.poses[part])
        ends = path.poses[: part.start], path.poses[part.stop :]
        values = path.energies[: part.start], path.energies[part.stop :]
        path = _Path(
            np.concatenate([ends[0], poses, ends[1]]),
            np.concatenate([values[0], _energies(one, poses), values[1]]),
        )
    return path


def _between(one: Solution, poses: Array) -> Array:
    """Poses (k, 7) with more of them on the straight lines between."""
    steps = step_between(one.robot, poses[1:], poses[:-1])
    parts = np.tile(np.arange(_FINE) / _FINE, len(steps))[:, None]
    out = moved(one.robot, np.repeat(poses[:-1], _FINE, axis=0), parts * np.repeat(steps, _FINE, 0))
    return np.concatenate([out, poses[-1:]])


def _energies(one: Solution, poses: Array) -> Array:
    many = take(one.tables, np.zeros(len(poses), int))
    energies = evaluated(one.robot, many, poses).energy
    # what has no energy is no path
    return np.where(np.isfinite(energies), energies, np.inf)


def _top(one: Solution, tables: Tables, path: _Path) -> tuple[Array, bool]:
    """The saddle (1, 7) over which the path leads, and True; else its highest point."""
    highest = path.poses[[path.highest]]
    for longest in _LONGEST:
        saddle, found = _saddle(one, tables, highest, longest)
        if found and _joins(one, tables, saddle, path):
            return saddle, True
    return highest, False


def _joins(one: Solution, tables: Tables, saddle: Array, path: _Path) -> bool:
    """Whether a saddle (1, 7) is the highest point of a path between the ends.

    Both sides of it fall to the ends, or to where points of the path fall to up to which it is
    lower than the saddle.
    """
    height, energies = float(_energies(one, saddle)[0]), path.energies
    rounding = ROUNDING * (float(tables.scale[0]) * one.robot.length + abs(height))
    if max(energies[0], energies[-1]) > height + rounding or energies.max() < height - rounding:
        return False
    higher = np.flatnonzero(energies > height + rounding)
    # the last points from either end that are not higher
    last = (higher[0] - 1, higher[-1] + 1) if len(higher) else (path.highest, path.highest)
    feet = [rest_below(one.robot, tables, pose) for pose in beside(one, tables, saddle)]
    ends = [[path.poses[[0]]], [path.poses[[-1]]]]
    if _pair(one, feet, ends):
        return True
    for k, points in zip(last, ends, strict=True):
        points.append(rest_below(one.robot, tables, path.poses[[k]]))
    return _pair(one, feet, ends)


def _pair(one: Solution, feet: list[Array], ends: list[list[Array]]) -> bool:
    """Whether one foot is among the points of the first end, and the other among the second's."""
    return any(
        _among(one, first, ends[0]) and _among(one, second, ends[1])
        for first, second in (feet, feet[::-1])
    )


def beside(one: Solution, tables: Tables, saddle: Array) -> tuple[Array, Array]:
    """Poses (1, 7) beside a saddle, on either side of it along its falling direction."""
    direction = np.linalg.eigh(evaluated(one.robot, tables, saddle).hessian[0])[1][:, :1].T
    step = _ASIDE * one.robot.length * direction
    return moved(one.robot, saddle, step), moved(one.robot, saddle, -step)


def _among(one: Solution, pose: Array, others: list[Array]) -> bool:
    return any(apart_from(one.robot, pose, other) < _ALIKE * one.robot.length for other in others)


def _saddle(one: Solution, tables: Tables, pose: Array, longest: float) -> tuple[Array, bool]:
    """The saddle (1, 7) that is reached from near it: up the softest direction, down all others."""
    robot = one.robot
    softest = SOFTEST * float(tables.scale[0]) / robot.length
    for _ in range(_STEPS):
        at = evaluated(robot, tables, pose)
        if not np.isfinite(at.hessian).all():
            return pose, False
        values, vectors = np.linalg.eigh(at.hessian[0])
        if at.residual[0] < TOLERANCE:
            # of a platform on one joint there is no other direction
            return pose, bool(values[0] < 0.0 and np.all(values[1:] > 0.0))
        parts = vectors.T @ at.gradient[0] / np.maximum(np.abs(values), 1e-6 * softest)
        parts[0] = -parts[0]
        size = np.linalg.norm(parts)
        parts *= min(1.0, longest * robot.length / size)
        pose = moved(robot, pose, -(vectors @ parts)[None])
    return pose, False
