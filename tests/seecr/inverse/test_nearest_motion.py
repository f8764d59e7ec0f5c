"""Distances and directions are the platform's, whatever joints it is on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import random_robot
from rejointed import WAYS, rejointed

from seecr.description.joints import freedoms, pose_of_values, values_of_pose
from seecr.description.mjcf import load_robot
from seecr.description.robot import Joint, Robot
from seecr.inverse.correction import correct
from seecr.inverse.nearest_problem import PlatformMotion
from seecr.pose import Array, pose_difference, quat_from_rotvec


def motion_of(robot: Robot, values: Array, fix_position: bool = False) -> PlatformMotion:
    """Motions from the poses at joint values (n, d)."""
    return PlatformMotion.about(robot, *pose_of_values(robot, values), fix_position)


def arm() -> Robot:
    """A platform on three parallel hinges, which can turn about its origin by moving all three."""
    robot = load_robot("planar_vertical")
    home, y = robot.reference_pose[:3], np.array([0.0, 1.0, 0.0])
    places = home + np.array([[-0.5, 0.0, -0.2], [-0.2, 0.0, 0.2], [0.05, 0.0, 0.02]])
    hinges = tuple(Joint("hinge", f"h{k}", y, place) for k, place in enumerate(places))
    return replace(robot, joints=hinges)


def test_freedoms() -> None:
    robot = load_robot("planar_vertical")
    assert freedoms(load_robot("ipanema")) == (6, 3, 3)
    assert freedoms(robot) == freedoms(arm()) == (3, 1, 1)
    assert {freedoms(rejointed(robot, way)) for way in WAYS} == {(3, 1, 1)}
    slides, hinge = robot.joints[:2], replace(robot.joints[2], point=np.ones(3))
    assert freedoms(replace(robot, joints=slides)) == (2, 0, 0)
    assert freedoms(replace(robot, joints=(hinge,))) == (1, 0, 1)
    # two hinges about one axis move the platform in one way
    assert freedoms(replace(robot, joints=(hinge, hinge))) == (1, 0, 1)


@pytest.mark.parametrize("seed", range(6))
def test_distances_and_their_derivatives_are_those_of_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "jointed")
    metre = np.where(robot.hinges, robot.length, 1.0)
    wanted, away = 0.4 * rng.normal(size=(2, 2, robot.n_dof)) * metre
    motion, rows, step = motion_of(robot, wanted / metre), np.arange(2), 1e-6 * robot.length
    apart = pose_difference(pose_of_values(robot, (wanted + away) / metre)[0], motion.poses)
    apart *= np.repeat([1.0, robot.length], 3)
    np.testing.assert_allclose(motion.apart(away, rows), apart, atol=1e-13 * robot.length)
    at = motion.directions(away, rows)
    assert at.basis is not None and at.squares is not None
    for k, along in enumerate(np.eye(robot.n_dof)):
        ends = [
            motion.stepped(away, rows, at.basis, np.tile(by * along, (2, 1)))
            for by in (step, -step)
        ]
        halves = [0.5 * motion.far(end, rows) ** 2 for end in ends]
        rate = (halves[0] - halves[1]) / (2.0 * step)
        np.testing.assert_allclose(at.slope[:, k], rate, rtol=1e-5, atol=1e-7 * robot.length)
        # a step moves the platform by its length
        moved = pose_difference(*(pose_of_values(robot, (wanted + end) / metre)[0] for end in ends))
        moved = np.linalg.norm(moved * np.repeat([1.0, robot.length], 3), axis=1)
        np.testing.assert_allclose(moved, 2.0 * step, rtol=1e-6)


def test_joints_that_can_be_moved_without_the_platform_are_left_alone() -> None:
    robot = load_robot("planar_vertical")
    twice = replace(robot, joints=(*robot.joints, robot.joints[2]))
    at = motion_of(twice, np.zeros((1, 4))).directions(np.zeros((1, 4)), np.zeros(1, dtype=np.intp))
    assert at.basis is not None and at.squares is not None
    np.testing.assert_allclose(np.linalg.eigvalsh(at.squares[0]), [0, 1, 1, 1], atol=1e-12)
    assert np.abs(at.basis).max() <= 1.0


@pytest.mark.parametrize("name", ["hinge first", "hinge beside", "both", "arm"])
def test_the_origin_is_kept_and_the_rotation_too_where_slides_are(name: str) -> None:
    robot = arm() if name == "arm" else rejointed(load_robot("planar_vertical"), name)
    rng, rows = np.random.default_rng(4), np.zeros(40, dtype=np.intp)
    away = 0.3 * robot.length * rng.normal(size=(40, 3))
    free, kept = (motion_of(robot, np.full((1, 3), 0.1), fix) for fix in (False, True))
    assert kept.is_in_place and not free.is_in_place and kept.free.tolist() == [0.0, 0.0, np.inf]
    assert free.allowed(away, rows) is away and not kept.are_allowed(away, rows).any()
    there = kept.allowed(away, rows)
    assert kept.are_allowed(there, rows).all()
    assert np.abs(kept.apart(there, rows)[:, :3]).max() < 1e-12
    if name != "arm":
        np.testing.assert_allclose(
            kept.apart(there, rows)[:, 3:], kept.apart(away, rows)[:, 3:], atol=1e-11
        )
    # the last direction turns about the origin, to first order as fast as it is followed
    basis, step = kept.directions(there, rows).basis, 1e-5 * robot.length
    assert basis is not None
    moved = kept.apart(there + step * basis[..., 2], rows) - kept.apart(there, rows)
    assert np.abs(moved[:, :3]).max() < 1e-3 * step
    np.testing.assert_allclose(np.linalg.norm(moved[:, 3:], axis=1), step, rtol=1e-3)


@pytest.mark.parametrize("prefer", ["pose", "position"])
@pytest.mark.parametrize("way", WAYS)
def test_the_nearest_pose_does_not_depend_on_the_joints(way: str, prefer: str) -> None:
    """It was the nearest in joint values: up to 62 times as far, and positions were not kept."""
    robot = load_robot("planar_vertical")
    other, tilts = rejointed(robot, way), np.array([0.5, -0.7, 0.35, 0.9])
    wanted = np.tile(robot.reference_pose, (4, 1))
    wanted[:, [0, 2]] += [[0.05, 0.02], [-0.1, 0.0], [0.12, -0.05], [0.0, 0.08]]
    wanted[:, 3:] = quat_from_rotvec(tilts[:, None] * [0.0, 1.0, 0.0])
    assert np.abs(values_of_pose(other, wanted)[0] - values_of_pose(robot, wanted)[0]).max() > 0.02
    limits = {"lowest": 0.5, "highest": 40.0, "prefer": prefer}
    mine, theirs = correct(other, wanted, **limits), correct(robot, wanted, **limits)
    assert not mine.held.any() and mine.stays.all() and mine.settled.all()
    metre = np.repeat([1.0, robot.length], 3)
    far = [np.linalg.norm(pose_difference(c.aimed, wanted) * metre, axis=1) for c in (mine, theirs)]
    np.testing.assert_allclose(far[0], far[1], rtol=1e-4)
    if prefer == "position":
        kept = np.abs(pose_difference(theirs.aimed, wanted)[:, :3]).max(axis=1) < 1e-9
        assert kept.any()
        assert np.abs(pose_difference(mine.aimed, wanted)[kept, :3]).max() < 1e-9
