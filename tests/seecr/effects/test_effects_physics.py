"""Each effect against what it says it is: closed forms, twins, brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import experiment_of, moved, robot_of
from random_robots import random_poses, random_robot

import seecr
from seecr.compiled.cable_law import pulley_geometry
from seecr.effects.cable import usual_strain
from seecr.effects.setup import plain_setup
from seecr.pose import (
    pose_add,
    pose_difference,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    transform_points,
)
from seecr.prediction.sensitivity import readings_difference

STIFF = 1e7


def effect(name: str, **values: object) -> seecr.Effect:
    """The effect, lists as arrays."""
    arrays = {k: np.array(v, float) if isinstance(v, list) else v for k, v in values.items()}
    return seecr.effect_named(name)(**arrays)


def change(a: seecr.Prediction, b: seecr.Prediction) -> np.ndarray:
    assert np.all(a.solved) and np.all(b.solved)
    return readings_difference(a.readings, b.readings)


def at_reference(robot: seecr.Robot, rows: int = 1, **more: object) -> seecr.Experiment:
    return seecr.Experiment(robot, seecr.Commands(np.tile(robot.reference_pose, (rows, 1)), **more))


# --- actuation -----------------------------------------------------------------------------------


def test_offsets_are_lengths_paid_out_beyond_the_command() -> None:
    experiment = experiment_of("demobot_cogiro")
    offset = np.linspace(-1e-3, 2e-3, 8)
    there = experiment.predict([effect("cable_length_offset", offset=offset)])
    rest = experiment.robot.commanded_lengths(experiment.commands.pose) + offset
    own = seecr.solve(experiment.robot, experiment.commands.pose, rest_lengths=rest)
    assert pose_difference(there.pose, own.pose) == pytest.approx(np.zeros((6, 6)), abs=1e-12)


def test_drum_gain_does_nothing_at_the_reference_pose_and_acts_on_the_change_elsewhere() -> None:
    robot = robot_of("demobot_parallel")
    gain = [0.01, -0.02, 0.03, 0.004, 0.01, -0.01, 0.02, 0.0]
    assert np.abs(moved(at_reference(robot), [effect("drum_gain", gain=gain)])).max() < 1e-12
    experiment = experiment_of("demobot_parallel")
    setup = experiment.setup([effect("drum_gain", gain=gain)])
    paid = setup.rest_lengths() - robot.rest_lengths
    told = robot.commanded_lengths(experiment.commands.pose) - robot.rest_lengths
    assert paid == pytest.approx(told * (1 + np.array(gain)), abs=1e-14)
    lengths = experiment_of("lengths")
    paid = lengths.setup([effect("drum_gain", gain=gain)]).rest_lengths()
    assert paid == pytest.approx(lengths.commands.lengths * (1 + np.array(gain)), rel=1e-14)


def test_drum_eccentricity_is_a_sine_of_the_drums_angle_and_nothing_at_the_zero() -> None:
    robot = robot_of("demobot_cogiro")
    ring = effect("drum_eccentricity", sine=[1e-3] * 8, cosine=[5e-4] * 8, drum_radius=0.02)
    assert np.abs(moved(at_reference(robot), [ring])).max() < 1e-12
    experiment = experiment_of("demobot_cogiro")
    told = experiment.setup([]).rest_lengths() - robot.rest_lengths
    extra = experiment.setup([ring]).rest_lengths() - experiment.setup([]).rest_lengths()
    expected = 1e-3 * np.sin(told / 0.02) + 5e-4 * (np.cos(told / 0.02) - 1)
    assert extra == pytest.approx(expected, abs=1e-14)
    # of absolute lengths nothing is the zero
    lengths = experiment_of("lengths")
    told = lengths.commands.lengths
    extra = lengths.setup([ring]).rest_lengths() - lengths.setup([]).rest_lengths()
    expected = 1e-3 * np.sin(told / 0.02) + 5e-4 * np.cos(told / 0.02)
    assert extra == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel"])
def test_a_platform_zeroed_in_the_wrong_place_goes_back_there(kind: str) -> None:
    """Commanded to the reference pose it rests at the misplaced one, but for elastic sag."""
    robot = replace(robot_of(kind), ea=np.full(8, STIFF))
    wrong = np.array([4e-3, -3e-3, 2e-3, 0.01, -0.02, 0.015])
    there = at_reference(robot).predict(
        [effect("initial_pose_error", position=wrong[:3], rotation=wrong[3:])]
    )
    assert np.all(there.solved)
    found = pose_difference(there.pose, robot.reference_pose)[0]
    assert found == pytest.approx(wrong, abs=2e-5)  # the sag of 4 N on 1e7 N, on soft directions


def test_thermal_expansion_lengthens_what_is_paid_out() -> None:
    experiment = experiment_of("demobot_cogiro")
    warm = effect("thermal_expansion", expansion=2e-4, zero_temperature=18.0)
    factor = 1 + 2e-4 * (experiment.commands.temperature - 18.0)
    grown = experiment.setup([warm]).rest_lengths()
    assert grown == pytest.approx(experiment.setup([]).rest_lengths() * factor[:, None], rel=1e-14)
    height = moved(experiment, [warm])[:, 2]
    assert np.all(np.sign(height) == -np.sign(factor - 1))  # warm: longer, lower


# --- geometry ------------------------------------------------------------------------------------


def test_the_sheave_swivels_to_face_the_anchor_point() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot, r = experiment.robot, 0.02
    setup = experiment.setup([effect("pulley_radius", radius=r)])
    found = setup.geometric_lengths(experiment.commands.pose)
    for pose, row in zip(experiment.commands.pose, found, strict=True):
        for a, b, length in zip(
            robot.exit_points, transform_points(pose, robot.anchor_points), row, strict=True
        ):
            flat = np.hypot(*(b - a)[:2])
            assert length == pytest.approx(pulley_geometry(flat, (b - a)[2], r)[0], rel=1e-13)


def test_a_pulley_changes_little_at_the_reference_pose_where_the_winches_were_zeroed() -> None:
    """What is left there is the bend of the cable's direction, not the length of the wrap."""
    robot = replace(robot_of("demobot_cogiro"), ea=np.full(8, STIFF))
    pulley = effect("pulley_radius", radius=0.01)
    at_home = np.abs(moved(at_reference(robot), [pulley])[:, :3]).max()
    assert at_home < 1e-6
    away = seecr.Experiment(robot, experiment_of("demobot_cogiro").commands)
    assert np.abs(moved(away, [pulley])[:, :3]).max() > 100 * at_home


