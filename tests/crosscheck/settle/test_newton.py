"""Newton's method on MuJoCo's forces against closed forms of one cable and plain linear algebra."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from crosscheck.settle.newton import minimise, neutral_stiffness, stiffness
from crosscheck.settle.physics import Physics
from crosscheck.twin.build import Springs
from crosscheck.twin.robot import true_robot
from crosscheck.twin.world import World
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import effect_named

EA, REST, MASS, G = 100.0, 0.75, 0.4, 9.81
POINT_MASS = f"""<mujoco>
  <option gravity="0 0 -{G}"/>
  <worldbody>
    <site name="A" pos="0 0 1"/>
    <body name="platform" pos="0 0 0.2">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="{MASS}" diaginertia="0.001 0.001 0.001"/><site name="B"/>
    </body>
  </worldbody>
  <tendon><spatial springlength="0 {REST}" stiffness="{EA / REST}">
    <site site="A"/><site site="B"/></spatial></tendon>
</mujoco>"""
STRETCH = MASS * G * REST / EA


@pytest.fixture
def hanging() -> Physics:
    """A mass on one cable that moves in a plane, at its reference."""
    physics = Physics.of(mujoco.MjModel.from_xml_string(POINT_MASS))
    physics.update()
    return physics


def test_the_stiffness_of_one_cable_is_that_of_a_string(hanging):
    along, length = EA / REST, 1.0 - 0.2
    across = along * (length - REST) / length  # tension over length
    found = stiffness(hanging, np.array([True]))
    np.testing.assert_allclose(found, np.diag([across, along]), rtol=1e-6, atol=1e-7 * along)
    assert np.all(stiffness(hanging, np.array([False])) == 0.0)


def test_it_ends_where_weight_and_stretch_balance(hanging):
    hanging.data.qpos[:] = [0.05, 0.03]
    size, steps = minimise(hanging, 1e-12, 30)
    assert size < 1e-12 and 2 < steps < 30
    np.testing.assert_allclose(hanging.data.qpos, [0.0, 0.8 - REST - STRETCH], atol=1e-13)


def test_where_nothing_pulls_there_is_no_way_to_go(hanging):
    """Dynamics come first: they drop the platform into its cables."""
    hanging.data.qpos[:] = [0.0, 0.2]
    assert minimise(hanging, 1e-12, 200) == (pytest.approx(1.0), 0)
    assert hanging.data.qpos.tolist() == [0.0, 0.2]


def test_it_stops_after_the_steps_it_may_take(hanging):
    hanging.data.qpos[:] = [0.05, 0.03]
    size, steps = minimise(hanging, 1e-12, 1)
    assert steps == 1 and size > 1e-12


def test_directions_without_stiffness_are_left_alone(hanging):
    matrix, force = np.diag([1e-9, 100.0]), np.array([1.0, 5.0])
    np.testing.assert_allclose(hanging.solve(matrix, force, 0.0, neutral=1e-6), [0.0, 0.05])
    np.testing.assert_allclose(hanging.solve(matrix, force, 25.0, neutral=1e-6), [0.0, 0.04])
    assert hanging.solve(np.diag([-3.0, 100.0]), force, 0.0, neutral=1e-6) is None
    np.testing.assert_allclose(
        hanging.solve(np.diag([-3.0, 100.0]), force, 5.0, neutral=1e-6), [0.5, 5.0 / 105.0]
    )


def test_what_rounding_can_pretend_is_far_below_a_cable(hanging):
    assert 0.0 < neutral_stiffness(hanging) < 1e-6 * EA / REST


def world_of(name: str, segments: int, **values: float) -> World:
    robot = load_robot(model_path("demobot_cogiro"))
    true = true_robot(robot, [effect_named(name)(**values)])
    world = World(true, segments)
    world.set_springs(Springs.plain(robot.rest_lengths, true))
    world.place(robot.reference_pose)
    world.update()
    return world


@pytest.mark.parametrize(
    "world",
    [
        world_of("cable_weight", 4, weight=0.2),
        world_of("frame_compliance", 1, sideways=1e-5, upwards=1e-5),
    ],
    ids=["chains", "springs"],
)
def test_parts_of_cables_are_solved_as_one_system_would_be(world):
    """Shifted in groups and solved cable by cable, or one by one and all at once."""
    taut = np.ones(len(world.tensions()), dtype=bool)
    matrix = stiffness(world, taut)
    groups, every = world.coupling, np.arange(world.n_dof)
    world.coupling = [(every[k : k + 1], every, 0 * every + k) for k in every]
    one_by_one = stiffness(world, taut)
    world.coupling = groups
    np.testing.assert_allclose(matrix, one_by_one, atol=1e-6 * np.abs(matrix).max())
    force = np.random.default_rng(1).normal(size=world.n_dof)
    damping = 0.1 * float(np.abs(matrix).max())
    step = world.solve(matrix, force, damping)
    whole = np.linalg.solve(matrix + damping * np.eye(world.n_dof), force)
    np.testing.assert_allclose(step, whole, rtol=1e-8, atol=1e-12 * np.abs(whole).max())
    assert world.solve(matrix, force, -1e3 * damping) is None
