"""Poses are chosen against gravity, whichever way that is in the base frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rejointed import WAYS, rejointed
from turned import turned

from crosscheck.planning.design import candidate_poses
from crosscheck.planning.places import box_around, upright
from crosscheck.planning.room import Room
from seecr.description.mjcf import load_robot

# without its floor, which is a height along z
COGIRO = replace(load_robot("demobot_cogiro"), floor=None)


@pytest.mark.parametrize("gravity", [[0, 0, -9.81], [0, 0, 0]])
def test_where_gravity_is_along_minus_z_the_axes_are_those_of_the_base_frame(
    gravity: list[float],
) -> None:
    assert np.array_equal(upright(replace(COGIRO, gravity=np.array(gravity, float))), np.eye(3))


@pytest.mark.parametrize("gravity", [[0, 0, 9.81], [0, -9.81, 0], [-9.81, 0, 0], [3, 4, -8]])
def test_the_last_axis_is_against_gravity(gravity: list[float]) -> None:
    robot = replace(COGIRO, gravity=np.array(gravity, float))
    axes = upright(robot)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(axes[:, 2], robot.up, atol=1e-15)
    if np.count_nonzero(gravity) == 1:
        assert np.array_equal(axes, axes.round())


def test_a_box_is_inside_the_one_around_it() -> None:
    low, high = np.array([-0.1, 0.2, 0.3]), np.array([0.7, 0.5, 0.4])
    assert np.array_equal(box_around(low, high, np.eye(3)), (low, high))
    down = np.diag([1.0, -1.0, -1.0])
    assert np.array_equal(box_around(low, high, down), ([-0.1, -0.5, -0.4], [0.7, -0.2, -0.3]))


@pytest.mark.parametrize("name", ["demobot_cogiro", "planar_vertical"])
def test_candidates_of_a_robot_with_z_down_are_those_of_the_same_one_with_z_up(name: str) -> None:
    robot = replace(load_robot(name), floor=None)
    other, turn = turned(robot, [np.pi, 0.0, 0.0])
    own, there = (candidate_poses(Room.of(one)) for one in (robot, other))
    np.testing.assert_allclose(there[:, :3], own[:, :3] @ turn.T, atol=1e-12)


@pytest.mark.parametrize("rotvec", [[np.pi, 0.0, 0.0], [0.0, 0.5, 0.2]])
def test_candidates_are_as_far_below_and_above_home_whichever_way_that_is(
    rotvec: list[float],
) -> None:
    other, _turn = turned(COGIRO, rotvec)
    heights = [
        (candidate_poses(Room.of(robot))[:, :3] - robot.reference_pose[:3]) @ robot.up
        for robot in (COGIRO, other)
    ]
    np.testing.assert_allclose(*(np.unique(some.round(9)) for some in heights), atol=1e-9)


@pytest.mark.parametrize("way", WAYS)
def test_poses_of_robots_on_joints_stay_in_the_box_that_was_asked_for(way: str) -> None:
    """A hinge beside the origin, or before the slides, carried half of them out of it."""
    planar = load_robot("planar_vertical")
    middle, half = planar.reference_pose[:3], np.array([0.02, 1.0, 0.02])
    box = np.array([middle - half, middle + half])
    room = Room.of(rejointed(planar, way), box=box, tilt=0.2)
    place = candidate_poses(room)[:, :3]
    assert len(place) > 30 and np.all((place >= box[0]) & (place <= box[1]))
