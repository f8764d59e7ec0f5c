"""The static-feasible workspace, against linear programming and against where cables go slack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot
from scipy.optimize import linprog
from unbalanced import unbalanced

from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import quat_rotate
from seecr.workspace.margins import Zone, feasible, slack_zones, tension_margin, wrench_matrix

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cogiro() -> Robot:
    return load_robot(model_path("demobot_cogiro"))


@pytest.fixture(scope="module")
def parallel() -> Robot:
    return load_robot(model_path("demobot_parallel"))


def by_linear_programme(
    robot: Robot, pose: np.ndarray, low: float = 0.0, high: float | None = None
) -> bool:
    """Eq 3 by HiGHS, for a free platform."""
    matrix = wrench_matrix(robot, pose)[0]
    arm = quat_rotate(pose[3:], robot.centre_of_mass)
    weight = robot.mass * robot.gravity
    load = -np.concatenate([weight, np.cross(arm, weight)])
    unit = np.repeat([1.0, 1.0 / robot.length], 3)
    answer = linprog(np.zeros(robot.n_cables), A_eq=matrix * unit[:, None], b_eq=load * unit,
                     bounds=(low, high))  # fmt: skip
    assert answer.status in (0, 2), answer.message
    return bool(answer.status == 0)


def grid(count: int, seed: int, turn: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    places = rng.uniform([0.1, 0.08, 0.03], [0.7, 0.42, 0.4], (count, 3))
    quat = np.column_stack([np.ones(count), turn * rng.uniform(-1, 1, (count, 3))])
    return np.column_stack([places, quat / np.linalg.norm(quat, axis=1, keepdims=True)])


@pytest.mark.parametrize("bounds", [(0.0, None), (0.2, None), (0.0, 1.5), (0.1, 2.0)])
def test_as_linear_programming_says(
    cogiro: Robot, parallel: Robot, bounds: tuple[float, float | None]
) -> None:
    low, high = bounds
    seen = set()
    for robot, turn in ((cogiro, 0.03), (parallel, 0.0), (cogiro, 0.1)):
        poses = grid(60, 1, turn)
        found = feasible(robot, poses, lowest=low, highest=np.inf if high is None else high)
        expected = [by_linear_programme(robot, pose, low, high) for pose in poses]
        assert np.array_equal(found, expected)
        seen |= set(expected)
    assert seen == {True, False}


def test_wrench_matrix_is_equation_4(cogiro: Robot) -> None:
    pose = grid(1, 2, 0.2)[0]
    matrix = wrench_matrix(cogiro, pose)[0]
    arms = quat_rotate(pose[3:], cogiro.anchor_points)
    for i in range(8):
        cable = cogiro.exit_points[i] - (pose[:3] + arms[i])
        unit = cable / np.sqrt(cable @ cable)
        assert matrix[:, i] == pytest.approx([*unit, *np.cross(arms[i], unit)], abs=1e-15)


def test_whoever_rests_there_is_feasible_there() -> None:
    """The tensions at rest balance the load, at the pose where the platform ends."""
    for kind in KINDS:
        rng = np.random.default_rng(3)
        robot = random_robot(rng, kind)
        answer = solve(robot, random_poses(rng, robot, 10))
        assert np.all(answer.converged)
        assert np.all(unbalanced(robot, answer.pose) < 1e-8)
        pulls = answer.tensions.max(axis=1)
        for pose, pull in zip(answer.pose, pulls, strict=True):
            assert unbalanced(robot, pose, highest=1.01 * pull)[0] < 1e-8
            assert unbalanced(robot, pose, highest=0.01 * pull)[0] > 1e-2


def test_cogiro_is_feasible_all_along_the_papers_trajectory_and_parallel_is_not(
    cogiro: Robot, parallel: Robot
) -> None:
    """Figs 10 and 11: the parallel one leaves its workspace where cables go slack and it tilts."""
    poses = np.array([[x, 0.25, 0.1, 1, 0, 0, 0] for x in np.linspace(0.17, 0.63, 47)])
    assert np.all(feasible(cogiro, poses))
    inside = feasible(parallel, poses)
    answer = solve(parallel, poses)
    zones = slack_zones(answer)
    assert [zone.slack for zone in zones] == [4, 2, 0, 2, 4]
    tilt = np.rad2deg(np.abs(answer.deviation[:, 4]))
    assert inside[zones[2].first : zones[2].last + 1].all()
    assert not inside[answer.slack.sum(axis=1) == 4].any()
    assert tilt[inside].max() < 2.5 and tilt[~inside].max() > 26


def test_an_outer_wrench_and_an_offset_load_move_the_workspace(cogiro: Robot) -> None:
    pose = np.array([[0.4, 0.25, 0.1, 1, 0, 0, 0]])
    assert feasible(cogiro, pose)[0]
    assert not feasible(cogiro, pose, wrench=[0, 0, 10, 0, 0, 0])[0]  # lifts: cables cannot push
    assert unbalanced(cogiro, pose, wrench=[0, 0, 10, 0, 0, 0])[0] == pytest.approx(1.0)
    assert not feasible(replace(cogiro, centre_of_mass=np.array([0.2, 0, 0])), pose)[0]
    rows = feasible(cogiro, np.repeat(pose, 2, axis=0), wrench=[[0] * 6, [0, 0, 10, 0, 0, 0]])
    assert np.array_equal(rows, [True, False])


def test_what_joints_carry_needs_no_cable() -> None:
    """A cart on a rail under one cable: the rail takes all but the pull along it."""
    robot = load_robot(model_path("planar_two_cable"))
    rail = replace(robot, joints=(replace(robot.joints[0]),))
    pose = np.array([[0.5, 0, 0.5, 1, 0, 0, 0], [0.3, 0, 0.5, 1, 0, 0, 0]])
    assert np.all(feasible(rail, pose, lowest=0.0))
    pushed = feasible(rail, pose, wrench=[5.0, 0, 0, 0, 0, 0])
    assert np.all(pushed)  # the cable on the other side holds it
    one = replace(
        rail, exit_points=rail.exit_points[:1], anchor_points=rail.anchor_points[:1],
        ea=rail.ea[:1], rest_lengths=rail.rest_lengths[:1], cable_names=(),
    )  # fmt: skip
    assert np.all(feasible(one, pose, wrench=[5.0, 0, 0, 0, 0, 0]))
    assert not feasible(one, pose, wrench=[-5.0, 0, 0, 0, 0, 0]).any()
    # the bar itself is under-actuated: level it is feasible in the middle only
    assert np.array_equal(feasible(robot, pose), [True, False])


def test_zones_count_only_where_there_is_an_answer(parallel: Robot) -> None:
    poses = np.array([[x, 0.25, 0.1, 1, 0, 0, 0] for x in (0.17, 0.4, 0.41, 0.63)])
    assert slack_zones(solve(parallel, poses)) == [Zone(0, 0, 4), Zone(1, 2, 0), Zone(3, 3, 4)]
    stopped = solve(parallel, poses, max_iterations=1)
    assert slack_zones(stopped) == [Zone(0, 3, None)]
    assert slack_zones(solve(parallel, np.zeros((0, 7)))) == []


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"poses": [[0.0, 1]]}, r"poses must be \(n, 7\), x y z qw qx qy qz, got \(1, 2\)"),
        ({"poses": [np.nan] * 7}, r"poses holds numbers that are not finite"),
        ({"poses": [0.4, 0.25, 0.1, 0, 0, 0, 0]}, r"poses row 0 has a quaternion of norm 0"),
        ({"wrench": [1.0]}, r"wrench must be \(6,\) or \(1, 6\) finite numbers, got \(1,\)"),
        ({"lowest": [0.0, 1.0]}, r"lowest must be one number or \(8,\) \[N\], got \(2,\)"),
        ({"lowest": -1.0}, r"tension bounds must be 0 <= lowest <= highest"),
        ({"lowest": 2.0, "highest": 1.0}, r"tension bounds must be 0 <= lowest <= highest"),
        ({"highest": np.nan}, r"tension bounds must be 0 <= lowest <= highest"),
    ],
)
def test_bad_input(cogiro: Robot, arguments: dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        feasible(cogiro, **{"poses": [0.4, 0.25, 0.1, 1, 0, 0, 0], **arguments})


def test_a_cable_without_a_length_holds_nothing() -> None:
    robot = load_robot(model_path("camera"))
    at = np.concatenate([robot.exit_points[0], [1.0, 0.0, 0.0, 0.0]])
    # the three others pull sideways alone
    assert tension_margin(robot, at)[0] == -np.inf
    assert not feasible(robot, at)[0]
