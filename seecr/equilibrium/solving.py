"""``solve``: the equilibrium of the platform for a batch of commands."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seecr.arguments import finite, whole
from seecr.commands import Commands
from seecr.counted import counted
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.edits import setup_with
from seecr.effects.setup import Setup
from seecr.equilibrium.following import follow_commands
from seecr.equilibrium.search import other_rests, solve_setup
from seecr.errors import InputError
from seecr.pose import SMALLEST, Array
from seecr.prediction.experiment import Experiment, effects_of
from seecr.statics.solution import Solution
from seecr.statics.starts import Commanded, HasCommands, commanded_poses, poses_from_lengths
from seecr.tensions.balance import with_passive

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects


METHODS = ("newton", "fsolve", "least_squares")


def solve(
    robot: GivenRobot,
    poses: Commanded | None = None,
    *,
    rest_lengths: ArrayLike | None = None,
    effects: GivenEffects = (),
    method: str = "newton",
    wrench: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    start: ArrayLike | None = None,
    max_iterations: int = 400,
    threads: int | None = None,
    others: bool = False,
    follow: bool = False,
) -> Solution:
    """Find where the platform comes to rest (paper, section III-B) for a batch of commands.

    Args:
        robot: from :func:`seecr.load_robot`, its MJCF, or made by hand.
        poses: (n, 7) or (7,) commanded poses; the winches change the rest lengths of the MJCF by
            what the straight lengths from A_i to B_i change from the reference pose. Without
            pretension these are then the straight lengths (eqs 1, 2). Or :class:`seecr.Commands`
            with runs, times or lengths, or ``crosscheck.Measurements``, of which only the commands
            count.
        rest_lengths: (n, m) or (m,) [m] absolute lengths of the driven cables instead of poses.
            Poses given as well are only where the search starts; by default it starts at the poses
            whose straight lengths fit these best, found from the reference pose.
        effects: how the robot differs from the paper's model: a model, its file, or effects with
            values. If one has a history, rows are solved in order.
        method: ``"newton"`` is the compiled Newton descent on the potential energy; ``"fsolve"``
            and ``"least_squares"`` are the paper's own searches, by SciPy from its first guess
            (step 4).
        wrench: (6,) or (n, 6) external force [N] at the platform origin and moment [N m].
        gravity: (3,) [m/s^2] instead of the robot's.
        start: (n, 7) poses to start from instead of the commanded ones.
        max_iterations: most evaluations of the wrench per pose, and per stage of the stiffness.
        threads: number of threads; one per processor by default.
        others: also look for the other stable equilibria of each command, which takes a tenth of a
            second or more per command; the solution has them as ``others``.
        follow: follow the equilibrium of each run from the reference pose along the commanded path,
            instead of searching from each command. Where it ceases to exist on the way, and where
            the platform then comes to rest, is in the solution's ``jumps``.

    Returns:
        a :class:`Solution`; check ``status`` or ``converged`` before using a pose.

    Raises:
        InputError: wrong shapes or types, values that are not finite, an unknown method, or
            arguments that exclude each other.

    Example:
        ``seecr.solve("robot.xml", [[0.4, 0.25, 0.15, 1, 0, 0, 0]]).tensions``
    """
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    whole(max_iterations, "max_iterations", 1)
    if threads is not None:
        whole(threads, "threads", 1)
    robot = robot_of(robot)
    if gravity is not None:
        robot = replace(robot, gravity=_gravity(gravity))
    if isinstance(poses, HasCommands):
        poses = poses.as_commands(robot)
    commands = _commands(robot, poses, rest_lengths)
    acting = effects_of(effects, robot)
    pushed = None if wrench is None else finite(wrench, "wrench")

    setup_of = partial(setup_with, acting, robot)
    setup = setup_of(commands, pushed)
    if setup.has_history or setup.laws:
        if follow:
            raise InputError(
                "effects with history or with a law of their own are always solved along the "
                "path; leave follow out"
            )
        if method != "newton" or start is not None or wrench is not None or others:
            raise InputError(
                "effects with history or with a law of their own are solved along the path; "
                "expected no other method, no start, no others, and external_wrench among the "
                "effects instead of wrench"
            )
        found = Experiment(robot, commands).predict(acting).solution()
        return replace(found, line=commands.line)
    starts = None
    if start is not None:
        starts = commanded_poses(start, "start", robot)
        if len(starts) != len(commands):
            raise InputError(f"start must have {counted(len(commands), 'pose')}, got {len(starts)}")
    elif method == "newton" and not follow:
        # rows of a batch are independent: each is a run of its own
        apart = (
            commands
            if isinstance(poses, Commands)
            else replace(commands, run=np.arange(len(commands)))
        )
        starts = poses_from_lengths(robot, apart)
    pushes = np.broadcast_to(np.zeros(6) if pushed is None else pushed, (len(commands), 6))
    if follow:
        if method != "newton" or start is not None:
            raise InputError(
                "follow goes from the reference pose downhill; expected no other method and no "
                "start"
            )
        found = follow_commands(robot, commands, lambda way, row: setup_of(way, pushes[row]))
    else:
        found = solve_setup(setup, method, starts, max_iterations, threads)
    found = replace(found, line=commands.line)
    if not others:
        return found

    def repeated(i: int, n: int) -> Setup:
        return setup_of(commands.rows(np.full(n, i)), pushes[i])

    return replace(found, others=other_rests(found, repeated))


def _commands(
    robot: Robot, poses: Commands | ArrayLike | None, lengths: ArrayLike | None
) -> Commands:
    if isinstance(poses, Commands):
        if lengths is not None:
            raise InputError("commands have their own lengths; expected no rest_lengths with them")
        return poses
    if lengths is None:
        if poses is None:
            raise InputError("solve needs commanded poses (n, 7) or rest_lengths (n, m); got none")
        return Commands(commanded_poses(poses, robot=robot))
    table = np.atleast_2d(finite(lengths, "rest_lengths"))
    table = _with_passive(robot, table)
    if table.ndim != 2 or table.shape[1] != robot.n_cables:
        raise InputError(
            f"rest_lengths must be (n, {robot.n_driven}) for {robot.name}, got {np.shape(lengths)}"
        )
    if np.any(table < SMALLEST):
        raise InputError(f"rest_lengths must be positive [m], and not below {SMALLEST:g} m")
    start = robot.reference_pose[None] if poses is None else commanded_poses(poses, robot=robot)
    if len(start) not in (1, len(table)):
        raise InputError(
            f"poses must be one or as many as the {counted(len(table), 'row')} of rest_lengths, "
            f"got {len(start)}"
        )
    rows = np.broadcast_to(start, (len(table), 7)).copy()
    return Commands(rows, lengths=table)


def _with_passive(robot: Robot, table: Array) -> Array:
    """Lengths with those of the passive lines, (n, m), of the driven cables' (n, k) or of all's.

    Raises:
        InputError: another length for a passive line than that of its description.
    """
    if robot.all_driven or table.ndim != 2 or table.shape[1] != robot.n_cables:
        fits = table.ndim == 2 and table.shape[1] == robot.n_driven
        return with_passive(robot, table) if fits else table
    if not np.allclose(table[:, ~robot.driven], robot.rest_lengths[~robot.driven], 1e-12, 0.0):
        raise InputError(
            f"rest_lengths: no winch drives {', '.join(robot.passive_names)}, so they stay as they "
            f"are; expected (n, {robot.n_driven}) lengths, of the other cables"
        )
    return table


def _gravity(values: ArrayLike) -> Array:
    vector = finite(values, "gravity")
    if vector.shape != (3,):
        raise InputError(f"gravity must be (3,), got {vector.shape}")
    return vector