@pytest.mark.parametrize("name", ["exit_point_error", "anchor_point_error"])
def test_wrong_points_are_the_robot_with_these_points_zeroed_at_its_reference(name: str) -> None:
    experiment = experiment_of("demobot_parallel")
    robot = experiment.robot
    error = np.random.default_rng(3).normal(scale=2e-3, size=(8, 3))
    field = "exit_points" if name == "exit_point_error" else "anchor_points"
    true = replace(robot, **{field: getattr(robot, field) + error})
    zero = true.nominal_lengths(robot.reference_pose[None])
    told = robot.nominal_lengths(experiment.commands.pose) - robot.nominal_lengths(
        robot.reference_pose[None]
    )
    own = seecr.solve(true, experiment.commands.pose, rest_lengths=zero + told)
    there = experiment.predict([effect(name, error=error.ravel())])
    assert pose_difference(there.pose, own.pose) == pytest.approx(np.zeros((6, 6)), abs=1e-11)
    assert there.tensions == pytest.approx(own.tensions, abs=1e-8)


# --- cable, structure and load: twins ------------------------------------------------------------


@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "planar_vertical"])
def test_cables_f_times_as_stiff_move_as_a_platform_of_mass_m_over_f(kind: str) -> None:
    experiment = experiment_of(kind)
    mass = experiment.robot.mass
    stiff = experiment.predict([effect("stiffness", factor=1.25)])
    light = experiment.predict([effect("platform_mass", added=mass / 1.25 - mass)])
    apart = change(stiff, light)
    assert np.abs(apart[:, :6]).max() < 1e-11
    assert stiff.tensions == pytest.approx(1.25 * light.tensions, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "planar_vertical"])
