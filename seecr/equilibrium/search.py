"""From a setup to certified equilibria: to one, or to all that are stable."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import whole
from seecr.commands import Commands
from seecr.compiled.columns import (
    ANCHOR,
    CONVERGED,
    SINGULAR,
    SINGULAR_PART,
    STALLED,
    TOLERANCE,
    UNSTABLE,
)
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.edits import setup_with
from seecr.effects.setup import Setup
from seecr.equilibrium.following import evaluated, moved, step_between
from seecr.errors import InputError
from seecr.pose import Array, pose_difference, quat_from_rotvec, quat_multiply, transform_points
from seecr.prediction.experiment import effects_of
from seecr.statics import batch
from seecr.statics.solution import Solution, Status, certify
from seecr.statics.starts import commanded_poses, start_of
from seecr.statics.tables import Tables, assemble, take

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects


def solve_setup(
    setup: Setup, method: str = "newton", start: Array | None = None, max_iterations: int = 400,
    threads: int | None = None,
) -> Solution:  # fmt: skip
    """Like :func:`seecr.solve`, for a setup as effects left it; its history is ignored."""
    tables = assemble(setup)
    first, values = start_of(setup.robot, tables, start)
    if method == "newton":
        found = batch.descend(tables, first, max_iterations, threads, values)
    else:
        found = solve_with_scipy(setup, tables, method, first, max_iterations, values)
    return certify(setup.robot, tables, found)


# The paper's own search: SciPy's fsolve and least_squares from its first guess (steps 4 to 10).

# Not an outcome of the compiled loop: SciPy reported that it failed.
GAVE_UP = 100


def first_guess(setup: Setup) -> Array:
    """How far [m] the platform falls at first, (n,): m g l_vmean / k_c (step 4).

    l_vmean is the mean vertical extent of the cables; the paper prints their sum.
    """
    up = setup.robot.up
    poses = setup.commands.pose
    tables = assemble(setup)
    anchors = tables.cables[0, :, ANCHOR : ANCHOR + 3]
    vertical = (setup.exit_points - transform_points(poses, anchors)) @ up
    return np.asarray(setup.weight() * vertical.mean(axis=1) / float(np.mean(setup.ea)))


def solve_with_scipy(
    setup: Setup, tables: Tables, method: str, start: Array | None, limit: int,
    start_values: Array | None = None,
) -> batch.Evaluation:  # fmt: skip
    """Solve pose by pose by SciPy; residuals are differenced, as in the paper.

    ``start`` (n, 7) are deviations to start from, ``limit`` most iterations.
    """
    found = batch.Evaluation.at_commands(tables)
    fall = first_guess(setup)
    down = -setup.robot.up
    for i in range(len(tables)):
        one = take(tables, np.array([i]))
        point = batch.Evaluation.at_commands(one)
        base = np.array([0.0, 0, 0, 1, 0, 0, 0]) if start is None else start[i]
        counter = [0]

        def residual(x: Array, one=one, point=point, base=base, counter=counter) -> Array:  # type: ignore[no-untyped-def]
            counter[0] += 1
            _place(one, point, base, x)
            return np.asarray(batch.evaluate(one, point).gradient[0] / one.scale[0])

        x0 = np.zeros(tables.n_dof)
        if start is None:
            x0 = _falling(tables, i, down * fall[i])
        elif start_values is not None:
            x0 = start_values[i].copy()
        ok, x = _search(method, residual, x0, limit)
        _place(one, point, base, x)
        found.deviation[i], found.values[i] = point.deviation[0], point.values[0]
        found.count[i] = counter[0]
        # a pose that balances is an answer, even if SciPy reports that it could not get closer
        outcome = _judge(one, point)
        found.outcome[i] = outcome if ok or outcome != STALLED else GAVE_UP
    return found


def _search(method: str, residual, x0: Array, limit: int) -> tuple[bool, Array]:  # type: ignore[no-untyped-def]
    from scipy import optimize  # takes a while to import

    with warnings.catch_warnings():
        # MINPACK warns about slow progress; its flag says the same, and that is what we report
        warnings.simplefilter("ignore", RuntimeWarning)
        if method == "fsolve":
            x, _info, flag, _text = optimize.fsolve(
                residual, x0, full_output=True, xtol=1e-13, maxfev=limit * (len(x0) + 1)
            )
            return flag == 1, x
        result = optimize.least_squares(
            residual, x0, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=limit
        )
        return bool(result.success), result.x


def _falling(tables: Tables, i: int, fall: Array) -> Array:
    """The fall as a change of the unknowns: of those joints that can follow it."""
    x = np.zeros(tables.n_dof)
    if tables.screws.shape[1] == 0:
        x[:3] = fall
        return x
    for j, screw in enumerate(tables.screws[i]):
        if screw[0] == 0.0:
            x[j] = float(screw[1:4] @ fall)
    return x


def _place(tables: Tables, point: batch.Evaluation, base: Array, x: Array) -> None:
    if tables.screws.shape[1] > 0:
        point.values[0] = x
        return
    turn = quat_from_rotvec(x[3:] / tables.length)
    point.deviation[0, :3] = base[:3] + x[:3]
    point.deviation[0, 3:] = quat_multiply(turn, base[3:])


def _judge(one: Tables, point: batch.Evaluation) -> int:
    """The outcome at the point that SciPy returned, from its residual and stiffness."""
    at = batch.evaluate(one, point)
    point.deviation[0] = at.deviation[0]
    if not at.residual[0] < TOLERANCE:
        return STALLED
    eigenvalues = np.linalg.eigvalsh(at.hessian[0])
    floor = SINGULAR_PART * np.abs(np.diag(at.hessian[0])).max()
    if eigenvalues[0] < -floor:
        return UNSTABLE
    return CONVERGED if eigenvalues[0] > floor else SINGULAR


# All stable equilibria of one command: where else the platform could rest.

# Starts per batch, and most starts in all.
_PART, _MOST = 256, 8192
# Steps to the ratio of evenly spread points: each leaves a third of the error or less.
_TO_RATIO = 40
# Starts go on until fewer than one in so many is likely to lead to a new equilibrium.
_RARE = 2000
# Starts fill boxes about the command, from this part of the robot's size up to all of it. In a
# single large box, half the volume lies beyond four fifths of its reach, and its centre is hardly
# tried.
_NEAREST = 0.2
# Poses closer than this, in parts of the robot's length, are one equilibrium.
_ALIKE = 1e-5
# Poses on the way between two, and by how little the energy changes there in units of the load
# times the robot's length, if the platform is free to go that way.
_FINE, _EVEN = 17, 1e-10


def equilibria(
    robot: GivenRobot, pose: ArrayLike, *, effects: GivenEffects = (), most: int = _MOST
) -> Solution:
    """The stable equilibria of one command, lowest energy first.

    Descents start near and far from the command, in all orientations (Roberts 2018; Shoemake 1992
    for rotations), until another one is unlikely to find a new equilibrium. The probability of that
    is about the part of the descents whose equilibrium no other descent led to (Good, Biometrika
    40, 1953). The search ends when this part, with one more counted, is below 1 in 2000. It does
    not ask whether the platform can get from one equilibrium to another.

    Args:
        robot: as described, or its MJCF.
        pose: (7,) commanded pose.
        effects: a model, its file, or effects with values; none of them may have a history.
        most: largest number of starts.

    Returns:
        a :class:`Solution` with one row per equilibrium; :func:`seecr.solve` may find any of them.

    Raises:
        InputError: more than one pose, effects with a history or a cable law of their own, or
            ``most`` is not a whole number from 1 on.

    Example:
        ``seecr.equilibria(robot, [0.4, 0.25, 0.15, 1, 0, 0, 0])``
    """
    robot = robot_of(robot)
    command = commanded_poses(pose, robot=robot)
    most = whole(most, "most", least=1)
    if len(command) != 1:
        raise InputError(f"equilibria needs one commanded pose (7,), got {len(command)}")
    acting = effects_of(effects, robot)

    def repeated(n: int) -> Setup:
        return setup_with(acting, robot, Commands(np.repeat(command, n, axis=0)))

    one = repeated(1)
    if one.has_history or one.laws:
        raise InputError(
            "equilibria: effects with history or with a law of their own lead to one rest along "
            "their way; expected none of these"
        )
    return _all_rests(solve_setup(one), repeated, most)


def on_their_way(robot: Robot, pose: ArrayLike, effects: GivenEffects) -> list[str]:
    """Names of the effects by which a command leads to one rest, on the way: see `equilibria`."""
    command = Commands(commanded_poses(pose, robot=robot))
    each = [(one.name, setup_with([one], robot, command)) for one in effects_of(effects, robot)]
    return [name for name, alone in each if alone.has_history or alone.laws]


def other_rests(found: Solution, repeated: Callable[[int, int], Setup]) -> tuple[Solution, ...]:
    """The other stable equilibria of each of n commands, lowest energy first.

    ``repeated`` (i, k) gives a setup of k rows, all of them command i.
    """
    out = []
    for i in range(len(found)):
        own = found.rows([i])
        whole = _all_rests(own, partial(repeated, i), _MOST)
        out.append(whole.rows(elsewhere(own, whole)))
    return tuple(out)


def elsewhere(own: Solution, found: Solution) -> NDArray[np.intp]:
    """Which of the equilibria found for the first command of ``own`` are not the one it is at."""
    apart = found.converged & ~_alike(own.robot, found.pose, own.pose[0])
    return np.array([k for k in np.flatnonzero(apart) if not _drifts(own, found.pose[[k]])], int)


def _drifts(own: Solution, pose: Array) -> bool:
    """Whether a platform that is free to move goes to a pose (1, 7) without gaining energy.

    Such a pose is no other equilibrium but an end of the same one, where another cable tightens.
    """
    if own.status[0] is not Status.SINGULAR:
        return False
    own = own.rows([0])
    step = step_between(own.robot, pose, own.pose)
    way = moved(own.robot, own.pose.repeat(_FINE, 0), np.linspace(0.0, 1.0, _FINE)[:, None] * step)
    energies = evaluated(own.robot, take(own.tables, np.zeros(_FINE, int)), way).energy
    return bool(np.ptp(energies) < _EVEN * own.robot.usual_load * own.robot.length)


def _all_rests(own: Solution, repeated: Callable[[int], Setup], most: int) -> Solution:
    """All stable equilibria of one command; ``own`` is the one that its own search found."""
    robot, command = own.robot, own.command
    poses, starts, met = own.pose[own.converged], [own.pose[own.converged]], np.zeros(0, int)
    many = repeated(_PART)
    for done in range(0, most, _PART):
        tried = starts_about(robot, command[0], _spread(done, _PART, robot.n_dof + 1))
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


def _spread(first: int, count: int, dimensions: int) -> Array:
    """Points (count, dimensions) evenly spread in the unit cube, from number ``first`` on.

    Multiples of the powers of a generalised golden ratio, x^(d + 1) = x + 1 (Roberts, The
    Unreasonable Effectiveness of Quasirandom Sequences, 2018). SciPy's Sobol points need
    ``scipy.stats``, which takes a second to import.
    """
    ratio = 1.0
    for _ in range(_TO_RATIO):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    return np.asarray((0.5 + np.arange(first, first + count)[:, None] * steps) % 1.0)


def _told_apart(robot: Robot, rests: Array, known: Array) -> tuple[NDArray[np.intp], list[int]]:
    """Which equilibrium each of n poses (n, 7) is, and which of them are the first of a new one.

    The known equilibria are numbered first, then the new ones in their order.
    """
    which, new = np.full(len(rests), -1), list[int]()
    for k in range(len(known)):
        which[_alike(robot, rests, known[k])] = k
    while len(left := np.flatnonzero(which < 0)):
        which[left[_alike(robot, rests[left], rests[left[0]])]] = len(known) + len(new)
        new.append(int(left[0]))
    return which, new


def _alike(robot: Robot, poses: Array, one: Array) -> NDArray[np.bool_]:
    """Which of n poses (n, 7) are the same equilibrium as ``one`` (7,)."""
    apart = pose_difference(poses, one) * np.repeat([1.0, robot.length], 3)
    return np.asarray(np.linalg.norm(apart, axis=1) < _ALIKE * robot.length)


def starts_about(robot: Robot, command: Array, unit: Array) -> Array:
    """Starts (n, 7) about the command in all orientations, from numbers (n, d + 1) in [0, 1).

    The last number is the size of the box, spread evenly in its logarithm from near to far.
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
