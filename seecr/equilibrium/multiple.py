"""All stable equilibria of one command: where else it could rest with the same lengths."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.commands.data import Commands
from seecr.description.given import GivenRobot, robot_of
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.effects.checked import edit_setup
from seecr.effects.setup import Setup, plain_setup
from seecr.equilibrium.search import solve_setup
from seecr.errors import InputError
from seecr.pose import Array, pose_difference
from seecr.prediction.experiment import effects_of
from seecr.statics.solution import Solution
from seecr.statics.starts import commanded_poses

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects

# Starts at a time, and at most.
_PART, _MOST = 256, 8192
# Starts go on while one in fewer than so many may lead to a rest that nobody has met.
_RARE = 2000
# Starts fill boxes about the command from this part of the robot's size to all of it: of one large
# box half the volume lies beyond four fifths of its reach, and its middle is hardly tried.
_NEAREST = 0.2
# Poses nearer than this [of the length] are one equilibrium.
_ALIKE = 1e-5


def equilibria(
    robot: GivenRobot, pose: ArrayLike, *, effects: GivenEffects = (), most: int = _MOST
) -> Solution:
    """The stable equilibria that one command has, by energy, the lowest first.

    Descents from starts near and far, turned in every way (Sobol; Shoemake 1992 for rotations),
    until a next one is unlikely to lead to an equilibrium that nobody has met: that chance is
    about the part of the descents that led where no other did (Good, Biometrika 40, 1953). They
    end where that, one more counted, is below 1 in 2000. Whether the platform can get from one
    to another is not asked.

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
            if not _alike(found.robot, whole.pose[[k]], found.pose[i])[0]
        ]
        out.append(whole.rows(np.array(other, dtype=int)))
    return tuple(out)


def _all_rests(own: Solution, repeated: Callable[[int], Setup], most: int) -> Solution:
    """All stable equilibria of one command, from where its own search led."""
    robot, command = own.robot, own.command
    from scipy.stats import qmc  # takes a second to import

    sampler = qmc.Sobol(robot.n_dof + 1, seed=0)
    poses, starts, met = own.pose[own.converged], [own.pose[own.converged]], np.zeros(0, int)
    many = repeated(_PART)
    for done in range(0, most, _PART):
        tried = _spread(robot, command[0], sampler.random(_PART))
        found = solve_setup(many, start=tried)
        which, new = _told_apart(robot, found.pose[found.converged], poses)
        poses = np.concatenate([poses, found.pose[found.converged][new]])
        starts.append(tried[found.converged][new])
        met = np.bincount(which, minlength=len(poses)) + np.pad(met, (0, len(poses) - len(met)))
        if done + _PART >= _RARE * (1 + np.count_nonzero(met == 1)):
            break
    if len(poses) == 0:
        return own
    first = np.concatenate(starts)
    whole = solve_setup(repeated(len(first)), start=first)
    return whole.rows(np.argsort(whole.energy, kind="stable"))


def _told_apart(robot: Robot, rests: Array, known: Array) -> tuple[NDArray[np.intp], list[int]]:
    """Which equilibrium each of n rests (n, 7) is, and which of the rests are new ones.

    Those that are known come first, then the new ones in their order.
    """
    which, new = np.full(len(rests), -1), list[int]()
    for k in range(len(known)):
        which[_alike(robot, rests, known[k])] = k
    while len(left := np.flatnonzero(which < 0)):
        which[left[_alike(robot, rests[left], rests[left[0]])]] = len(known) + len(new)
        new.append(int(left[0]))
    return which, new


def _alike(robot: Robot, poses: Array, one: Array) -> NDArray[np.bool_]:
    """Which of n poses (n, 7) are the same rest as one (7,)."""
    apart = pose_difference(poses, one) * np.repeat([1.0, robot.length], 3)
    return np.asarray(np.linalg.norm(apart, axis=1) < _ALIKE * robot.length)


def _spread(robot: Robot, command: Array, unit: Array) -> Array:
    """Starts (n, 7) from numbers (n, d + 1) in [0, 1): about the command, turned in every way.

    The last number says how far about; near and far alike, so its logarithm is spread evenly.
    """
    points = np.concatenate([robot.exit_points, command[None, :3]])
    size = 0.5 * float(np.max(np.ptp(points, axis=0))) * _NEAREST ** unit[:, -1:]
    if robot.joints:
        middle = values_of_pose(robot, command[None])[0]
        reach = np.where(robot.hinges, np.pi, size)
        return pose_of_values(robot, middle + (2.0 * unit[:, :-1] - 1.0) * reach)[0]
    place = command[:3] + (2.0 * unit[:, :3] - 1.0) * size
    a, b, c = unit[:, 3], 2.0 * np.pi * unit[:, 4], 2.0 * np.pi * unit[:, 5]
    quat = np.stack([
        np.sqrt(1.0 - a) * np.sin(b), np.sqrt(1.0 - a) * np.cos(b),
        np.sqrt(a) * np.sin(c), np.sqrt(a) * np.cos(c),
    ], axis=1)  # fmt: skip
    return np.concatenate([place, quat], axis=1)
