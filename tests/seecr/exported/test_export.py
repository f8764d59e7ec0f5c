"""An exported robot rests in MuJoCo where seecr says, given the same rest lengths."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from robots import THREE

from crosscheck.settle.settler import Settler, settle_batch
from seecr.compiled.catenary import catenary_span
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term, Terms
from seecr.equilibrium.solving import solve
from seecr.errors import InputError, NoRestError
from seecr.exported.bodies import SEGMENTS, HangingCable, hanging
from seecr.exported.export import Export, export
from seecr.pose import Array, pose_difference

COGIRO = load_robot("demobot_cogiro")
POSES = np.array([[0.3, 0.2, 0.15, 1, 0, 0, 0], [0.5, 0.3, 0.1, 0.995, 0, 0.0998749, 0]])
POSES[:, 3:] /= np.linalg.norm(POSES[:, 3:], axis=1, keepdims=True)
# Each case of the promise: MuJoCo within this part of the robot's size.
NEAR = 1e-9

PLAIN = {
    "exit_point_error": {"error_2_x_m": 0.004, "error_5_z_m": -0.003},
    "anchor_point_error": {"error_1_y_m": 0.001},
    "cable_stiffness": {"factor_3": 1.2},
    "platform_mass": {"added_kg": 0.05},
    "centre_of_mass": {"shift_x_m": 0.003, "shift_z_m": -0.01},
    "gravity_tilt": {"tilt_x_rad": 0.01},
    "drum_gain": {"gain_4": 0.003},
    "initial_pose_error": {"position_z_m": 0.002},
}


def term(robot: Robot, name: str, **values: float) -> Term:
    return Term.of(robot, name, **values)


@pytest.fixture(scope="module")
def plain() -> tuple[Terms, Export]:
    terms = Terms([term(COGIRO, name, **values) for name, values in PLAIN.items()])
    return terms, export(COGIRO, terms)


def test_a_description_rests_in_mujoco_where_seecr_says(
    plain: tuple[Terms, Export], tmp_path: Path
) -> None:
    terms, exported = plain
    path = tmp_path / "robot.xml"
    path.write_text(exported.text)
    said = solve(COGIRO, POSES, effects=terms)
    found = settle_batch(Settler(path), POSES, said.rest_lengths)
    assert found.settled.all() and said.converged.all()
    away = pose_difference(found.pose, said.pose)
    assert np.abs(away / np.repeat([1.0, 1.0 / COGIRO.length], 3)).max() < NEAR * COGIRO.length


def test_what_edits_nothing_is_in_no_file_and_the_rest_lengths_have_what_winches_pay_out(
    plain: tuple[Terms, Export],
) -> None:
    assert export(COGIRO, [term(COGIRO, "pulley_radius")]).bodies == ()
    assert set(plain[1].lengths) == {"drum_gain", "initial_pose_error"}
    assert {*plain[1].plain, *plain[1].lengths} == set(PLAIN)
    assert plain[1].bodies == plain[1].nowhere == () and plain[1].mujoco_text is None
    assert export(COGIRO, [term(COGIRO, "cable_length_offset", offset_1_m=1e-3)]).lengths == (
        "cable_length_offset",
    )


def forces(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """What is unbalanced at rest: springs, weight and actuators."""
    data.qvel[:], data.qacc[:] = 0.0, 0.0
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    mujoco.mj_inverse(model, data)
    return np.asarray(data.qfrc_actuator - data.qfrc_inverse)


def polished(text: str, nudge: float) -> tuple[Array, float]:
    """Pose (7,) at rest near the keyframe, after a nudge [m], and the least stiffness there."""
    model = mujoco.MjModel.from_xml_string(text)
    data, n, h = mujoco.MjData(model), model.nv, 1e-7
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_integratePos(model, data.qpos, nudge * np.eye(n)[0], 1.0)
    for _ in range(12):
        force, at = forces(model, data), data.qpos.copy()
        slope = np.zeros((n, n))
        for k in range(n):
            for sign in (1.0, -1.0):
                data.qpos[:] = at
                mujoco.mj_integratePos(model, data.qpos, sign * h * np.eye(n)[k], 1.0)
                slope[:, k] += sign * forces(model, data) / (2.0 * h)
        data.qpos[:] = at
        step = np.linalg.solve(-slope, force)
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        if np.linalg.norm(step) < 1e-12:
            break
    forces(model, data)
    body = data.body("platform")
    least = np.linalg.eigvalsh(-0.5 * (slope + slope.T))[0]
    return np.concatenate([body.xpos, body.xquat]), float(least)


BODIES = [
    {"pulley_radius": {"radius_m": 0.01}, "drum_gain": {"gain_4": 0.003}},
    {"nonlinear_elasticity": {"quadratic": 3.0, "cubic": 5.0}},
    {"winch_side_length": {"length_m": 0.3}},
    {"frame_compliance": {"sideways_m_per_N": 1e-4, "upwards_m_per_N": 5e-5}},
    {"external_wrench": {"force_x_N": 0.3, "force_y_N": -0.2, "moment_z_Nm": 0.01}},
    {
        "pulley_radius": {"radius_m": 0.01},
        "winch_side_length": {"length_m": 0.3},
        "frame_compliance": {"sideways_m_per_N": 1e-4, "upwards_m_per_N": 1e-4},
        "nonlinear_elasticity": {"quadratic": 3.0},
        "platform_mass": {"added_kg": 0.1},
    },
]


@pytest.mark.parametrize("given", BODIES, ids=" ".join)
def test_bodies_and_springs_rest_in_mujoco_where_seecr_says(given: dict[str, dict[str, float]]):
    terms = [term(COGIRO, name, **values) for name, values in given.items()]
    exported = export(COGIRO, terms, at=POSES[0])
    assert exported.mujoco_text is not None and exported.solution is not None
    pose, least = polished(exported.mujoco_text, 1e-5)
    away = pose_difference(pose[None], exported.solution.pose)[0]
    assert np.abs(away[:3]).max() < NEAR * COGIRO.length and np.abs(away[3:]).max() < NEAR
    assert least > 0.0


def test_a_cable_that_goes_straight_up_has_its_sheave_turned_anywhere() -> None:
    """Its plane is undetermined; once the file had axes of noughts, which MuJoCo does not read."""
    exported = export(THREE, [term(THREE, "pulley_radius", radius_m=0.02)])
    assert exported.mujoco_text is not None and exported.solution is not None
    pose = polished(exported.mujoco_text, 1e-5)[0]
    away = pose_difference(pose[None], exported.solution.pose)[0]
    assert np.abs(away).max() < NEAR * THREE.length


@pytest.mark.parametrize("height", [-1.0, 0.0, 1.0, 1.9])
@pytest.mark.parametrize("aside", [-0.6, 0.6])
def test_cables_lie_on_top_of_their_sheaves_wherever_the_platform_is(
    height: float, aside: float
) -> None:
    """From nearly straight up to nearly straight down: winch, arc and tangent of a circle."""
    r = 0.02
    exported = export(THREE, [term(THREE, "pulley_radius", radius_m=r)])
    assert exported.mujoco_text is not None and exported.solution is not None
    model = mujoco.MjModel.from_xml_string(exported.mujoco_text)
    data = mujoco.MjData(model)
    data.qpos[:2] = [aside, height - THREE.reference_pose[2]]
    mujoco.mj_forward(model, data)
    anchors = THREE.anchor_points[:2] + np.array([THREE.reference_pose[0] + aside, 0.0, height])
    ways = anchors - THREE.exit_points[:2]
    flat, up = np.abs(ways[:, 0]), ways[:, 2]
    # seen from the sheave's centre, with angles from the exit point over the top
    far = np.hypot(flat - r, up)
    arc = np.arctan2(up, r - flat) % (2 * np.pi) - np.arccos(r / far)
    below = exported.solution.rest_lengths[0, :2]  # where the file has the winches
    np.testing.assert_allclose(data.ten_length[:2], below + r * arc + np.sqrt(far**2 - r**2))


def test_a_planar_robot_keeps_its_joints() -> None:
    robot = load_robot("planar_vertical")
    at = robot.reference_pose + np.array([0.05, 0, 0.03, 0, 0, 0, 0])
    exported = export(robot, [term(robot, "pulley_radius", radius_m=0.01)], at)
    assert exported.mujoco_text is not None and exported.solution is not None
    pose = polished(exported.mujoco_text, 1e-5)[0]
    away = pose_difference(pose[None], exported.solution.pose)[0]
    assert np.abs(away).max() < NEAR * robot.length


SAG = {"cable_weight": {"weight_N_per_m": 0.1}}
TURNED = {"gravity_tilt": {"tilt_x_rad": 0.01}}


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        SAG,
        SAG | TURNED,
        SAG | {"winch_side_length": {"length_m": 0.3}, "pulley_radius": {"radius_m": 0.01}},
        SAG | {"frame_compliance": {"sideways_m_per_N": 1e-4, "upwards_m_per_N": 5e-5}},
        SAG | {"nonlinear_elasticity": {"quadratic": 30.0, "cubic": 50.0}},
    ],
    ids=" ".join,
)
def test_hanging_cables_rest_in_mujoco_where_seecr_says(given: dict[str, dict[str, float]]) -> None:
    """Chains were 1e-5 of the robot's size off, and not at rest at the keyframe over soft parts."""
    exported = export(COGIRO, [term(COGIRO, name, **v) for name, v in given.items()], at=POSES[1])
    assert exported.mujoco_text is not None and exported.solution is not None
    assert exported.solution.slack.any()
    model = mujoco.MjModel.from_xml_string(exported.mujoco_text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert np.abs(forces(model, data)).max() < 1e-8 * COGIRO.weight
    # no farther than the springs of a slack cable are stretched
    pose, least = polished(exported.mujoco_text, 1e-7)
    away = pose_difference(pose[None], exported.solution.pose)[0]
    assert np.abs(away[:3]).max() < NEAR * COGIRO.length and np.abs(away[3:]).max() < NEAR
    assert least > 0.0


def pushed(text: str) -> tuple[Array, int]:
    """Distances (n,) [m] of the platform from its keyframe, pushed for 0.1 of 0.4 s; warnings."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    home, off = data.qpos[:3].copy(), []
    while data.time < 0.4 and not any(one.number for one in data.warning):
        data.body("platform").xfrc_applied[:2] = (0.02, 0.01) if data.time < 0.1 else (0.0, 0.0)
        mujoco.mj_step(model, data)
        off.append(np.linalg.norm(data.qpos[:3] - home))
    return np.array(off), sum(one.number for one in data.warning)


@pytest.mark.parametrize(
    "weight",
    [
        0.05,
        *(pytest.param(w, marks=[pytest.mark.slow, pytest.mark.sweep]) for w in (0.01, 0.02, 0.2)),
    ],
)
def test_a_pushed_platform_on_hanging_cables_comes_back(weight: float) -> None:
    """With steps of 2 ms such files ran away: their cables' parts swing faster."""
    exported = export(COGIRO, [term(COGIRO, "cable_weight", weight_N_per_m=weight)])
    assert exported.mujoco_text is not None
    assert "longer steps than" in exported.mujoco_text
    off, warnings = pushed(exported.mujoco_text)
    assert warnings == 0 and off.max() < 1e-3 * COGIRO.length
    assert off[-1] < 0.2 * off.max()


@pytest.mark.parametrize(("flat", "steep", "most"), [(2.0, 1.0, 1e-10), (0.05, -0.03, 1e-4)])
def test_a_chain_starts_beside_the_exit_point_by_one_over_the_square_of_its_links(
    flat: float, steep: float, most: float
) -> None:
    """Taut and slack: where it starts is what a chain lacks of the catenary."""
    span = catenary_span(flat, steep, 0.1, 1.0, 3000.0)[:2]
    off = [
        np.linalg.norm(
            hanging(
                HangingCable(
                    np.array([span[0], -span[1]]), np.array([-flat, steep]), 0.1, 1.0, 3000.0,
                    (1.0, 0.0, 0.0), 0.0,
                ),
                links,
            ).beside
        )
        for links in (12, SEGMENTS)
    ]  # fmt: skip
    assert off[1] < most and off[0] / off[1] == pytest.approx(4.0, rel=0.1)


def test_what_mjcf_cannot_say_is_said() -> None:
    lines = export(
        COGIRO,
        [
            term(COGIRO, "drum_gain", gain_1=0.01),
            term(COGIRO, "drum_eccentricity", sine_1_m=0.001),
            term(COGIRO, "thermal_expansion", expansion_1_per_K=1e-5),
            term(COGIRO, "backlash", gap_m=0.001),
            term(COGIRO, "hysteresis", amplitude_N=0.1),
            term(COGIRO, "tracker_target", shift_z_m=0.1),
            term(COGIRO, "stiffness", factor=1.1),
            term(COGIRO, "creep"),
        ],
    ).lines("robot.xml")
    assert lines == [
        "robot.xml contains stiffness",
        "only in the rest lengths of the reference pose: drum_gain, drum_eccentricity; at other "
        "poses use the rest lengths that seecr computes",
        "not in any file: thermal_expansion; it depends on the temperature, which no MJCF states",
        "not in any file: backlash; it depends on the motion before",
        "not in any file: hysteresis; it depends on the motion before",
        "not in any file: tracker_target; it changes what sensors read, not where the platform "
        "rests",
    ]
    both = [term(COGIRO, "pulley_radius", radius_m=0.01),
            term(COGIRO, "frame_compliance", sideways_m_per_N=1e-4)]  # fmt: skip
    assert export(COGIRO, both).nowhere == (
        ("frame_compliance", "with pulleys, the frame must be equally compliant in all directions"),
    )


def test_a_law_that_seecr_keeps_from_falling_is_in_no_file_where_it_would_fall() -> None:
    """MuJoCo takes the bare polynomial: the keyframe had 2449 N on a platform of 0.4 kg."""
    robot = load_robot("demobot_parallel")
    soft = [term(robot, "nonlinear_elasticity", cubic=-4.29e5)]
    far = export(robot, soft, [0.17, 0.25, 0.2, 1, 0, 0, 0])
    assert far.softens and far.mujoco_text is None and far.solution is None
    assert [name for name, _why in far.nowhere] == ["nonlinear_elasticity"]
    assert "seecr keeps a hundredth of their stiffness there" in " ".join(far.lines())
    # other effects stay, also where the polynomial falls before it rises again
    wheel = term(robot, "pulley_radius", radius_m=0.01)
    dip = term(robot, "nonlinear_elasticity", quadratic=-2000.0, cubic=1.33e6)
    both = export(robot, [wheel, dip], [0.17, 0.25, 0.2, 1, 0, 0, 0])
    assert both.bodies == ("pulley_radius",) and both.softens and both.solution is not None
    # a little softer, they are as seecr has them
    for cubic in (-100.0, 4.29e5):
        some = export(robot, [term(robot, "nonlinear_elasticity", cubic=cubic)])
        assert some.bodies == ("nonlinear_elasticity",) and not some.softens


def test_another_vertical_than_gravity_is_said() -> None:
    """Of pulleys and frame; the platform rests 1e-5 of its size elsewhere."""
    pulley = {"pulley_radius": {"radius_m": 0.01}}
    for given, leans in (
        (SAG | TURNED, False),
        (SAG | pulley, False),
        (SAG | TURNED | pulley, True),
    ):
        exported = export(COGIRO, [term(COGIRO, name, **v) for name, v in given.items()])
        assert exported.leans is leans
        assert ("along the tilted gravity" in " ".join(exported.lines())) is leans


@pytest.mark.parametrize("at", [[1.0, 2.0], np.tile(COGIRO.reference_pose, (2, 1))])
def test_it_is_exported_at_one_pose_even_where_nothing_depends_on_it(at: object) -> None:
    with pytest.raises(InputError, match=r"at must be \(n, 7\)|one pose to export at, got 2"):
        export(COGIRO, at=at)  # type: ignore[arg-type]


def test_a_pose_without_rest_is_one_sentence() -> None:
    pulley = [term(COGIRO, "pulley_radius", radius_m=0.01),
              term(COGIRO, "external_wrench", moment_z_Nm=60.0)]  # fmt: skip
    with pytest.raises(NoRestError, match=r"no rest at the pose to export at: .*another pose"):
        export(COGIRO, pulley)
    assert NoRestError.exit_status == 3  # what `seecr pose` ends with there
