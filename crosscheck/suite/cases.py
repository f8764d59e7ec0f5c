"""The cases of the suite: a robot, a cable, and the poses that both physics are given."""

from __future__ import annotations

import difflib
import fnmatch
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.given import GivenRobot, file_of, robot_of
from crosscheck.settle.settler import Settler
from crosscheck.twin.lab import onto_joints
from seecr.arguments import whole
from seecr.description.mjcf import CABLES, load_robot, model_path, robot_file
from seecr.description.robot import Robot
from seecr.pose import Array, pose_add, quat_from_rotvec

# Commanded poses of the suite: along lines, rotated on the way, and at random.

N_SWEEP = 24
# The paper's trajectories (Fig 12): x from 0.17 to 0.63 m in the middle of the frame.
_SWEEP_X = (0.17, 0.63)
_SWEEP_Y = 0.25
SWEEP_Z = (0.1, 0.2)
# Inside DemoBot's frame of 0.80 x 0.50 x 0.50 m, with the platform clear of posts and exit points
# [m].
_FRAME = ((0.10, 0.10, 0.05), (0.70, 0.40, 0.35))
# Rotated sweeps: by up to this about each axis.
_SWEEP_TURN = np.deg2rad(6.0)
# Commands of the parallel DemoBot with two equilibria, 16 mm and 26 degrees or 5 mm and 19 degrees
# apart, by cable: these two were found among some 1,900 tilted by up to 40 degrees.
_TILTED = {
    "vectran": (0.351, 0.216, 0.109, 0.943, 0.163, -0.288, -0.038),
    "fishing": (0.189, 0.410, 0.143, 0.956, -0.218, 0.196, -0.001),
}
# Where the planar robot on two cables is balanced on its head above its reference pose: whichever
# way it falls, it comes to rest at the same pose.
_ON_ITS_HEAD = (0.5, 0.0, 0.773026237116659, 0.0, 0.0, 1.0, 0.0)
# Part of the distance from the reference position to the exit points that a user's robot covers.
_USER_REACH = 0.6
_USER_TURN = np.deg2rad(10.0)


def demobot_sweep(z: float, n: int = N_SWEEP) -> Array:
    """The paper's trajectory at height z [m], (n, 7): level, x from 0.17 to 0.63 m."""
    poses = np.zeros((n, 7))
    poses[:, 0] = np.linspace(*_SWEEP_X, n)
    poses[:, 1], poses[:, 2], poses[:, 3] = _SWEEP_Y, z, 1.0
    return poses


def demobot_turned_sweep() -> Array:
    """The same line between the two heights, (N_SWEEP, 7), with rotations commanded on the way."""
    poses = demobot_sweep(0.5 * sum(SWEEP_Z))
    angle = np.linspace(0.0, 2.0 * np.pi, len(poses))
    parts = [np.sin(angle), np.sin(angle + 1.0), np.cos(2.0 * angle)]
    poses[:, 3:] = quat_from_rotvec(_SWEEP_TURN * np.stack(parts, axis=1))
    return poses


def demobot_random(random: np.random.Generator, n: int, turn: float) -> Array:
    """Poses (n, 7) in DemoBot's frame, rotated by up to ``turn`` [rad]."""
    poses = np.zeros((n, 7))
    poses[:, :3] = random.uniform(*_FRAME, (n, 3))
    poses[:, 3:] = quat_from_rotvec(_turns(random, n, turn))
    return poses


def robot_sweep(robot: Robot, n: int = N_SWEEP) -> Array:
    """A level line (n, 7) through the reference pose, along the robot's widest direction."""
    exits, middle = robot.exit_points, robot.reference_pose[:3]
    across = exits - exits.mean(axis=0)
    if robot.gravity.any():  # what is level of it
        across = across - np.outer(across @ robot.up, robot.up)
    spread = np.linalg.svd(across, full_matrices=False)[2][0]
    along = (exits - middle) @ spread
    steps = np.linspace(_USER_REACH * min(along.min(), 0.0), _USER_REACH * max(along.max(), 0.0), n)
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, :3] += steps[:, None] * spread
    return onto_joints(robot, poses)


def robot_random(robot: Robot, random: np.random.Generator, n: int) -> Array:
    """Poses (n, 7) between the reference position and the exit points, slightly rotated.

    A convex combination of exit points lies in their hull, flat or not, and so does any point
    between it and the reference position if that does.
    """
    weights = random.dirichlet(np.full(robot.n_cables, 0.5), n)
    towards = weights @ robot.exit_points - robot.reference_pose[:3]
    change = np.zeros((n, 6))
    change[:, :3] = random.uniform(0.0, _USER_REACH, (n, 1)) * towards
    change[:, 3:] = _turns(random, n, _USER_TURN)
    poses = pose_add(np.tile(robot.reference_pose, (n, 1)), change)
    return onto_joints(robot, poses)


def _turns(random: np.random.Generator, n: int, largest: float) -> Array:
    """Rotation vectors (n, 3) [rad] of random axes and angles up to the largest."""
    axes = random.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    # adding zero turns -0.0, which nobody wants to read, into 0.0
    return np.asarray(axes * random.uniform(0.0, largest, (n, 1))) + 0.0


