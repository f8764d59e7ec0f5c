"""The robot as numbers: what it refuses, its lengths, and its own size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot

from seecr.description.joints import motion_columns, pose_of_values, values_of_pose
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Joint, Robot
from seecr.errors import InputError, RobotError
from seecr.pose import pose_difference


def one_cable(**changes: Any) -> Robot:
    numbers: dict[str, Any] = {
        "name": "bob",
        "exit_points": [[0.0, 0, 1]],
        "anchor_points": [[0.0, 0, 0]],
        "ea": [100.0],
        "rest_lengths": [1.0],
        "mass": 2.0,
    }
    return Robot(**{**numbers, **changes})


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"anchor_points": [[0.0, 0]]}, InputError, r"anchor_points must be \(1, 3\), got \("),
        ({"ea": [1.0, 2.0]}, InputError, r"ea must be \(1,\), got \(2,\)"),
        ({"ea": [np.nan]}, InputError, "stiffness x rest length of cable1 holds a number"),
        ({"ea": [1e300]}, InputError, "stiffness x rest length of cable1 holds .* beyond 1e.30"),
        ({"rest_lengths": [1e31]}, InputError, "rest_lengths of cable1 holds a number"),
        ({"mass": 1e300}, RobotError, r"expected a mass from 0 to 1e\+30 kg, got 1e\+300 kg"),
        ({"gravity": [0.0, 0, np.inf]}, InputError, "gravity holds a number that is not finite"),
        ({"reference_pose": np.zeros(6)}, InputError, r"reference_pose must be \(7,\), got \(6,\)"),
        ({"ea": [0.0]}, RobotError, "cable1 has stiffness 0 N; expected .* above zero"),
        ({"rest_lengths": [-1.0]}, RobotError, "cable1 has rest length -1 m; expected a positive"),
        ({"mass": -1.0}, RobotError, "expected a mass from 0 to 1e\\+30 kg, got -1 kg"),
        ({"mass": np.nan}, RobotError, "expected a mass from 0 to 1e\\+30 kg, got nan kg"),
        ({"exit_points": [[0.0, 0, 0]]}, RobotError, "cable1 has its anchor point on its exit"),
        (
            {"exit_points": np.zeros((0, 3)), "anchor_points": np.zeros((0, 3)), "ea": [],
             "rest_lengths": []},
            RobotError, "expected at least one cable, got none",
        ),
    ],
)  # fmt: skip
def test_what_is_no_robot(changes: dict[str, Any], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=f"^robot bob: .*{text}") as caught:
        one_cable(**changes)
    assert "\n" not in str(caught.value)


def test_arrays_are_frozen_copies() -> None:
    mine = np.array([[0.0, 0, 1]])
    robot = one_cable(exit_points=mine)
    mine[0, 2] = 5.0
    assert robot.exit_points[0, 2] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        robot.exit_points[0, 2] = 5.0
    assert replace(robot, mass=3.0).mass == 3.0 and robot.mass == 2.0


def test_names_weight_and_degrees_of_freedom() -> None:
    robot = one_cable(gravity=[0.0, 3, -4])
    assert robot.cable_names == ("cable1",) and robot.n_cables == 1
    assert robot.weight == 10.0 and robot.n_dof == 6
    hinge = Joint("hinge", "h", np.array([0.0, 1, 0]), np.zeros(3))
    assert one_cable(joints=(hinge,)).n_dof == 1


def test_own_length_is_half_the_largest_anchor_distance() -> None:
    robot = load_robot(model_path("planar_two_cable"))
    assert robot.length == pytest.approx(0.1, rel=1e-15)
    assert one_cable().length == 0.01  # one anchor point: a hundredth of the way to the exit
    hung_from_its_origin = one_cable(exit_points=[[0.0, 0, 0]], anchor_points=[[0.0, 0, -3]])
    assert hung_from_its_origin.length == pytest.approx(0.03)


@pytest.mark.parametrize("kind", KINDS)
def test_lengths_are_those_of_equations_1_and_2(kind: str) -> None:
    rng = np.random.default_rng(1)
    robot = random_robot(rng, kind)
    for pose, lengths in zip(*_with_lengths(rng, robot), strict=True):
        w, x, y, z = pose[3:]
        turn = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])  # fmt: skip
        anchors = robot.anchor_points @ turn.T + pose[:3]
        assert lengths == pytest.approx(
            np.linalg.norm(robot.exit_points - anchors, axis=1), rel=1e-14
        )


def _with_lengths(rng: np.random.Generator, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    poses = random_poses(rng, robot, 5)
    return poses, robot.nominal_lengths(poses)


def test_commanded_lengths_keep_the_pretension_of_the_reference_pose() -> None:
    rng = np.random.default_rng(2)
    plain = random_robot(rng)
    tight = replace(plain, rest_lengths=plain.rest_lengths - 0.01)
    poses = random_poses(rng, plain, 4)
    assert plain.commanded_lengths(poses) == pytest.approx(plain.nominal_lengths(poses), rel=1e-15)
    shorter = plain.nominal_lengths(poses) - tight.commanded_lengths(poses)
    assert shorter == pytest.approx(np.full(shorter.shape, 0.01), abs=1e-14)


# --- joints ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_joint_values_and_poses_are_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "jointed")
    values = rng.uniform(-0.3, 0.3, (5, robot.n_dof))
    poses, _ = pose_of_values(robot, values)
    back, screws = values_of_pose(robot, poses)
    assert pose_difference(pose_of_values(robot, back)[0], poses) == pytest.approx(0, abs=1e-12)
    assert screws.shape == (5, robot.n_dof, 7)


def test_motion_columns_against_finite_differences() -> None:
    rng = np.random.default_rng(3)
    robot = random_robot(rng, "jointed")
    values = rng.uniform(-0.3, 0.3, robot.n_dof)
    pose, screws = pose_of_values(robot, values)
    columns = motion_columns(screws, pose[:, :3])[0]
    for j in range(robot.n_dof):
        step = 1e-6 * np.eye(robot.n_dof)[j]
        ahead, behind = (pose_of_values(robot, values + s)[0] for s in (step, -step))
        assert columns[:, j] == pytest.approx(pose_difference(ahead, behind)[0] / 2e-6, abs=1e-8)


def test_a_pose_off_the_joints_is_named() -> None:
    robot = load_robot(model_path("planar_vertical"))
    with pytest.raises(InputError, match=r"reach commanded pose 1, it is off by 0.1 m in y; exp"):
        values_of_pose(robot, np.array([[0.4, 0, 0.1, 1, 0, 0, 0], [0.4, 0.1, 0.1, 1, 0, 0, 0]]))
    turned = np.array([[0.4, 0, 0.1, np.cos(0.1), np.sin(0.1), 0, 0]])
    with pytest.raises(
        InputError, match=r"cannot reach the commanded pose, it is off by 0.2 rad in x"
    ):
        values_of_pose(robot, turned)


def test_a_point_mass_on_a_free_joint_is_told_its_cure() -> None:
    """It is free to turn at every pose; without joints that turn it is none of these."""
    camera = load_robot("camera")
    loose = replace(camera, joints=())
    assert not camera.is_point and camera.notes == ()
    assert loose.is_point
    (note,) = loose.notes
    assert "anchored at one point" in note and "three slide joints instead of the free" in note
    apart = loose.anchor_points.copy()
    apart[0, 0] += 0.05
    assert not replace(loose, anchor_points=apart).is_point


def test_a_robot_prints_as_a_few_lines() -> None:
    """It had been all of its arrays."""
    assert str(load_robot(model_path("planar_vertical"))).splitlines() == [
        "planar_vertical: 4 cables, a platform on joints (slide x, slide z, hinge tilt) of 0.4 kg",
        "exit points: x 0.04 to 0.76, y 0, z 0.45 to 0.486 m",
        "at the reference pose, x y z 0.4 0 0.15 m, cables are 0.4431 m long",
        "E S: 3000 N",
    ]
    assert "8 cables, a free platform of 0.4 kg" in repr(load_robot(model_path("demobot_cogiro")))
