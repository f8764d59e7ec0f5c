"""A solution recomputed: in extended precision, as SciPy and MuJoCo have it, red where it errs."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import seecr
from seecr import Robot, Solution, load_robot, solve
from seecr.pose import Array

LONG = np.longdouble


def rotation(quat: np.ndarray) -> np.ndarray:
    w, x, y, z = quat.astype(LONG)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=LONG)
    return np.eye(3, dtype=LONG) + 2 * (w * cross + cross @ cross) / (w * w + x * x + y * y + z * z)


def unbalanced(robot: Robot, found: Solution, k: int) -> float:
    """Force, or torque over the robot's length, at the pose of row k, relative to the weight."""
    exits, anchors = robot.exit_points.astype(LONG), robot.anchor_points.astype(LONG)

    def ways(pose: np.ndarray) -> np.ndarray:
        return exits - pose[:3].astype(LONG) - anchors @ rotation(pose[3:]).T

    def lengths(pose: np.ndarray) -> np.ndarray:
        return np.sqrt((ways(pose) ** 2).sum(axis=1))

    wound = lengths(found.command[k]) - lengths(robot.reference_pose)
    rest = robot.rest_lengths.astype(LONG) + wound
    length, turn = lengths(found.pose[k]), rotation(found.pose[k, 3:])
    pull = robot.ea * np.maximum(length - rest, 0) / rest
    forces = (pull / length)[:, None] * ways(found.pose[k])
    weight = LONG(robot.mass) * robot.gravity.astype(LONG)
    torque = np.cross(anchors @ turn.T, forces).sum(axis=0)
    torque += np.cross(turn @ robot.centre_of_mass.astype(LONG), weight)
    sizes = [np.sqrt((one**2).sum()) for one in (forces.sum(axis=0) + weight, torque)]
    return float(max(sizes[0], sizes[1] / LONG(robot.length)) / np.sqrt((weight**2).sum()))


@pytest.mark.skipif(np.finfo(LONG).eps > 1e-18, reason="no extended precision on this machine")
@pytest.mark.parametrize("name", ["demobot_parallel", "cogiro_large", "ipanema"])
@pytest.mark.parametrize("ea", [1e5, 1e7])
def test_the_balance_that_is_told_is_true(name: str, ea: float) -> None:
    robot = load_robot(name)
    robot = replace(robot, ea=np.full(robot.n_cables, ea))
    poses = np.tile(robot.reference_pose, (12, 1))
    poses[:, :3] += np.random.default_rng(0).uniform(-0.05, 0.05, (12, 3))
    found = solve(robot, poses)
    true = np.array([unbalanced(robot, found, k) for k in range(len(found))])
    rows = found.converged
    assert rows.sum() > 5
    assert np.all(true[rows] < found.balance[rows])
    # and it is no excuse: at most a few dozen times what is there
    assert found.balance[rows].max() < 50.0 * true[rows].max()
    told = re.search(r"forces balance to (\S+) of the load", str(found))
    assert told is not None and float(told[1]) == pytest.approx(found.balance[rows].max(), rel=0.5)


@pytest.mark.skipif(np.finfo(LONG).eps > 1e-18, reason="no extended precision on this machine")
def test_the_residual_alone_would_not_be_true() -> None:
    """1e-15 was printed of a robot of E S = 1e7 N whose forces balance to 1e-9."""
    robot = load_robot("demobot_parallel")
    robot = replace(robot, ea=np.full(robot.n_cables, 1e7))
    found = solve(robot, robot.reference_pose + np.array([0.01, 0.02, 0.01, 0, 0, 0, 0]))
    assert unbalanced(robot, found, 0) > 100.0 * found.residual[0]


# --- A solution recomputed, as SciPy and MuJoCo have it, and red where it is not at rest


ROBOTS = ["demobot_parallel", "demobot_cogiro", "ipanema", "camera", "planar_vertical",
          "planar_two_cable"]  # fmt: skip


def poses_of(robot: seecr.Robot) -> Array:
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, 0] += np.array([0.0, 0.05, -0.04]) * robot.reach
    return poses


@pytest.mark.parametrize("name", ROBOTS)
def test_it_agrees_with_the_solver(name: str) -> None:
    robot = seecr.load_robot(name)
    found = seecr.solve(robot, poses_of(robot))
    said = found.verify()
    assert said.holds.all() and said.verified.all() and said.residual.max() < 1e-9
    assert said.smallest_eigenvalue == pytest.approx(found.smallest_eigenvalue, rel=1e-6)
    assert str(said).startswith("3 of 3 poses verified: at rest and stable")
    assert [row["holds"] for row in said.records()] == [True] * 3


