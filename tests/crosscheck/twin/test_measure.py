"""Robots with effects in MuJoCo, against seecr's physics and against closed forms."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from effect_cases import experiment_of

from crosscheck.errors import CrosscheckError
from crosscheck.settle.relaxation import SettleStatus, come_to_rest
from crosscheck.suite.effects import effect_cases, run_effect
from crosscheck.twin.cable import Springs, hang
from crosscheck.twin.measure import measure, paid_out, waypoints_of
from crosscheck.twin.robot import TRUE_EFFECTS, true_robot
from crosscheck.twin.world import World, descend
from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import BUILT_IN, Effect, effect_named, parameter
from seecr.pose import pose_difference, quat_from_rotvec
from seecr.prediction.experiment import Experiment

ROBOTS = ("demobot_cogiro", "demobot_parallel", "planar_vertical")
CASES = {case.name: case for case in effect_cases(ROBOTS)}
# Each effect on one of the DemoBots, by turns, and on the plane robot; on all three in a sweep, as
# in `crosscheck run`.
EFFECTS = list(dict.fromkeys(case.effect for case in CASES.values()))
AGREE = [
    pytest.param(name, marks=pytest.mark.sweep)
    if ROBOTS[EFFECTS.index(case.effect) % 2] in name
    else name
    for name, case in CASES.items()
]
# What these move no reading of, by their nature.
UNMOVED = {"tension_scale"}


def robot_named(name="demobot_parallel"):
    return load_robot(model_path(name))


def commands_of(robot, x):
    poses = np.tile(robot.reference_pose, (len(x), 1))
    poses[:, 0] += x
    return Commands(pose=poses)


def effect(name, **values):
    return effect_named(name)(**values)


def distance(a, b):
    return np.linalg.norm(pose_difference(a, b)[:, :3], axis=1)


def test_every_built_in_effect_has_a_truth():
    assert {one.name for one in BUILT_IN} == set(TRUE_EFFECTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", AGREE)
def test_seecr_and_mujoco_agree_on_an_effect(name):
    found = run_effect(CASES[name])
    assert found.compared.all(), "not every pose came to rest in both"
    position, orientation, tension = found.worst
    # both are exact: what is left is rounding, and for chains what Richardson leaves
    assert position < 1e-8 and orientation < 1e-7 and tension < 1e-6
    if found.case.effect not in UNMOVED and "planar" not in name:
        # the agreement means something: the effect moves what is compared by far more
        assert found.moved_m > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.02, 0.2])
def test_chains_come_to_the_catenary_with_the_square_of_the_segments(weight):
    robot = robot_named()
    commands = commands_of(robot, [-0.2, 0.03])
    effects = [effect("cable_weight", weight=weight)]
    exact = Experiment(robot, commands).predict(effects)
    errors = []
    for segments in (4, 8, 16):
        truth = measure(robot, commands, effects, segments=(segments,))
        errors.append(np.max(distance(truth.pose, exact.pose)))
    assert 3.7 < errors[0] / errors[1] < 4.4
    assert 3.8 < errors[1] / errors[2] < 4.3
    extrapolated = measure(robot, commands, effects, segments=(8, 16))
    assert np.max(distance(extrapolated.pose, exact.pose)) < 0.02 * errors[2]
    # a cable that the weightless robot has slack hangs, and carries its own weight
    assert np.all(extrapolated.tensions > 0.0)


def test_mujoco_moves_a_chain_to_where_newton_says_it_rests():
    robot = robot_named("planar_two_cable")
    true = true_robot(robot, [effect("cable_weight", weight=2.0)])
    world = World(true, 3)
    world.set_springs(Springs.plain(robot.rest_lengths, true))
    world.place(robot.reference_pose)
    assert descend(world).at_rest
    rest = world.pose()
    world.data.qpos[:] += 1e-3 * np.sin(np.arange(len(world.data.qpos)))
    world.update()
    assert come_to_rest(world, 1e-6, 400_000).status is SettleStatus.SETTLED
    assert np.linalg.norm(pose_difference(world.pose(), rest)[:3]) < 1e-5


def test_a_hanging_chain_balances_at_every_mass():
    start, end = np.array([[0.0, 0.0, 1.0]]), np.array([[0.4, 0.0, 0.7]])
    weight, rest, n = 0.5, 0.8, 7
    up = np.array([0.0, 0.0, weight])
    nodes = hang(start, end, np.array([rest]), np.array([300.0]), up, n)[0]
    points = np.concatenate([start, nodes, end])
    pieces = np.diff(points, axis=0)
    lengths = np.linalg.norm(pieces, axis=1, keepdims=True)
    pull = 300.0 * (lengths * n / rest - 1.0) * pieces / lengths
    load = np.array([0.0, 0.0, -weight * rest / n])
    np.testing.assert_allclose(pull[1:] - pull[:-1] + load, 0.0, atol=1e-10)


@pytest.mark.parametrize("x", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("z", [-0.9, -0.2, 0.05, 0.4])
def test_cables_over_sheaves_have_the_contract_s_length(x, z):
    robot = robot_named()
    r = 0.01
    true = true_robot(robot, [effect("pulley_radius", radius=r)])
    towards = np.array([0.6, 0.8, 0.0])
    true.anchor_points = true.exit_points + x * towards + np.array([0.0, 0.0, z])
    true.anchor_points -= robot.reference_pose[:3]
    world = World(true)
    world.place(robot.reference_pose)
    assert world.wraps
    # seen from the sheave's centre: the anchor, the tangent to it, the wrap from the entry on
    far = np.hypot(x - r, z)
    free = np.sqrt(far**2 - r**2)
    psi = np.arctan2(z, x - r) + np.arccos(r / far)
    np.testing.assert_allclose(world.cable_lengths(), free + r * (np.pi - psi), rtol=1e-12)


def test_a_platform_that_is_free_to_move_is_not_at_rest():
    # two cables stay taut, and the platform turns about the line through their anchor points
    robot = robot_named()
    pose = np.array([0.5378879997614161, 0.17352922227061454, 0.14737443955367602, 1, 0, 0, 0])
    turn = quat_from_rotvec(np.array([0.0535, -0.0662, -0.0308]))
    pose[3:] = turn
    truth = measure(
        robot, Commands(pose=pose[None]), [effect("pulley_radius", radius=0.01737460411527584)]
    )
    taut = np.sum(truth.tensions > 0.0)
    assert taut == 2 and truth.free[0] and not truth.at_rest[0]


@pytest.mark.slow
def test_hysteresis_leaves_a_loop_and_forgets_it_between_runs():
    robot = dataclasses.replace(robot_named(), ea=np.full(8, 300.0))
    forth = np.linspace(-0.2, 0.2, 5)
    x = np.concatenate([forth, forth[::-1], forth])
    run = np.repeat([0, 0, 1], 5)
    commands = Commands(pose=commands_of(robot, x).pose, run=run)
    truth = measure(robot, commands, [effect("hysteresis", amplitude=0.05, stretch=3e-4)])
    there, back, again = truth.pose.reshape(3, 5, 7)
    apart = distance(there[1:-1], back[::-1][1:-1])
    assert np.all(apart > 5e-5)
    np.testing.assert_allclose(again, there, atol=1e-9)


@pytest.mark.parametrize("kind, seed", [
    ("demobot_cogiro", 0), ("jointed", 1), ("jointed", 2), ("lengths", 0),
])  # fmt: skip
def test_winches_that_turn_round_between_points_take_up_their_play_there(kind, seed):
    experiment = experiment_of(kind, seed=seed, rows=8)
    robot, commands = experiment.robot, experiment.commands
    backlash = [effect("backlash", gap=2e-3)]
    true = true_robot(robot, backlash)
    found = []
    for steps in (2, 3):
        path = waypoints_of(true, commands, np.full(len(commands), steps))
        found.append(paid_out(true, path, None)[path.is_row])
    # what 64 parts of a way leave: two ways of looking for the same extrema
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        found[0], experiment.setup(backlash).rest_lengths(), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_on_joints_is_led_straight_along_them(seed):
    experiment = experiment_of("jointed", seed=seed, rows=4)
    robot, commands = experiment.robot, experiment.commands
    path = waypoints_of(true_robot(robot, []), commands, experiment.path.steps)
    np.testing.assert_allclose(path.pose, experiment.path.commands.pose, atol=1e-12)


def test_creep_under_a_held_pose_goes_as_kelvin_and_voigt_say():
    robot = robot_named("planar_two_cable")
    n, step, time, amount = 12, 20.0, 60.0, 0.3
    commands = commands_of(robot, np.zeros(n))
    commands = Commands(pose=commands.pose, run=np.zeros(n), time=step * np.arange(n))
    effects = [effect("creep", amount=amount, time=time)]
    truth = measure(robot, commands, effects)
    stretched = robot.nominal_lengths(truth.pose) - truth.rest_lengths
    elastic = truth.tensions * truth.rest_lengths / robot.ea
    expected = amount * elastic[0] * (1.0 - np.exp(-step * np.arange(n) / time))[:, None]
    np.testing.assert_allclose(stretched - elastic, expected, rtol=1e-3, atol=1e-12)


@dataclass(frozen=True, eq=False)
class Moonlight(Effect):
    name: ClassVar[str] = "moonlight"

    amount: float = parameter("", 1.0)


def test_an_effect_without_a_truth_is_refused():
    with pytest.raises(
        CrosscheckError, match="moonlight: MuJoCo cannot simulate it; expected one of"
    ):
        true_robot(robot_named(), [Moonlight()])
