"""Frequencies of small vibrations: closed forms, and MuJoCo's own inertia and stiffness."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from rejointed import WAYS, rejointed

import seecr
from crosscheck.settle.newton import stiffness
from crosscheck.settle.physics import Physics
from seecr.effects.setup import plain_setup
from seecr.pose import Array, quat_from_rotvec
from seecr.show.pose_words import direction_words, stiffness_lines
from seecr.statics.tables import assemble
from seecr.statics.vibration import mass_matrices

BOB = seecr.Robot(
    "bob", np.array([[0.0, 0, 1]]), np.zeros((1, 3)), np.array([100.0]), np.ones(1), 2.0,
    inertia=0.01 * np.eye(3),
)  # fmt: skip


def test_a_bob_swings_as_a_pendulum_and_bounces_on_its_cable() -> None:
    found = seecr.solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]])
    length = 1.0 + BOB.weight / 100.0
    pendulum, bounce = np.sqrt([9.81 / length, 100.0 / 2.0]) / (2.0 * np.pi)
    np.testing.assert_allclose(
        found.frequencies[0], [0, 0, 0, pendulum, pendulum, bounce], rtol=1e-9, atol=1e-9
    )
    assert direction_words(BOB, found.modes[1][0, :, 5]) == "move along z"
    assert next(stiffness_lines(found)).startswith("free to turn about ")


def test_free_to_turn_beside_a_cable_that_just_becomes_taut_has_no_frequency() -> None:
    """Two cables hold it, a third is exactly as long as its rest length."""
    robot = seecr.load_robot("demobot_parallel")
    found = seecr.solve(robot, [[0.225, 0.35, 0.1, 1, 0, 0, 0]])
    assert found.status[0] is seecr.Status.SINGULAR and np.sum(~found.slack) == 2
    assert found.frequencies[0, 0] == 0.0 < found.frequencies[0, 1]
    assert np.linalg.eigvalsh(found.stiffness[0])[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["demobot_parallel", "demobot_off_centre", "planar_vertical"])
def test_mujocos_inertia_and_stiffness_give_the_same(name: str) -> None:
    path = seecr.model_path(name)
    robot = seecr.load_robot(path)
    pose = robot.reference_pose + np.array([0.03, 0, 0.02, 0, 0, 0, 0])
    found = seecr.solve(robot, pose)
    assert found.converged[0]
    physics = Physics.of(path)
    physics.set_cables(found.rest_lengths[0], robot.ea)
    physics.place(found.pose[0])
    mujoco.mj_forward(physics.model, physics.data)
    mass = np.zeros((physics.n_dof, physics.n_dof))
    mujoco.mj_fullM(physics.model, physics.data, mass)
    metre = physics.metre[:, None] * physics.metre
    slope = stiffness(physics, ~found.slack[0]) * metre / physics.mass_unit
    squares = np.linalg.eigvals(np.linalg.solve(mass, slope)).real
    np.testing.assert_allclose(
        np.sqrt(np.sort(squares)) / (2.0 * np.pi), found.frequencies[0], rtol=1e-4
    )


def test_a_heavier_platform_vibrates_with_its_own_mass() -> None:
    added = seecr.Term.of(BOB, "platform_mass", added_kg=2.0)
    found = seecr.solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]], effects=[added])
    assert found.frequencies[0, -1] == pytest.approx(np.sqrt(100.0 / 4.0) / (2.0 * np.pi))


def test_an_inertia_that_nobody_said_is_asked_for() -> None:
    found = seecr.solve(replace(BOB, inertia=np.zeros((3, 3))), [[0.0, 0, 0, 1, 0, 0, 0]])
    with pytest.raises(seecr.InputError, match="robot bob: its inertia is not known"):
        _ = found.frequencies


# --- The mass matrix: kinetic energy of motions whose velocities are known


ASIDE = np.array([0.1, -0.2, 0.3])
FREE = replace(
    seecr.load_robot("demobot_cogiro"), mass=2.0, centre_of_mass=ASIDE,
    inertia=np.diag([0.01, 0.02, 0.04]), joints=(),
)  # fmt: skip


def matrix(robot: seecr.Robot, pose: Array) -> Array:
    tables = assemble(plain_setup(robot, seecr.Commands(pose[None])))
    return mass_matrices(robot, tables, pose[None])[0]


def turned() -> Array:
    pose = FREE.reference_pose.copy()
    pose[3:] = quat_from_rotvec(np.array([[0.4, -0.7, 0.2]]))[0]
    return pose


def test_without_gravity_the_mass_is_that_of_the_description() -> None:
    floating = replace(FREE, gravity=np.zeros(3))
    assert matrix(floating, turned()) == pytest.approx(matrix(FREE, turned()))


# --- The softest motion is the platform's, whatever joints it is on


POSES = np.array([[0.05, 0.02, 0.3], [-0.1, 0.0, -0.5], [0.0, 0.08, 0.0]])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["planar_vertical", "planar_two_cable"])
def test_the_softest_motion_does_not_depend_on_the_joints(name: str, way: str) -> None:
    """With the hinge first it had a third to a thirtieth of the stiffness."""
    robot = seecr.load_robot(name)
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[:, [0, 2]] += POSES[:, :2]
    poses[:, 3:] = quat_from_rotvec(POSES[:, 2:] * [0.0, 1.0, 0.0])
    here, there = seecr.solve(robot, poses), seecr.solve(rejointed(robot, way), poses)
    assert here.converged.all() and there.softest_direction.shape == (3, 6)
    np.testing.assert_allclose(there.smallest_eigenvalue, here.smallest_eigenvalue, rtol=1e-9)
    np.testing.assert_allclose(there.softest_direction, here.softest_direction, atol=1e-6)
    metre = np.repeat([1.0, robot.length], 3)
    assert np.linalg.norm(there.softest_direction * metre, axis=1) == pytest.approx(1.0)
    # it is the motion of the joints whose stiffness that is
    for one in (here, there):
        value, vectors = np.linalg.eigh(one.stiffness[0])
        moved = one.motion(0, vectors[:, 0]) * metre
        assert value[0] >= one.smallest_eigenvalue[0] * (moved @ moved) * (1.0 - 1e-9)
    assert list(stiffness_lines(here.rows([0]))) == list(stiffness_lines(there.rows([0])))


def test_maps_have_the_platforms_motion() -> None:
    robot = seecr.load_robot("planar_vertical")
    at = [np.linspace(k - 0.05, k + 0.05, 3) for k in robot.reference_pose[[0, 2]]]
    grid = (at[0], robot.reference_pose[1], at[1])
    here, there = (seecr.workspace_map(one, *grid) for one in (robot, rejointed(robot, "both")))
    assert there.softest.shape == (3, 1, 3, 6)
    np.testing.assert_allclose(there.stiffness, here.stiffness, rtol=1e-5)
    np.testing.assert_allclose(there.softest, here.softest, atol=1e-4)
    assert there.records()[0]["softest_ry_rad"] == there.softest[0, 0, 0, 4]
