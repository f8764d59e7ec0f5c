"""Other programs at the same poses: how many converge, how many of these are wrong, how fast.

A peer's answer is wrong if forces do not balance at the pose that it gives: :func:`seecr.solve`,
started there and allowed one evaluation, says how much of the load is left. MoorPy is asked for the
a tolerance of 1e-7 m, and for cables so light that their weight does not count, or with weight. It
is no dependency: without it (``pip install moorpy``) its columns are empty.
"""

from __future__ import annotations

import contextlib
import io
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from paper_search import METHODS, search
from scipy.spatial.transform import Rotation

import seecr
from seecr.pose import Array

# A part of the load: more than this is not balanced. Light cables weigh a tenth of it.
WRONG, LIGHT = 1e-3, 1e-4
TOLERANCE = 1e-7
# Robots, E S in newtons (0: as described), and the weight of all cables over that of the platform.
RANGE = (300.0, 3e3, 3e4, 3e5, 3e6)
CASES = (
    ("demobot_cogiro", RANGE, LIGHT), ("demobot_parallel", RANGE, LIGHT),
    ("cogiro_large", (0.0,), LIGHT), ("cogiro_large", (0.0,), 0.1), ("ipanema", (0.0,), LIGHT),
    ("planar_two_cable", (0.0,), LIGHT),
)  # fmt: skip
# What a robot with joints can do in MoorPy, by its number of freedoms: all six, or in x and z.
FREEDOMS = {6: [0, 1, 2, 3, 4, 5], 3: [0, 2, 4]}
HEAD = (
    "robot, E S (N), weight of cables, seecr (µs), fsolve, least_squares, MoorPy, MoorPy (ms), "
    "times longer"
)


def cases() -> Iterator[tuple[str, seecr.Robot, float]]:
    """Robots with their names, and the weight of their cables."""
    for name, stiffnesses, heavy in CASES:
        robot = seecr.load_robot(name)
        for ea in stiffnesses:
            yield name, replace(robot, ea=np.full(robot.n_cables, ea)) if ea else robot, heavy


def row(name: str, robot: seecr.Robot, heavy: float, poses: Array, few: int) -> list[str]:
    """A line of the table: of ``few`` of the poses, how many converge, and how many are wrong."""
    some = poses[:: len(poses) // few][:few]
    per_metre = heavy * robot.weight / robot.reference_lengths.sum()
    effects: list[seecr.Term] = []
    if heavy != LIGHT:
        effects = [seecr.Term.of(robot, "cable_weight", weight_N_per_m=per_metre)]
        poses = poses[::10]  # these go one by one
    seconds = min(
        timed(lambda: seecr.solve(robot, poses, effects=effects, threads=1))[1] for _ in range(3)
    )
    each = 1e6 * seconds / len(poses)
    papers = [papers_of(robot, some, method, heavy) for method in METHODS]
    theirs, took = moorpy_of(robot, some, per_metre, effects)
    times = (f"{one:.3g}" for one in (1e-3 * took, took / each))
    return [name, f"{robot.ea.mean():.3g}", f"{heavy:g}", f"{each:.2f}", *papers, theirs, *times]


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and the seconds of processor that it takes."""
    start = time.thread_time()
    found = run()
    return found, time.thread_time() - start


def told(converged: int, wrong: int, poses: int) -> str:
    """How many converge, and are wrong."""
    return f"{converged} of {poses}" + (f", {wrong} wrong" if wrong else "")


def papers_of(robot: seecr.Robot, poses: Array, method: str, heavy: float) -> str:
    """The same of the paper's search as printed, which is for free platforms without pretension."""
    straight = np.allclose(robot.commanded_lengths(poses), robot.nominal_lengths(poses))
    if robot.joints or heavy != LIGHT or not straight:
        return "–"
    found = search(robot, poses, method)
    wrong = found.claims & ~(found.left < WRONG)
    return told(int(found.claims.sum()), int(wrong.sum()), len(poses))


def moorpy_of(
    robot: seecr.Robot, poses: Array, per_metre: float, effects: list[seecr.Term]
) -> tuple[str, float]:
    """How many poses MoorPy solves, how many wrong, and microseconds a pose."""
    if find_spec("moorpy") is None:
        return "not installed", np.nan
    found, claims, spent = poses.copy(), np.zeros(len(poses), bool), 0.0
    for k, pose in enumerate(poses):
        system = built(robot, pose, per_metre)
        claims[k], seconds = timed(partial(solved, system))
        spent += seconds
        found[k] = at_of(system)
    wrong = 0
    if claims.any():
        left = seecr.solve(
            robot, poses[claims], start=found[claims], effects=effects, max_iterations=1
        ).residual
        wrong = int(np.sum(~(left < WRONG)))
    return told(int(claims.sum()), wrong, len(poses)), 1e6 * spent / len(poses)


def built(robot: seecr.Robot, pose: Array, per_metre: float) -> Any:
    """The robot at a commanded pose that is not turned, as a body on lines in air."""
    import moorpy

    g = float(np.linalg.norm(robot.gravity))
    system = moorpy.System(depth=1e3, rho=0.0, g=g)
    system.addBody(
        0, [*pose[:3], 0.0, 0.0, 0.0], m=robot.mass, rCG=robot.centre_of_mass,
        DOFs=FREEDOMS[robot.n_dof],
    )  # fmt: skip
    paid = robot.commanded_lengths(pose[None])[0]
    for k, (exit_point, anchor) in enumerate(
        zip(robot.exit_points, robot.anchor_points, strict=True)
    ):
        system.lineTypes[f"{k}"] = {
            "name": f"{k}", "EA": float(robot.ea[k]), "m": per_metre / g, "w": per_metre,
            "d_vol": 0.0, "Cd": 0.0, "CdAx": 0.0, "cost": 0.0,
        }  # fmt: skip
        system.addPoint(1, exit_point)
        system.addPoint(1, pose[:3] + anchor)
        system.bodyList[0].attachPoint(2 * k + 2, anchor)
        system.addLine(float(paid[k]), f"{k}", pointA=2 * k + 2, pointB=2 * k + 1)
    return system


def solved(system: Any) -> bool:
    """Whether MoorPy says that it has found an equilibrium."""
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            system.initialize()
            return bool(system.solveEquilibrium(tol=TOLERANCE))
        except Exception:  # of several kinds of its own, and of NumPy
            return False


def at_of(system: Any) -> Array:
    """The pose (7,) that it has found."""
    body = system.bodyList[0]
    return np.concatenate([body.r6[:3], np.roll(Rotation.from_matrix(body.R).as_quat(), 1)])
