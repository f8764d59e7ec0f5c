"""Frequencies of small vibrations: closed forms, and MuJoCo's own inertia and stiffness."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from crosscheck.settle.newton import stiffness
from crosscheck.settle.physics import Physics
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.show.pose_words import direction_words, stiffness_lines
from seecr.statics.solution import Status

BOB = Robot(
    "bob", np.array([[0.0, 0, 1]]), np.zeros((1, 3)), np.array([100.0]), np.ones(1), 2.0,
    inertia=0.01 * np.eye(3),
)  # fmt: skip


def test_a_bob_swings_as_a_pendulum_and_bounces_on_its_cable() -> None:
    found = solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]])
    length = 1.0 + BOB.weight / 100.0
    pendulum, bounce = np.sqrt([9.81 / length, 100.0 / 2.0]) / (2.0 * np.pi)
    np.testing.assert_allclose(
        found.frequencies[0], [0, 0, 0, pendulum, pendulum, bounce], rtol=1e-9, atol=1e-9
    )
    assert direction_words(BOB, found.modes[1][0, :, 5]) == "move along z"
    assert next(stiffness_lines(found)).startswith("free to turn about ")


def test_free_to_turn_beside_a_cable_that_just_becomes_taut_has_no_frequency() -> None:
    """Two cables hold it, a third is exactly as long as its rest length."""
    robot = load_robot(model_path("demobot_parallel"))
    found = solve(robot, [[0.225, 0.35, 0.1, 1, 0, 0, 0]])
    assert found.status[0] is Status.SINGULAR and np.sum(~found.slack) == 2
    assert found.frequencies[0, 0] == 0.0 < found.frequencies[0, 1]
    assert np.linalg.eigvalsh(found.stiffness[0])[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["demobot_parallel", "demobot_off_centre", "planar_vertical"])
def test_mujocos_inertia_and_stiffness_give_the_same(name: str) -> None:
    path = model_path(name)
    robot = load_robot(path)
    pose = robot.reference_pose + np.array([0.03, 0, 0.02, 0, 0, 0, 0])
    found = solve(robot, pose)
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
    added = Term.of(BOB, "platform_mass", added_kg=2.0)
    found = solve(BOB, [[0.0, 0, 0, 1, 0, 0, 0]], effects=[added])
    assert found.frequencies[0, -1] == pytest.approx(np.sqrt(100.0 / 4.0) / (2.0 * np.pi))


def test_an_inertia_that_nobody_said_is_asked_for() -> None:
    found = solve(replace(BOB, inertia=np.zeros((3, 3))), [[0.0, 0, 0, 1, 0, 0, 0]])
    with pytest.raises(InputError, match="robot bob: its inertia is not known"):
        _ = found.frequencies