@pytest.mark.parametrize("name", ROBOTS)
def test_a_pose_that_was_tampered_with_does_not_hold(name: str) -> None:
    robot = seecr.load_robot(name)
    found = seecr.solve(robot, poses_of(robot))
    moved = found.pose.copy()
    moved[1, 0] += 1e-6 * robot.reach
    said = replace(found, pose=moved).verify()
    assert said.holds.tolist() == [True, False, True]
    assert "pose 1 does not hold: unbalanced" in str(said)


def test_the_unbalanced_force_is_that_of_mujoco() -> None:
    """MuJoCo's own springs at a pose a tenth of a millimetre off."""
    robot = seecr.load_robot("demobot_cogiro")
    found = seecr.solve(robot, robot.reference_pose)
    moved = found.pose + np.array([1e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    said = replace(found, pose=moved).verify()
    model = mujoco.MjModel.from_xml_path(str(robot.source))
    data = mujoco.MjData(model)
    data.qpos[:] = moved[0]
    mujoco.mj_forward(model, data)
    applied = data.qfrc_passive - data.qfrc_bias
    turn = Rotation.from_quat(moved[0, [4, 5, 6, 3]])
    # of a free joint MuJoCo's moment is in the platform's axes, about its origin
    moment = turn.apply(applied[3:]) / robot.length
    off = np.abs([*applied[:3], *moment]).max()
    tension = model.tendon_stiffness * (data.ten_length - model.tendon_lengthspring[:, 1])
    largest = max(float(tension.max()), robot.weight)
    assert said.residual[0] == pytest.approx(off / largest, rel=1e-5)
    assert not said.holds[0]


def test_what_balances_but_falls_does_not_hold() -> None:
    """A bar on two crossed cables is in balance upside down, too."""
    robot = seecr.load_robot("planar_two_cable")
    found = seecr.solve(robot, robot.reference_pose)
    turned = replace(
        robot, anchor_points=-robot.anchor_points, centre_of_mass=np.array([0, 0, 0.3])
    )
    over = seecr.solve(turned, robot.reference_pose)
    said = found.verify(), over.verify()
    assert said[0].holds.all()
    assert np.array_equal(said[1].holds, over.converged)


def test_effects_that_edit_points_lengths_and_loads_are_verified() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    values = {"platform_mass": [0.05], "stiffness": [0.8], "length_scale": [1.001],
              "nonlinear_elasticity": [3.0, 50.0]}  # fmt: skip
    effects = [seecr.Term(seecr.layout_of(name, robot), one) for name, one in values.items()]
    found = seecr.solve(robot, poses_of(robot), effects=effects)
    assert found.verify().holds.all()
    # the plain robot does not rest there
    tables = seecr.solve(robot, poses_of(robot)).tables
    assert not replace(found, tables=tables).verify().holds.any()


@pytest.mark.parametrize(
    ("effect", "values", "name"),
    [
        ("pulley_radius", [0.01], "pulleys"),
        ("cable_weight", [0.01], "cable weight"),
        ("hysteresis", [0.1, 1e-4], "hysteresis"),
        ("winch_side_length", [0.5], "cable behind the exit point"),
        ("frame_compliance", [1e-5, 1e-5], "yielding exit points"),
    ],
)
def test_what_it_cannot_verify_is_said(effect: str, values: list[float], name: str) -> None:
    robot = seecr.load_robot("demobot_cogiro")
    more = seecr.Term(seecr.layout_of(effect, robot), values)
    said = seecr.solve(robot, poses_of(robot), effects=[more]).verify()
    assert not said.holds.any() and not said.verified.any()
    assert np.isnan(said.residual).all()
    assert f"not verified: cables with {name}; only straight ones are computed again" in str(said)


def test_a_pose_that_the_joints_do_not_reach_is_not_verified() -> None:
    robot = seecr.load_robot("planar_vertical")
    found = seecr.solve(robot, poses_of(robot))
    off = found.pose + np.array([0.0, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    said = replace(found, pose=off).verify()
    assert not said.holds.any() and "no joint values lead to its pose" in said.why_not[0]
    lost = replace(found, pose=np.full_like(off, np.nan)).verify()
    assert not lost.holds.any() and lost.why_not == ("it has no pose",) * 3