N_RANDOM = 200
# Cogiro withstands moments: its random poses are rotated by up to this about a random axis.
_COGIRO_TURN = np.deg2rad(12.0)
# Planar robots: half the width of the sweep [m], tilt of the tilted one, and other heights as parts
# of the distance between the reference position and the exit points.
_PLANAR_HALF_WIDTH = 0.15
_PLANAR_TURN = np.deg2rad(8.0)
_PLANAR_HEIGHTS = (-0.3, -0.15, 0.2, 0.4)
# Files beside the shipped robots, each with a passive line of another kind.
_PASSIVE = ("band", "spring", "counterweight")
# Robots of other sizes and kinds, with only a part of the number of random poses.
_OTHERS = ("cogiro_large", "ipanema", "camera")
_FEWER = 8


@dataclass(frozen=True, eq=False)
class Case:
    """A robot with a cable, and the poses that it is commanded to.

    Attributes:
        name: on the terminal, in file names and for ``--case``.
        model: MJCF file that SEECR reads.
        mujoco_model: MJCF file that MuJoCo settles; the same one, unless the two are to differ.
        cable: name of one of ``CABLES`` of :mod:`seecr.description.mjcf`; None keeps the MJCF's
            stiffness.
        kind: ``"sweep"``, whose poses follow each other along a line, ``"random"``, or
            ``"starts"``: one command from several starts.
        poses: (n, 7) commanded.
        has_names: whether thresholds can name its poses: not with another seed or a user's robot.
        starts: (n, 7) start poses of both physics, each row alone; None starts at the commands.
        passive: names of lines that no winch drives, besides those that the files name.
    """

    name: str
    model: Path
    mujoco_model: Path
    cable: str | None
    kind: str
    poses: Array
    has_names: bool = True
    starts: Array | None = None
    passive: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of commanded poses."""
        return len(self.poses)

    @property
    def begins(self) -> Array:
        """Start poses of MuJoCo's settling and of SEECR's search, (n, 7)."""
        return self.poses if self.starts is None else self.starts

    @property
    def ea(self) -> float | None:
        """k_c = E S [N] of every cable; None if the MJCF states it."""
        return None if self.cable is None else CABLES[self.cable]

    def settler(self) -> Settler:
        """The robot in MuJoCo, with the case's cable unless it has an MJCF of its own."""
        ea = self.ea if self.mujoco_model == self.model else None
        return Settler(self.mujoco_model, ea=ea, passive=self.passive)