def test_a_yielding_frame_is_a_length_behind_the_exit_point(kind: str) -> None:
    experiment = experiment_of(kind)
    robot = experiment.robot
    compliance = 0.3 / robot.ea[0]
    assert np.all(robot.ea == pytest.approx(robot.ea[0]))
    frame = experiment.predict(
        [effect("frame_compliance", sideways=compliance, upwards=compliance)]
    )
    behind = experiment.predict([effect("winch_side_length", length=0.3)])
    assert np.abs(change(frame, behind)).max() < 1e-9


def test_factors_for_all_cables_are_the_factors_of_each() -> None:
    experiment = experiment_of("demobot_parallel")
    each = experiment.predict([effect("cable_stiffness", factor=[0.8] * 8)])
    assert np.abs(change(each, experiment.predict([effect("stiffness", factor=0.8)]))).max() == 0


HUNG = seecr.Robot(
    "bob", np.array([[0.0, 0, 1]]), np.zeros((1, 3)), np.array([100.0]), np.ones(1), 2.0
)


def hung(*effects: seecr.Effect, robot: seecr.Robot = HUNG, **more: object) -> seecr.Prediction:
    """2 kg on one cable of 1 m and E S = 100 N, straight above its origin."""
    from seecr.description.robot import Joint

    robot = replace(robot, joints=(Joint("slide", "lift", np.array([0.0, 0, 1]), np.zeros(3)),))
    found = at_reference(robot, **more).predict(effects)
    assert np.all(found.solved)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "planar_vertical"])
def test_a_frame_yields_sideways_and_upwards_by_what_each_cable_pulls(kind: str) -> None:
    """Against exit points that are moved by C T u, over and over, on the plain robot."""
    experiment = experiment_of(kind, rows=2)
    robot = experiment.robot
    sideways, upwards = 0.5 / robot.ea[0], 0.1 / robot.ea[0]
    frame = experiment.predict([effect("frame_compliance", sideways=sideways, upwards=upwards)])
    assert frame.solved.all()
    soft = np.full(3, sideways) + (upwards - sideways) * np.abs(robot.up)
    lengths = experiment.setup([]).rest_lengths()
    for pose, command, rest in zip(frame.pose, experiment.commands.pose, lengths, strict=True):
        anchors = transform_points(pose[None], robot.anchor_points)[0]
        moved = robot.exit_points.copy()
        for _ in range(250):
            there = replace(robot, exit_points=moved)
            found = seecr.solve(there, command[None], rest_lengths=rest[None])
            anchors = transform_points(found.pose, robot.anchor_points)[0]
            along = (anchors - moved) / np.linalg.norm(anchors - moved, axis=1)[:, None]
            moved = robot.exit_points + found.tensions[0][:, None] * along * soft
        assert found.pose[0] == pytest.approx(pose, abs=1e-9)


def test_the_usual_strain_is_that_of_the_weight_or_of_the_pretension() -> None:
    """Of a pretensioned robot the weight's was a fifth: a plausible law made its cables push."""
    pretensioned = seecr.load_robot("ipanema")
    hung = seecr.load_robot("demobot_cogiro")
    strain = np.median(pretensioned.reference_lengths / pretensioned.rest_lengths - 1.0)
    assert usual_strain(pretensioned) == pytest.approx(strain) and 0.004 < strain < 0.006
    weight = hung.mass * np.linalg.norm(hung.gravity)
    assert usual_strain(hung) == pytest.approx(0.5 * weight / hung.ea.mean(), rel=1e-9)
    # at an expected size the quadratic part adds or takes 0.3 of the tension, the cubic 0.3 more
    scale = seecr.layout_of("nonlinear_elasticity", pretensioned).scale
    assert scale * [strain, strain**2] == pytest.approx([0.3, 0.3])


