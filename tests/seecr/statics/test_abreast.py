"""Many poses descend in lanes: the same rests as one by one, whoever finds them, in any threads."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_robots import random_poses, random_robot

import seecr
from seecr.compiled.columns import EXTERNAL_MOMENT
from seecr.compiled.lanes import OUT_OF_SCOPE
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.effects.setup import plain_setup
from seecr.pose import quat_from_rotvec, quat_multiply
from seecr.statics import batch
from seecr.statics.abreast import are_for_lanes
from seecr.statics.batch import Brief
from seecr.statics.tables import PORTION, assemble, one_by_one, take

N = 1500


def shipped(name: str, ea: float | None = None) -> seecr.Robot:
    robot = seecr.load_robot(name)
    return robot if ea is None else replace(robot, ea=np.full(robot.n_cables, ea))


def poses_of(robot: seecr.Robot, n: int = N, seed: int = 0) -> np.ndarray:
    """Poses between the exit points, half of them turned; on joints, values about the middle."""
    rng = np.random.default_rng(seed)
    points = np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])
    low, high = points.min(axis=0), points.max(axis=0)
    if robot.joints:
        middle = values_of_pose(robot, robot.reference_pose[None])[0]
        reach = np.where(robot.hinges, 0.3, 0.25 * np.max(high - low))
        return pose_of_values(robot, middle + reach * rng.uniform(-1, 1, (n, robot.n_dof)))[0]
    turn = quat_from_rotvec(0.2 * rng.normal(size=(n, 3)) * (rng.uniform(size=(n, 1)) < 0.5))
    quat = quat_multiply(turn, np.tile(robot.reference_pose[3:], (n, 1)))
    places = low + rng.uniform(0.1, 0.9, (n, 3)) * (high - low)
    return np.concatenate([places, quat], axis=1)


ROBOTS: dict[str, Callable[[], seecr.Robot]] = {
    "taut": lambda: shipped("demobot_cogiro"),
    "slack": lambda: shipped("demobot_parallel"),
    "very soft": lambda: shipped("ipanema", 300.0),
    "very stiff": lambda: shipped("demobot_cogiro", 1e7),
    "slack and stiff": lambda: shipped("demobot_parallel", 1e5),
    "planar": lambda: shipped("planar_vertical"),
    "planar and level": lambda: shipped("planar_horizontal"),
    "planar, two cables": lambda: shipped("planar_two_cable"),
    "only translates": lambda: shipped("camera"),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_lanes_rest_where_the_descent_of_one_does(name: str) -> None:
    check_same(ROBOTS[name](), poses_of(ROBOTS[name]()))


@pytest.mark.parametrize("seed", range(6))
def test_lanes_of_robots_nobody_has_seen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, ("free", "planar")[seed % 2])
    check_same(robot, random_poses(rng, robot, 400))


def check_same(robot: seecr.Robot, poses: np.ndarray) -> None:
    """Most of the poses rest in lanes, and all as they do one by one, but for rounding."""
    many = seecr.solve(robot, poses)
    with one_by_one():
        single = seecr.solve(robot, poses)
    assert isinstance(many.evaluation, Brief) and not isinstance(single.evaluation, Brief)
    assert many.evaluation.alone.mean() < 0.5
    assert np.array_equal(many.status, single.status)
    rests = many.converged
    assert rests.sum() > 0.5 * len(poses)
    # the residual that both may leave, over the stiffness that the load itself gives
    near = np.repeat([robot.length, 1.0], 3) * 1e-9
    assert np.all(np.abs(many.deviation - single.deviation)[rests] < near)
    pulls = np.abs(many.tensions - single.tensions)[rests]
    assert np.all(pulls < 1e-7 * robot.usual_load + 1e-9 * many.tensions[rests].max())
    assert np.array_equal(many.slack[rests], single.slack[rests])
    assert np.all(many.residual[rests] < 1e-9)
    joules = 1e-9 * robot.usual_load * robot.length
    assert np.allclose(many.energy[rests], single.energy[rests], rtol=1e-9, atol=joules)
    assert np.array_equal(many.rest_lengths, single.rest_lengths)
    stiffness = np.abs(many.stiffness - single.stiffness)[rests].max(axis=(1, 2))
    assert np.all(stiffness < 1e-6 * np.abs(single.stiffness)[rests].max(axis=(1, 2)))


def test_what_lanes_leave_is_solved_by_itself() -> None:
    """Falls, and rests where a cable is as long as its rest length."""
    robot = shipped("demobot_parallel")
    poses = poses_of(robot)
    found = seecr.solve(robot, poses)
    assert isinstance(found.evaluation, Brief)
    alone = found.evaluation.alone
    assert 0 < alone.sum() < 0.1 * N
    free = found.status == seecr.Status.SINGULAR
    assert free[alone].any() and free[~alone].any()
    assert (found.converged | free)[~alone].all()
    with one_by_one():
        again = seecr.solve(robot, poses).rows(alone)
    assert np.array_equal(again.deviation, found.deviation[alone], equal_nan=True)
    assert np.array_equal(again.iterations, found.iterations[alone])


def test_few_poses_do_not_descend_in_lanes() -> None:
    robot = shipped("demobot_cogiro")
    assert not isinstance(seecr.solve(robot, poses_of(robot, 100)).evaluation, Brief)


@pytest.mark.parametrize("column", OUT_OF_SCOPE)
def test_a_column_that_lanes_do_not_know_keeps_them_out(column: int) -> None:
    robot = shipped("demobot_cogiro")
    tables = assemble(plain_setup(robot, seecr.Commands(poses_of(robot, 300))))
    assert are_for_lanes(tables)
    tables.cables[7, 3, column] = 1e-9
    assert not are_for_lanes(tables)


def test_a_moment_keeps_lanes_out() -> None:
    robot = shipped("demobot_cogiro")
    tables = assemble(plain_setup(robot, seecr.Commands(poses_of(robot, 300))))
    tables.load[299, EXTERNAL_MOMENT + 2] = 1e-9
    assert not are_for_lanes(tables)


def test_cables_that_differ_from_row_to_row_descend_in_lanes() -> None:
    """Written to, tables count as they are: each row with its own stiffness, in either thread."""
    robot = shipped("demobot_cogiro")
    tables = assemble(plain_setup(robot, seecr.Commands(poses_of(robot, 300))))
    soft = assemble(plain_setup(replace(robot, ea=0.5 * robot.ea), seecr.Commands(tables.poses)))
    mixed = take(tables, np.arange(300))
    mixed.cables[::3] = soft.cables[::3]
    found, softer, stiffer = (batch.descend(each, threads=2) for each in (mixed, soft, tables))
    assert isinstance(found, Brief)
    own = np.arange(300) % 3 == 0
    for name in ("deviation", "hessian"):
        each, here, there = (getattr(one, name) for one in (found, softer, stiffer))
        assert np.array_equal(each[own], here[own]) and np.array_equal(each[~own], there[~own])


def test_external_forces_and_starts_reach_the_lanes() -> None:
    robot = shipped("demobot_cogiro")
    poses, rng = poses_of(robot), np.random.default_rng(1)
    wrench = np.zeros((N, 6))
    wrench[:, :3] = rng.uniform(-1.0, 1.0, (N, 3))
    start = poses + np.concatenate([rng.uniform(-0.01, 0.01, (N, 3)), np.zeros((N, 4))], axis=1)
    many = seecr.solve(robot, poses, wrench=wrench, start=start)
    with one_by_one():
        single = seecr.solve(robot, poses, wrench=wrench, start=start)
    assert isinstance(many.evaluation, Brief)
    assert np.array_equal(many.status, single.status)
    assert np.nanmax(np.abs(many.deviation - single.deviation)) < 1e-10
    assert np.nanmax(np.abs(many.deviation - seecr.solve(robot, poses).deviation)) > 1e-5


@pytest.mark.parametrize("name", ["slack", "planar"])
def test_digits_do_not_depend_on_threads(name: str) -> None:
    robot = ROBOTS[name]()
    poses = poses_of(robot)
    one, *others = (seecr.solve(robot, poses, threads=k) for k in (1, 2, 3, 7))
    for other in others:
        for of in ("deviation", "tensions", "residual", "energy", "iterations"):
            assert np.array_equal(getattr(one, of), getattr(other, of), equal_nan=True)


def test_rows_of_what_lanes_found_are_those_rows() -> None:
    robot = shipped("demobot_parallel")
    found = seecr.solve(robot, poses_of(robot))
    some = found.rows([5, 900, 3])
    assert np.array_equal(some.evaluation.states, found.evaluation.states[[5, 900, 3]])
    assert np.array_equal(some.stiffness, found.stiffness[[5, 900, 3]])
    assert np.array_equal(some.tables.cables, found.tables.cables[[5, 900, 3]])


def test_a_copy_with_other_rows_in_it_is_whole() -> None:
    robot = shipped("demobot_parallel")
    found, other = (seecr.solve(robot, poses_of(robot, 300, seed)).evaluation for seed in (0, 1))
    rows, changed = np.array([3, 150]), found.copy()
    changed.put(rows, other.only(rows))
    for of in ("tension", "deviation", "states", "hessian", "residual"):
        expected = getattr(found, of).copy()
        expected[rows] = getattr(other, of)[rows]
        assert np.array_equal(getattr(changed, of), expected)
        assert not np.array_equal(getattr(changed, of), getattr(found, of))


@pytest.mark.slow
def test_the_second_start_compiles_nothing() -> None:
    """The lanes of all numbers of cables are one function, and it is kept on disk."""
    code = """