def shipped_cases(seed: int = 0, n_random: int = N_RANDOM) -> list[Case]:
    """DemoBots along the paper's sweeps, rotated, at random and tilted; planar and other robots.

    Args:
        seed: of the random poses.
        n_random: number of random poses of each DemoBot and cable; other robots have fewer.

    Returns:
        the cases, as :func:`run_suite` takes them.

    Raises:
        InputError: either is not a whole number.

    Example:
        ``[case.name for case in crosscheck.shipped_cases()]``
    """
    seed, n_random = whole(seed, "seed"), whole(n_random, "n_random")
    cases: list[Case] = []
    named: dict[str, Any] = {"has_names": seed == 0}
    for robot, turn in (("cogiro", _COGIRO_TURN), ("parallel", 0.0)):
        model = f"demobot_{robot}"
        for cable in CABLES:
            name = f"{robot}-{cable}"
            random = demobot_random(_generator(seed, f"{name}-random"), n_random, turn)
            for z in SWEEP_Z:
                cases.append(_case(f"{name}-z{z:.2f}", model, "sweep", demobot_sweep(z), cable))
            cases.append(_case(f"{name}-turned", model, "sweep", demobot_turned_sweep(), cable))
            cases.append(_case(f"{name}-random", model, "random", random, cable, **named))
    cases += [*map(_tilted_case, CABLES), _inverted_case()]
    for robot in ("two_cable", "vertical", "horizontal"):
        cases += _planar_cases(robot)
    for robot, turn in (("uneven", 0.0), ("off_centre", _COGIRO_TURN)):
        model, stem = f"demobot_{robot}", robot.replace("_", "-")
        random = demobot_random(_generator(seed, f"{stem}-random"), n_random // 2, turn)
        cases.append(_case(f"{stem}-turned", model, "sweep", demobot_turned_sweep()))
        cases.append(_case(f"{stem}-random", model, "random", random, **named))
    for model in _OTHERS:
        one, stem = load_robot(model_path(model)), model.replace("_", "-")
        few = max(n_random // _FEWER, 1)
        random = robot_random(one, _generator(seed, f"{stem}-random"), few)
        cases.append(_case(f"{stem}-sweep", model, "sweep", robot_sweep(one, N_SWEEP // 2)))
        cases.append(_case(f"{stem}-random", model, "random", random, **named))
    for kind in _PASSIVE:
        path = model_path("camera").parents[1] / "passive_lines" / f"{kind}.xml"
        sweep = robot_sweep(load_robot(path), N_SWEEP // 2)
        cases.append(_case(f"passive-{kind}", path, "sweep", sweep))
    return cases


def _case(
    name: str, model: str | Path, kind: str, poses: Array, cable: str | None = None, **more: Any
) -> Case:
    """A case in which both physics read the same file, or that of a shipped robot."""
    path = model if isinstance(model, Path) else model_path(model)
    return Case(name, path, path, cable, kind, poses, **more)


def user_cases(
    robot: GivenRobot,
    mujoco_model: str | Path | None = None,
    *,
    seed: int = 0,
    n_random: int = N_RANDOM,
) -> list[Case]:
    """A sweep and random poses for any robot, scaled by its own size.

    Args:
        robot: its MJCF, or as read from that.
        mujoco_model: another MJCF for MuJoCo's side; None takes the same.
        seed: of the random poses.
        n_random: number of random poses.

    Returns:
        the cases, as :func:`run_suite` takes them.

    Raises:
        InputError: a robot without a file, or with numbers other than its file's; a seed or number
            that is not whole.

    Example:
        ``crosscheck.run_suite(crosscheck.user_cases("robot.xml", n_random=4))``
    """
    seed, n_random = whole(seed, "seed"), whole(n_random, "n_random")
    model, robot = file_of(robot), robot_of(robot)
    name, other = model.stem, model if mujoco_model is None else robot_file(mujoco_model)
    random = robot_random(robot, _generator(seed, f"{name}-random"), n_random)
    sweep, of_user = robot_sweep(robot), (False, None, robot.passive_names)
    return [
        Case(f"{name}-sweep", model, other, None, "sweep", sweep, *of_user),
        Case(f"{name}-random", model, other, None, "random", random, *of_user),
    ]


def select(cases: Sequence[Any], patterns: Sequence[str], option: str = "") -> list[Any]:
    """Cases that match any of the shell patterns; all without patterns.

    Args:
        cases: to choose from, of any kind with a name.
        patterns: such as "cogiro-*".
        option: the option of the command line that gave them, for the error.

    Raises:
        CrosscheckError: a pattern that matches no case; the message names the nearest.
    """
    if not patterns:
        return list(cases)
    names = [case.name for case in cases]
    for pattern in patterns:
        if not fnmatch.filter(names, pattern):
            near = difflib.get_close_matches(pattern, names, n=3, cutoff=0.0)
            what = f"{option} {pattern}".lstrip()
            raise CrosscheckError(
                f"{what}: no such case; the nearest are {', '.join(near)} "
                "(crosscheck run --list has all, patterns such as 'cogiro-*' work)"
            )
    return [c for c in cases if any(fnmatch.fnmatchcase(c.name, p) for p in patterns)]


def _tilted_case(cable: str) -> Case:
    """A command with two equilibria, started once at the command and once at the reference pose.

    Each start leads to one of the two, and each physics has to find the one that its start leads
    to.
    """
    model, command = "demobot_parallel", np.array(_TILTED[cable])
    command[3:] /= np.linalg.norm(command[3:])
    starts = np.stack([command, load_robot(model_path(model)).reference_pose])
    commands = np.stack([command, command])
    return _case(f"parallel-{cable}-tilted", model, "starts", commands, cable, starts=starts)


def _inverted_case() -> Case:
    """A start in balance that is unstable: each physics has to leave it."""
    model, start = "planar_two_cable", np.array([_ON_ITS_HEAD])
    command = load_robot(model_path(model)).reference_pose[None]
    return _case("planar-two-cable-inverted", model, "starts", command, starts=start)


def _planar_cases(robot: str) -> list[Case]:
    """A planar robot of the paper (Figs 2 to 9): a short sweep, other heights, and tilted poses."""
    model, stem = f"planar_{robot}", f"planar-{robot}".replace("_", "-")
    one = load_robot(model_path(model))
    level = np.tile(one.reference_pose, (N_SWEEP, 1))
    level[:, 0] += np.linspace(-_PLANAR_HALF_WIDTH, _PLANAR_HALF_WIDTH, N_SWEEP)
    room = float(one.exit_points[:, 2].min() - one.reference_pose[2])
    heights = np.concatenate([level[::2] + part * room * np.eye(7)[2] for part in _PLANAR_HEIGHTS])
    turned = level.copy()
    tilt = _PLANAR_TURN * np.sin(np.linspace(0.0, 2.0 * np.pi, N_SWEEP))
    turned[:, 3:] = quat_from_rotvec(tilt[:, None] * np.array([0.0, 1.0, 0.0]))
    cases = [_case(stem, model, "sweep", level, "vectran")]
    for cable in CABLES:
        cases.append(_case(f"{stem}-{cable}-heights", model, "random", heights, cable))
        cases.append(_case(f"{stem}-{cable}-turned", model, "sweep", turned, cable))
    return cases


def _generator(seed: int, name: str) -> np.random.Generator:
    """Random numbers of a case, independent of which other cases run."""
    return np.random.default_rng([seed, *name.encode()])