def test_closed_forms_of_one_hanging_cable() -> None:
    weight = 2 * 9.81
    strain = weight / 100
    fall = lambda *e: -hung(*e).readings.position[0, 2]  # noqa: E731
    assert fall() == pytest.approx(strain, rel=1e-12)
    assert fall(effect("winch_side_length", length=0.5)) == pytest.approx(1.5 * strain, rel=1e-12)
    assert fall(effect("frame_compliance", sideways=0.02, upwards=0.01)) == pytest.approx(
        strain + 0.01 * weight, rel=1e-12
    )
    quadratic, cubic = 2.0, 5.0
    roots = np.roots([cubic, quadratic, 1.0, -strain])
    root = float(roots[np.abs(roots.imag) < 1e-12].real.max())
    assert fall(effect("nonlinear_elasticity", quadratic=quadratic, cubic=cubic)) == pytest.approx(
        root, rel=1e-12
    )
    # a cable of weight w stretches by w L/(2 E S) under itself, and the exit point carries all
    heavy = hung(effect("cable_weight", weight=3.0))
    assert -heavy.readings.position[0, 2] == pytest.approx(strain + 1.5 / 100, rel=1e-9)
    assert heavy.tensions[0, 0] == pytest.approx(weight + 3.0, rel=1e-9)


@pytest.mark.parametrize("name, values", [
    ("winch_side_length", {"length": 0.3}),
    ("frame_compliance", {"sideways": 1e-3, "upwards": 4e-4}),
    ("nonlinear_elasticity", {"quadratic": 200.0}),
    ("hysteresis", {"amplitude": 0.1, "stretch": 2e-4}),
    ("creep", {"amount": 0.3, "time": 20.0}),
    ("exit_friction", {"friction": 0.1, "length": 0.3}),
])  # fmt: skip
def test_weightless_catenaries_stretch_as_straight_cables_do(name: str, values: dict) -> None:
    experiment = experiment_of("demobot_cogiro")
    others = [effect(name, **values)]
    light = experiment.predict([*others, effect("cable_weight", weight=1e-8)])
    assert np.abs(change(light, experiment.predict(others))[:, :3]).max() < 1e-10


def test_mass_centre_and_wrench_are_the_robots_own() -> None:
    experiment = experiment_of("demobot_parallel")
    robot, poses = experiment.robot, experiment.commands.pose
    own = seecr.solve(robot, poses, wrench=[0.1, -0.2, 0.3, 0.004, 0.002, -0.003])
    pushed = experiment.predict(
        [effect("external_wrench", force=[0.1, -0.2, 0.3], moment=[0.004, 0.002, -0.003])]
    )
    assert pose_difference(pushed.pose, own.pose) == pytest.approx(np.zeros((6, 6)), abs=1e-11)
    shift = np.array([3e-3, -2e-3, 4e-3])
    other = replace(robot, mass=robot.mass + 0.05, centre_of_mass=robot.centre_of_mass + shift)
    heavy = experiment.predict(
        [effect("platform_mass", added=0.05), effect("centre_of_mass", shift=shift)]
    )
    own = seecr.solve(other, poses)
    assert pose_difference(heavy.pose, own.pose) == pytest.approx(np.zeros((6, 6)), abs=1e-11)


