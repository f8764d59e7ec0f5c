"""Orientations in which too few cables hold a platform: by their balance, and a bar by its tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import random_poses, random_robot
from robots import WAYS, rejointed

from seecr import Commands, Experiment, Joint, Robot, bar_tilt, load_robot
from seecr.compiled.orientation import straight_balance_batch
from seecr.description.joints import pose_of_values
from seecr.effects.load import ExternalWrench
from seecr.inverse.in_place import Turned, turned_in_place
from seecr.pose import Array, pose_difference, quat_rotate, rxyz_from_quat
from seecr.statics.tables import Tables, assemble
from seecr.tensions.balance import balance_of, straight_balance

# Less than twice the mean of the tensions: this limit is the nearer one.
HIGH = 3.0
WRENCH = np.array([0.5, -0.3, 0.2, 0.04, 0.02, -0.03])


def balance(robot: Robot, pose: Array, wrench: Array) -> tuple[Array, Array]:
    """W (6, m) and w (6,) of W tau + w = 0 about the platform (paper, eqs 3 and 4)."""
    arms, centre = (quat_rotate(pose[3:], p) for p in (robot.anchor_points, robot.centre_of_mass))
    way = robot.exit_points - (pose[:3] + arms)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    weight = robot.mass * robot.gravity
    matrix = np.concatenate([way, np.cross(arms, way)], axis=1).T
    return matrix, wrench + np.concatenate([weight, np.cross(centre, weight)])


def tables_of(robot: Robot, poses: Array, wrench: Array | None = None) -> Tables:
    effects = [] if wrench is None else [ExternalWrench(wrench[:3], wrench[3:])]
    return assemble(Experiment(robot, Commands(poses)).setup(effects))


def turned(robot: Robot, places: Array, high: float = np.inf) -> Turned:
    poses = np.tile(robot.reference_pose, (len(places), 1))
    poses[:, :3] = places
    low = np.zeros((len(poses), robot.n_cables))
    return turned_in_place(robot, tables_of(robot, poses), low, low + high)


@pytest.mark.parametrize("seed", range(3))
def test_the_balance_at_any_pose_is_equation_3(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    wrench = robot.weight * WRENCH
    poses, rows = random_poses(rng, robot, 4), np.array([2, 0, 1, 1])
    tables = tables_of(robot, np.tile(robot.reference_pose, (3, 1)), wrench)
    matrices, loads = np.empty((4, 6, robot.n_cables)), np.empty((4, 6))
    unit = np.repeat([1.0, 1.0 / robot.length], 3)
    away = pose_difference(poses, robot.reference_pose) / unit
    straight_balance_batch(
        tables.cables, tables.load, tables.poses, tables.screws, rows, away, robot.length,
        matrices, loads,
    )  # fmt: skip
    for k, pose in enumerate(poses):
        matrix, load = balance(robot, pose, wrench)
        np.testing.assert_allclose(-matrices[k], unit[:, None] * matrix, atol=1e-12)
        np.testing.assert_allclose(loads[k], unit * load, atol=1e-12 * robot.weight)


@pytest.mark.parametrize("name", ["planar_vertical", "planar_two_cable"])
def test_the_balance_of_a_platform_on_joints_is_that_at_its_pose(name: str) -> None:
    robot, random = load_robot(name), np.random.default_rng(0)
    values, away = random.uniform(-0.2, 0.2, (2, 3, robot.n_dof))
    size = np.where(robot.hinges, robot.length, 1.0)
    tables, rows = tables_of(robot, pose_of_values(robot, values)[0]), np.array([2, 0, 1])
    there = tables_of(robot, pose_of_values(robot, values[rows] + away / size)[0])
    found = straight_balance(tables, rows, away)
    for mine, theirs in zip(found, balance_of(there, np.zeros(robot.n_cables)), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-12 * np.abs(theirs).max())


def test_a_bar_on_two_cables_tilts_until_three_lines_meet() -> None:
    robot = load_robot("planar_two_cable")
    places = np.array([[0.5, 0, 0.4], [0.3, 0, 0.5], [0.75, 0, 0.2], [0.5, 0, 1.3]])
    found = turned(robot, places)
    tilt = bar_tilt([[0, 1], [1, 1]], places[:, [0, 2]], 0.1)
    np.testing.assert_array_equal(found.found, np.isfinite(tilt))
    assert found.found.tolist() == [True, True, True, False]
    there = rxyz_from_quat(found.poses[:, 3:])[:3, 1]
    np.testing.assert_allclose(there, -tilt[:3], atol=1e-9)
    np.testing.assert_allclose(found.poses[:, :3], places, atol=1e-15)


def test_four_cables_balance_a_platform_in_space_and_margins_are_those_of_their_tensions() -> None:
    whole = load_robot("demobot_parallel")
    some = [0, 2, 4, 6]
    robot = replace(
        whole, exit_points=whole.exit_points[some], anchor_points=whole.anchor_points[some],
        ea=whole.ea[some], rest_lengths=whole.rest_lengths[some], cable_names=("a", "b", "c", "d"),
    )  # fmt: skip
    found = turned(robot, np.array([[0.3, 0.2, 0.3], [0.45, 0.3, 0.1]]), high=HIGH)
    assert found.found.all()
    level = robot.reference_pose.copy()
    for pose, margin in zip(found.poses, found.margins, strict=True):
        for at, rests in ((pose, True), (np.concatenate([pose[:3], level[3:]]), False)):
            matrix, load = balance(robot, at, np.zeros(6))
            tension = np.linalg.lstsq(matrix, -load, rcond=None)[0]
            missing = np.linalg.norm(matrix @ tension + load) / robot.weight
            assert (missing < 1e-10) == rests
            if rests:
                assert margin == pytest.approx(np.minimum(tension, HIGH - tension).min(), rel=1e-8)
                assert margin > 0.0


@pytest.mark.parametrize("way", WAYS)
def test_a_position_is_that_of_the_origin_whatever_the_joints(way: str) -> None:
    """Slides were kept instead: with the hinge beside the origin it left the position asked for."""
    robot = load_robot("planar_two_cable")
    places = np.tile(robot.reference_pose[:3], (12, 1))
    places[:, 0] += np.linspace(-0.3, 0.3, 12)
    found, other = turned(robot, places), turned(rejointed(robot, way), places)
    assert found.found.all() and other.found.all()
    np.testing.assert_allclose(other.poses, found.poses, atol=1e-9)
    np.testing.assert_allclose(other.margins, found.margins, rtol=1e-7)


def test_a_platform_on_hinges_alone_turns_about_its_origin_by_all_of_them() -> None:
    """Three cables hold it where it is asked to be, with tensions farther inside than untilted."""
    robot = load_robot("planar_vertical")
    home, y = robot.reference_pose[:3], np.array([0.0, 1.0, 0.0])
    ends = home + np.array([[-0.5, 0.0, -0.2], [-0.2, 0.0, 0.2], [0.05, 0.0, 0.02]])
    arm = replace(
        robot, joints=tuple(Joint("hinge", f"h{k}", y, end) for k, end in enumerate(ends))
    )
    places = home + np.array([[0.04, 0.0, 0.02], [0.0, 0.0, 0.05]])
    found, other = turned(robot, places, 60.0), turned(arm, places, 60.0)
    assert found.found.all() and other.found.all()
    np.testing.assert_allclose(other.poses[:, :3], places, atol=1e-9)
    np.testing.assert_allclose(other.margins, found.margins, rtol=2e-2)