import numpy as np, seecr
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, what): compiled.append(what)
    def on_end(self, what): pass
event.register("numba:compile", Listener())
for name in ("demobot_cogiro", "planar_vertical"):
    robot = seecr.load_robot(name)
    found = seecr.solve(robot, np.tile(robot.reference_pose, (300, 1)))
    found.smallest_eigenvalue
    assert found.evaluation.alone.mean() < 0.5
print(len(compiled))
"""
    for _ in range(2):
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert told.stdout.strip() == b"0"


# --- Very many rows are solved in portions: the same rests, in the memory that their results need


# A million rows are to fit into 2 GB, and Python with its libraries takes 0.3 GB of these. With
# eight cables 96 numbers stay of a row: its command, twice, and its pose (21), deviations (13),
# tensions, rest lengths and gaps (40), which cables are slack (2), and what is one number for each
# row. Three quarters more are there while these are made.
BYTES = 1700
MOMENT = (1.0, 0.0, 0.0, 0.0, 0.02, 0.0)
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "lanes": ("demobot_cogiro", {}),
    "a moment": ("demobot_cogiro", {"wrench": MOMENT}),
    "a moment on joints": ("planar_two_cable", {"wrench": MOMENT}),
    "sag": (
        "demobot_cogiro",
        {"effects": [seecr.Term.of("demobot_cogiro", "cable_weight", weight_N_per_m=0.05)]},
    ),
}


def poses_near_home(robot: seecr.Robot, n: int) -> np.ndarray:
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, [0, 2]] += 0.05 * np.random.default_rng(n).uniform(-1.0, 1.0, (n, 2))
    return poses


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_million_rows_fit_into_2_gb(kind: str) -> None:
    name, more = KINDS[kind]
    robot = seecr.load_robot(name)

    def peak(n: int) -> int:
        """Of arrays: those of portions count in both of the numbers that are compared."""
        poses = poses_near_home(robot, n)
        tracemalloc.start()
        found = seecr.solve(robot, poses, **more)
        found.lines(), found.smallest_eigenvalue
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    seecr.solve(robot, poses_near_home(robot, 300), **more)
    assert (peak(3 * PORTION) - peak(2 * PORTION)) / PORTION < BYTES


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_portions_rest_as_few_rows_do(kind: str) -> None:
    name, more = KINDS[kind]
    robot = seecr.load_robot(name)
    poses = poses_near_home(robot, PORTION + 100)
    rows = np.r_[0:200, PORTION - 50 : PORTION + 100]  # enough for lanes
    many, few = seecr.solve(robot, poses, **more), seecr.solve(robot, poses[rows], **more)
    assert len(many.evaluation.outcome) > PORTION and few.converged.all()
    for of in ("status", "deviation", "tensions", "slack", "energy", "iterations", "residual"):
        np.testing.assert_array_equal(getattr(many, of)[rows], getattr(few, of), of)
    # catenaries are evaluated from elsewhere, to their own tolerance
    assert np.allclose(many.evaluation.strain[rows], few.evaluation.strain, rtol=1e-9, atol=1e-15)
    assert np.allclose(many.balance[rows], few.balance, rtol=1e-12, atol=0.0)
    near = 1e-9 * np.abs(few.stiffness).max()
    for stiffness in (many.stiffness[rows], many.rows(rows).stiffness):
        assert np.allclose(stiffness, few.stiffness, rtol=0.0, atol=near)
    assert np.allclose(many.smallest_eigenvalue[rows], few.smallest_eigenvalue, rtol=0.0, atol=near)
