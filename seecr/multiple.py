"""All stable equilibria of one command: where else it could rest with the same lengths."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seecr.commands import Commands
from seecr.effects.checked import edit_setup
from seecr.errors import InputError
from seecr.experiment import effects_of
from seecr.given import GivenRobot, robot_of
from seecr.joints import pose_of_values
from seecr.pose import Array, pose_difference
from seecr.robot import Robot
from seecr.search import solve_setup
from seecr.setup import Setup, plain_setup
from seecr.solution import Solution
from seecr.starts import commanded_poses

if TYPE_CHECKING:
    from seecr.model import GivenEffects

# Starts at a time, and at most.
_PART, _MOST = 256, 4096
# Poses nearer than this [of the length] are one equilibrium.
_ALIKE = 1e-5


def equilibria(
    robot: GivenRobot, pose: ArrayLike, *, effects: GivenEffects = (), most: int = _MOST
) -> Solution:
    """The stable equilibria that one command has, by energy, the lowest first.

    Descents from starts that fill position and orientation evenly (Sobol; Shoemake 1992 for
    rotations) until equilibria that nobody has met have become unlikely: Boender and Rinnooy
    Kan's rule (Mathematical Programming 37, 1987) expects fewer than w (w + 1)/(n - w - 2) more
    after n descents that led to w of them. Whether the platform can get from one to another is
    not asked.

    Args:
        robot: as described, or its MJCF.
        pose: (7,) commanded.
        effects: a model, its file, or effects with values, none of them with a memory.
        most: starts, at most.

    Returns:
        a :class:`Solution` with one row for each; the command's own search may lead to any.

    Raises:
        InputError: more than one pose, effects with a memory or a law of their own.
    """
    robot, command = robot_of(robot), commanded_poses(pose)
    if len(command) != 1:
        raise InputError(f"equilibria needs one commanded pose (7,), got {len(command)}")
    acting = effects_of(effects, robot)

    def repeated(n: int) -> Setup:
        setup = plain_setup(robot, Commands(np.repeat(command, n, axis=0)))
        for effect in acting:
            edit_setup(effect, setup)
        return setup

    one = repeated(1)
    if one.has_history or one.laws:
        raise InputError(
            "equilibria: effects with history or with a law of their own lead to one rest along "
            "their way; expected none of these"
        )
    return _all_rests(solve_setup(one), repeated, most)


def other_rests(
    found: Solution, repeated: Callable[[int, int], Setup], most: int = _MOST
) -> tuple[Solution, ...]:
    """The other stable equilibria of each of n commands, by energy; none of one without rest.

    Args:
        found: where each of them rests.
        repeated: (i, k) to a setup of k rows, all of them command i.
        most: starts for each, at most.
    """
    out = []
    for i in range(len(found)):
        whole = _all_rests(found.rows([i]), partial(repeated, i), most)
        other = [
            k
            for k in np.flatnonzero(whole.converged)
            if not _known(found.robot, whole.pose[k], found.pose[i : i + 1])
        ]
        out.append(whole.rows(np.array(other, dtype=int)))
    return tuple(out)


def _all_rests(own: Solution, repeated: Callable[[int], Setup], most: int) -> Solution:
    """All stable equilibria of one command, from where its own search led."""
    robot, command = own.robot, own.command
    from scipy.stats import qmc  # takes a second to import

    sampler = qmc.Sobol(robot.n_dof, seed=0)
    poses, starts = own.pose[own.converged], [own.pose[own.converged]]
    count, many = len(poses), repeated(_PART)
    for _ in range(0, most, _PART):
        tried = _spread(robot, command[0], sampler.random(_PART))
        found = solve_setup(many, start=tried)
        rests = found.pose[found.converged]
        count += len(rests)
        for row, start in zip(rests, tried[found.converged], strict=True):
            if not _known(robot, row, poses):
                poses = np.concatenate([poses, row[None]])
                starts.append(start[None])
        met = len(poses)
        if count > met + 2 and met * (met + 1) / (count - met - 2) < 0.05:
            break
    if len(poses) == 0:
        return own
    first = np.concatenate(starts)
    whole = solve_setup(repeated(len(first)), start=first)
    return whole.rows(np.argsort(whole.energy, kind="stable"))


def _known(robot: Robot, pose: Array, among: Array) -> bool:
    if len(among) == 0:
        return False
    apart = pose_difference(np.repeat(pose[None], len(among), axis=0), among)
    apart[:, 3:] *= robot.length
    return bool((np.linalg.norm(apart, axis=1) < _ALIKE * robot.length).any())


def _spread(robot: Robot, command: Array, unit: Array) -> Array:
    """Starts (n, 7) from numbers (n, d) in [0, 1): around the command, turned in every way."""
    points = np.concatenate([robot.exit_points, command[None, :3]])
    size = 0.5 * float(np.max(np.ptp(points, axis=0)))
    if robot.joints:
        reach = np.where(robot.hinges, np.pi, size)
        return pose_of_values(robot, (2.0 * unit - 1.0) * reach)[0]
    place = command[:3] + (2.0 * unit[:, :3] - 1.0) * size
    a, b, c = unit[:, 3], 2.0 * np.pi * unit[:, 4], 2.0 * np.pi * unit[:, 5]
    quat = np.stack([
        np.sqrt(1.0 - a) * np.sin(b), np.sqrt(1.0 - a) * np.cos(b),
        np.sqrt(a) * np.sin(c), np.sqrt(a) * np.cos(c),
    ], axis=1)  # fmt: skip
    return np.concatenate([place, quat], axis=1)
