"""A user's MJCF made ready for settling, and Newton's method on MuJoCo's forces."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hall import EXITS, SITES, hall

from crosscheck.settle.newton import minimise, stiffness
from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler
from crosscheck.twin.cable import Springs
from crosscheck.twin.robot import true_robot
from crosscheck.twin.world import World
from seecr.description.mjcf import load_robot, model_names, model_path, quiet_mujoco
from seecr.effects import effect_named
from seecr.equilibrium.solving import solve
from seecr.errors import RobotError
from seecr.pose import pose_difference

PLANAR = model_path("planar_vertical").read_text(encoding="utf-8")


SLIDE = '<joint name="x" type="slide"'


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        (SLIDE, f'{SLIDE} range="-1 1"', "joint limits"),
        ('width="0.0012"', 'width="0.0012" range="0 2" limited="true"', "tendon limits"),
        (SLIDE, f'{SLIDE} frictionloss="0.1"', "dry friction"),
        ('width="0.0012"', 'width="0.0012" frictionloss="0.1"', "dry friction"),
        (SLIDE, f'{SLIDE} damping="0.1"', "damping"),
        ('contype="0" conaffinity="0"', 'contype="1" conaffinity="1"', "contacts"),
    ],
)
def test_what_hinders_is_named_one_by_one(old, new, name, tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(PLANAR.replace(old, new, 1))
    assert Physics.of(path).ignored == (name,)


@pytest.mark.parametrize("name", model_names())
def test_nothing_hinders_a_shipped_robot(name):
    assert Physics.of(name).ignored == ()


def test_mujoco_is_quiet_inside_and_speaks_again_after():
    assert mujoco.get_mju_user_warning() is None
    with quiet_mujoco(), quiet_mujoco():
        assert mujoco.get_mju_user_warning() is not None
    assert mujoco.get_mju_user_warning() is None


def test_a_singular_platform_leaves_no_log(tmp_path, monkeypatch):
    """Its mass 1e6 m away makes MuJoCo warn wherever it is compiled, placed or settled."""
    monkeypatch.chdir(tmp_path)
    inertial = re.compile(r'<inertial pos="[^"]*"')
    Path("far.xml").write_text(inertial.sub('<inertial pos="0 0 1e6"', PLANAR), encoding="utf-8")
    with pytest.raises(RobotError, match="has its centre of mass 1e"):
        Physics.of("far.xml")
    assert [file.name for file in tmp_path.iterdir()] == ["far.xml"]


def test_without_a_load_residuals_are_relative_to_what_cables_pull() -> None:
    physics = Physics.of(model_path("planar_vertical"))
    physics.set_load(gravity=np.zeros(3))
    assert 0.0 < physics.force_scale < np.inf and 0.0 < physics.rounding() < 1e-6
    before = physics.force_scale
    physics.set_cables(0.9 * physics.rest_lengths, physics.stiffness * physics.rest_lengths)
    physics.place(physics.pose())
    assert physics.force_scale == pytest.approx(np.sum(physics.tensions())) != before
    physics.set_load()
    assert physics.force_scale == pytest.approx(physics.mass * 9.81)


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
def hanging(tmp_path) -> Physics:
    """A mass on one cable that moves in a plane, at its reference."""
    (tmp_path / "robot.xml").write_text(POINT_MASS)
    physics = Physics.of(tmp_path / "robot.xml")
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


LOOSE = '<body name="box" pos="2 0 0"><freejoint/><geom size="0.1"/></body>'
KEY = '<keyframe><key qpos="0 0 0 1 0 0 0 0 0 0 1 0 0 0"/></keyframe>'
SERVO = '<actuator><position name="m" tendon="rope0" kp="500"/></actuator>'
LUGS = f'<body name="lugs" pos="0.01 0.02 0.03" euler="5 0 20">{SITES}</body>'


@pytest.mark.parametrize(
    ("parts", "freedoms"),
    [
        ({"world": EXITS + LOOSE, "rest": KEY}, 6),
        ({"world": LOOSE + EXITS, "rest": SERVO}, 6),
        ({"rest": SERVO}, 6),
        ({"inside": LUGS}, 6),
        ({"joint": '<joint name="knee" type="ball" pos="0 0 0.3"/>'}, 3),
        ({"joint": '<joint type="slide" axis="0 0 1"/><joint type="ball" pos="0 0 0.3"/>'}, 4),
    ],
)
def test_both_sides_bring_the_same_file_to_the_same_rest(
    parts: dict[str, str], freedoms: int, tmp_path: Path
) -> None:
    path = hall(tmp_path / "robot.xml", **parts)
    assert Physics.of(path).n_dof == freedoms
    robot = load_robot(path)
    ours = solve(robot, robot.reference_pose)
    theirs = Settler(path).settle(robot.reference_pose, ours.rest_lengths[0])
    assert np.abs(pose_difference(ours.pose, theirs.pose[None])).max() < 1e-6
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-3)
