"""The static-feasible workspace, against linear programming and against where cables go slack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_robots import KINDS, random_poses, random_robot
from unbalanced import unbalanced

from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import quat_rotate
from seecr.workspace.margins import Zone, feasible, slack_zones, tension_margin, wrench_matrix

COGIRO, PARALLEL = (load_robot(f"demobot_{name}") for name in ("cogiro", "parallel"))

pytestmark = pytest.mark.slow


def grid(count: int, seed: int, turn: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    places = rng.uniform([0.1, 0.08, 0.03], [0.7, 0.42, 0.4], (count, 3))
    quat = np.column_stack([np.ones(count), turn * rng.uniform(-1, 1, (count, 3))])
    return np.column_stack([places, quat / np.linalg.norm(quat, axis=1, keepdims=True)])


def test_wrench_matrix_is_equation_4() -> None:
    pose = grid(1, 2, 0.2)[0]
    matrix = wrench_matrix(COGIRO, pose)[0]
    arms = quat_rotate(pose[3:], COGIRO.anchor_points)
    for i in range(8):
        cable = COGIRO.exit_points[i] - (pose[:3] + arms[i])
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


def test_cogiro_is_feasible_all_along_the_papers_trajectory_and_parallel_is_not() -> None:
    """Figs 10 and 11: the PARALLEL one leaves its workspace where cables go slack and it tilts."""
    poses = np.array([[x, 0.25, 0.1, 1, 0, 0, 0] for x in np.linspace(0.17, 0.63, 47)])
    assert np.all(feasible(COGIRO, poses))
    inside = feasible(PARALLEL, poses)
    answer = solve(PARALLEL, poses)
    zones = slack_zones(answer)
    assert [zone.slack for zone in zones] == [4, 2, 0, 2, 4]
    tilt = np.rad2deg(np.abs(answer.deviation[:, 4]))
    assert inside[zones[2].first : zones[2].last + 1].all()
    assert not inside[answer.slack.sum(axis=1) == 4].any()
    assert tilt[inside].max() < 2.5 and tilt[~inside].max() > 26


def test_an_outer_wrench_and_an_offset_load_move_the_workspace() -> None:
    pose = np.array([[0.4, 0.25, 0.1, 1, 0, 0, 0]])
    assert feasible(COGIRO, pose)[0]
    assert not feasible(COGIRO, pose, wrench=[0, 0, 10, 0, 0, 0])[0]  # lifts: cables cannot push
    assert unbalanced(COGIRO, pose, wrench=[0, 0, 10, 0, 0, 0])[0] == pytest.approx(1.0)
    assert not feasible(replace(COGIRO, centre_of_mass=np.array([0.2, 0, 0])), pose)[0]
    rows = feasible(COGIRO, np.repeat(pose, 2, axis=0), wrench=[[0] * 6, [0, 0, 10, 0, 0, 0]])
    assert np.array_equal(rows, [True, False])


def test_what_joints_carry_needs_no_cable() -> None:
    """A cart on a rail under one cable: the rail takes all but the pull along it."""
    robot = load_robot("planar_two_cable")
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


def test_zones_count_only_where_there_is_an_answer() -> None:
    poses = np.array([[x, 0.25, 0.1, 1, 0, 0, 0] for x in (0.17, 0.4, 0.41, 0.63)])
    assert slack_zones(solve(PARALLEL, poses)) == [Zone(0, 0, 4), Zone(1, 2, 0), Zone(3, 3, 4)]
    stopped = solve(PARALLEL, poses, max_iterations=1)
    assert slack_zones(stopped) == [Zone(0, 3, None)]
    assert slack_zones(solve(PARALLEL, np.zeros((0, 7)))) == []


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
def test_bad_input(arguments: dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        feasible(COGIRO, **{"poses": [0.4, 0.25, 0.1, 1, 0, 0, 0], **arguments})


def test_a_cable_without_a_length_holds_nothing() -> None:
    robot = load_robot("camera")
    at = np.concatenate([robot.exit_points[0], [1.0, 0.0, 0.0, 0.0]])
    # the three others pull sideways alone
    assert tension_margin(robot, at)[0] == -np.inf
    assert not feasible(robot, at)[0]
