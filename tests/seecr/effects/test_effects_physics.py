"""Each effect against what it says it is: closed forms, twins, brute force."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import experiment_of, moved, robot_of
from robots import RECTANGLE

import seecr
from seecr import Commands, Effect, Readings, Setup, layout_of
from seecr.compiled.cable_law import pulley_geometry
from seecr.effects.cable import usual_strain
from seecr.effects.geometry import FrameCompliance
from seecr.effects.load import CentreOfMass, PlatformMass
from seecr.effects.sensing import TensionScale, TrackerFrame, TrackerScale, TrackerTarget
from seecr.effects.setup import plain_setup
from seecr.pose import (
    Array,
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


# --- What the cables carry: how effects add up, and what no platform can be


def setup_of(rows: int = 2) -> Setup:
    return plain_setup(RECTANGLE, Commands(np.tile(RECTANGLE.reference_pose, (rows, 1))))


@pytest.mark.parametrize(("added", "mass"), [
    (0.5, 2.5), (-0.5, 1.5), (-1.998, 0.002), (-1.9999, 0.002), (-50.0, 0.002),
])  # fmt: skip
def test_a_platform_keeps_a_thousandth_of_its_two_kilograms(added: float, mass: float) -> None:
    setup = setup_of()
    PlatformMass(added).edit_setup(setup)
    assert setup.mass == pytest.approx(mass, rel=1e-12)
    PlatformMass(0.25).edit_setup(setup)
    assert setup.mass == pytest.approx(mass + 0.25, rel=1e-12)


def test_a_scale_shows_the_whole_mass_of_which_a_twentieth_is_the_least() -> None:
    total = PlatformMass(0.5).totals(RECTANGLE)["mass"]
    assert (total.value, total.nominal, total.unit) == (2.5, 2.0, "kg")
    assert PlatformMass(-1.89).totals(RECTANGLE)["mass"].possible
    assert not PlatformMass(-1.91).totals(RECTANGLE)["mass"].possible


@pytest.mark.parametrize(("axis", "least", "most"), [
    ("x", -1.3, 1.3),
    ("y", -1.4, 1.4),
    ("z", -1.0, 1.0),
])  # fmt: skip
def test_a_centre_is_at_most_two_lengths_outside_of_the_anchor_points(
    axis: str, least: float, most: float
) -> None:
    """They are at +-0.3 m and +-0.4 m, and the robot's length is 0.5 m."""
    direction = np.eye(3)["xyz".index(axis)]
    for value, possible in {
        least + 0.01: True, most - 0.01: True, least - 0.01: False, most + 0.01: False,
    }.items():  # fmt: skip
        totals = CentreOfMass(value * direction).totals(RECTANGLE)
        assert {key: total.possible for key, total in totals.items()} == {
            **dict.fromkeys("xyz", True), axis: possible,
        }  # fmt: skip


def test_a_search_never_takes_the_whole_platform_away() -> None:
    assert layout_of(PlatformMass, RECTANGLE).lower == pytest.approx([-1.98])


# --- What a person who measures would find


# --- A frame that yields: sideways and upwards are two compliances, kept as one and a differenc


def test_a_compliance_of_old_files_is_that_of_both_directions() -> None:
    layout = layout_of(FrameCompliance, RECTANGLE)
    assert FrameCompliance.renamed["compliance_m_per_N"] == layout.names


# --- What sensors report, by quarter turns: nothing has to be computed


ABOUT_X, ABOUT_Z = np.array([np.pi / 2, 0.0, 0.0]), np.array([0.0, 0.0, np.pi / 2])
LEVEL = [1.0, 0, 0, 0]
NOTHING = np.zeros(3)
# not needed by what sensors report
SETUP: Any = None


def read(effect: Effect, position: list[float], quat: list[float]) -> tuple[Array, Array]:
    """What is reported of a platform at a position with an orientation."""
    readings = Readings(np.array([position]), np.array([quat]), np.array([[3.0, 5.0]]))
    effect.edit_readings(readings, SETUP)
    return readings.position[0], readings.quat_wxyz[0]


@pytest.mark.parametrize("effect", [
    TrackerFrame(NOTHING, NOTHING), TrackerFrame(np.array([1.0, 0, 0]), NOTHING),
    TrackerTarget(NOTHING, NOTHING), TrackerTarget(np.array([1.0, 0, 0]), NOTHING),
])  # fmt: skip
def test_without_a_turn_orientations_keep_every_bit(effect: Effect) -> None:
    quat = [0.1, 0.2, 0.3, 0.4]  # of no norm in particular: a multiplication would change bits
    assert read(effect, [1, 2, 3], quat)[1].tolist() == quat


def test_what_was_read_is_not_written_over() -> None:
    """The arrays of the readings may be those of the solved poses."""
    position, tensions = np.array([[1.0, 2.0, 3.0]]), np.array([[4.0]])
    readings = Readings(position, np.array([LEVEL]), tensions)
    for effect in (
        TrackerFrame(np.ones(3), ABOUT_Z), TrackerTarget(np.ones(3), ABOUT_X),
        TrackerScale(2.0), TensionScale(2.0),
    ):  # fmt: skip
        effect.edit_readings(readings, SETUP)
    assert position.tolist() == [[1.0, 2.0, 3.0]] and tensions.tolist() == [[4.0]]