def test_gravity_tilts_by_the_right_hand_and_is_a_horizontal_force() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot = experiment.robot
    tilted = experiment.setup([effect("gravity_tilt", tilt_x=0.01, tilt_y=0.0)]).gravity
    assert tilted == pytest.approx(9.81 * np.array([0.0, np.sin(0.01), -np.cos(0.01)]))
    tilted = experiment.setup([effect("gravity_tilt", tilt_x=0.0, tilt_y=0.01)]).gravity
    assert tilted == pytest.approx(9.81 * np.array([-np.sin(0.01), 0.0, -np.cos(0.01)]))
    force = robot.mass * (tilted - robot.gravity)
    as_force = experiment.predict([effect("external_wrench", force=force, moment=[0.0] * 3)])
    leaning = experiment.predict([effect("gravity_tilt", tilt_x=0.0, tilt_y=0.01)])
    assert np.abs(change(as_force, leaning)).max() < 1e-10  # centre of mass at the origin


def test_a_tilt_of_gravity_is_the_robot_turned_the_other_way() -> None:
    rng = np.random.default_rng(4)
    robot = random_robot(rng, "free", 8)
    poses = random_poses(rng, robot, 4)
    leaning = seecr.Experiment(robot, seecr.Commands(poses)).predict(
        [effect("gravity_tilt", tilt_x=0.02, tilt_y=-0.03)]
    )
    turn = quat_from_rotvec(np.array([0.02, -0.03, 0.0]))
    own = seecr.solve(replace(robot, gravity=quat_rotate(turn, robot.gravity)), poses)
    assert pose_difference(leaning.pose, own.pose) == pytest.approx(np.zeros((4, 6)), abs=1e-11)


# --- sensing -------------------------------------------------------------------------------------


def test_trackers_report_what_their_docstrings_say() -> None:
    experiment = experiment_of("demobot_parallel")
    plain = experiment.predict()
    p, q = plain.readings.position, plain.readings.quat_wxyz
    shift, rotation = np.array([1e-3, -2e-3, 3e-3]), np.array([0.02, -0.01, 0.03])
    turn = quat_from_rotvec(rotation)
    frame = experiment.predict([effect("tracker_frame", shift=shift, rotation=rotation)]).readings
    assert frame.position == pytest.approx(quat_rotate(turn, p) + shift, abs=1e-15)
    assert frame.quat_wxyz == pytest.approx(quat_multiply(turn, q), abs=1e-15)
    target = experiment.predict([effect("tracker_target", shift=shift, rotation=rotation)]).readings
    assert target.position == pytest.approx(p + quat_rotate(q, shift), abs=1e-15)
    assert target.quat_wxyz == pytest.approx(quat_multiply(q, turn), abs=1e-15)
    scale = experiment.predict([effect("tracker_scale", factor=1.002)]).readings
    assert scale.position == pytest.approx(1.002 * p, rel=1e-15)
    assert np.array_equal(scale.quat_wxyz, q)
    cells = experiment.predict([effect("tension_scale", factor=1.1)])
    assert cells.readings.tensions == pytest.approx(1.1 * plain.tensions, rel=1e-15)
    assert np.array_equal(cells.tensions, plain.tensions)  # the cables know nothing of it


def test_all_exit_points_and_the_zero_moved_alike_are_the_trackers_frame() -> None:
    """Seen in a tracker's frame that moved with them, nothing has happened."""
    robot = robot_of("demobot_cogiro")
    experiment = experiment_of("demobot_cogiro")
    shift = np.array([2e-3, -1e-3, 3e-3])
    together = experiment.predict([
        effect("exit_point_error", error=np.tile(shift, robot.n_cables)),
        effect("initial_pose_error", position=shift, rotation=[0.0] * 3),
        effect("tracker_frame", shift=-shift, rotation=[0.0] * 3),
    ])  # fmt: skip
    assert np.abs(change(together, experiment.predict())).max() < 1e-9
    assert pose_add(robot.reference_pose, np.r_[shift, 0, 0, 0])[:3] == pytest.approx(
        plain_setup(robot, experiment.commands).zero_pose[:3] + shift
    )
