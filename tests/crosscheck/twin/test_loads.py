"""Known loads, told lengths, runs that start where they are, corrections: seecr and MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import experiment_of

from crosscheck.settle.settler import Settler
from crosscheck.suite.cases import demobot_sweep
from crosscheck.twin.measure import measure
from seecr.commands import Commands, Loads
from seecr.description.mjcf import CABLES, load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Effect, Term, effect_named
from seecr.inverse.correction import correct
from seecr.pose import pose_difference
from seecr.prediction.experiment import Experiment
from seecr.workspace.margins import feasible


def effect(name: str, **values: object) -> Effect:
    return effect_named(name)(**values)


def loads_of(robot: Robot, n: int, seed: int = 0) -> Loads:
    """Rows bare, with a payload at the platform's own centre and one elsewhere, and with a push."""
    rng = np.random.default_rng(seed)
    mass = robot.mass * np.array([0.0, 0.3, 0.2, 0.2, 0.0, 0.5])[:n]
    centre = 0.3 * robot.length * rng.uniform(-1, 1, (n, 3))
    centre[1::2] = np.nan
    wrench = 0.1 * robot.weight * rng.uniform(-1, 1, (n, 6)) * [1, 1, 1, *[robot.length] * 3]
    wrench[:2] = 0.0
    if robot.joints:  # a planar robot: nothing pushes it out of its plane
        wrench[:, [1, 3, 5]] = 0.0
    return Loads(mass, centre, wrench)


def agree(robot: Robot, commands: Commands, *effects: Effect) -> None:
    truth = measure(robot, commands, effects)
    ours = Experiment(robot, commands).predict(effects)
    assert truth.at_rest.all() and ours.solved.all()
    gap = pose_difference(truth.pose, ours.pose)
    assert np.abs(gap[:, :3]).max() < 1e-8 and np.abs(gap[:, 3:]).max() < 1e-7
    assert np.abs(truth.tensions - ours.tensions).max() < 1e-6
    assert np.abs(truth.position - ours.readings.position).max() < 1e-8


@pytest.mark.parametrize("kind", ["demobot_cogiro", "planar_vertical", "lengths"])
def test_loads_differ_from_row_to_row(kind: str) -> None:
    experiment = experiment_of(kind)
    robot, commands = experiment.robot, experiment.commands
    loads = loads_of(robot, len(commands))
    there = [effect("platform_mass", added=0.1 * robot.mass)]
    if kind != "planar_vertical":
        there += [effect("centre_of_mass", shift=np.array([0.01, -0.02, 0.01])),
                  effect("gravity_tilt", tilt_x=0.02, tilt_y=0.01)]  # fmt: skip
    agree(robot, replace(commands, loads=loads), *there)
    # a centre that did not move along, or a payload left out, would be seen
    bare = Experiment(robot, commands).predict(there)
    ours = Experiment(robot, replace(commands, loads=loads)).predict(there)
    assert np.abs(ours.pose - bare.pose)[1:4].max() > 1e-5


def test_lengths_as_told_go_through_winches_and_geometry() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot, commands = experiment.robot, experiment.commands
    told = replace(commands, lengths=robot.commanded_lengths(commands.pose), told=True)
    agree(
        robot, told,
        effect("drum_gain", gain=np.linspace(-0.01, 0.01, 8)),
        effect("pulley_radius", radius=0.01),
        effect("initial_pose_error", position=np.array([2e-3, 0, -1e-3]), rotation=np.zeros(3)),
        effect("drum_eccentricity", sine=np.full(8, 4e-4), cosine=np.full(8, 3e-4),
               drum_radius=0.02),
        effect("backlash", gap=1e-3),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("stands", [False, True])
def test_loads_and_starts_leave_the_same_history(stands: bool) -> None:
    experiment = experiment_of("demobot_cogiro", reach=0.5)
    robot, n = experiment.robot, len(experiment.commands)
    commands = replace(experiment.commands, loads=loads_of(robot, n), stands=np.full(n, stands))
    ours = Experiment(robot, commands)
    there = [effect("hysteresis", amplitude=0.2, stretch=2e-4), effect("backlash", gap=5e-4)]
    # between other points the laws take other steps
    truth, found = measure(robot, commands, there, steps=ours.path.steps), ours.predict(there)
    assert truth.at_rest.all() and found.solved.all()
    assert np.abs(pose_difference(truth.pose, found.pose)).max() < 1e-8
    without = Experiment(robot, replace(commands, stands=np.full(n, not stands))).predict(there)
    assert np.abs(pose_difference(truth.pose, without.pose)).max() > 1e-5


def test_cables_with_weight_carry_loads_too() -> None:
    experiment = experiment_of("demobot_cogiro", rows=3)
    robot = experiment.robot
    commands = replace(experiment.commands, loads=loads_of(robot, 3))
    there = [effect("cable_weight", weight=0.02)]
    truth = measure(robot, commands, there)
    ours = Experiment(robot, commands).predict(there)
    assert truth.at_rest.all()
    assert np.abs(pose_difference(truth.pose, ours.pose)[:, :3]).max() < 1e-7


@pytest.mark.parametrize("cable", CABLES)
def test_the_papers_sweep_is_level_and_straight(cable: str) -> None:
    path = model_path("demobot_cogiro")
    settler = Settler(path, ea=CABLES[cable])
    robot = load_robot(path)
    robot = replace(robot, ea=np.full(robot.n_cables, CABLES[cable]))
    found = correct(robot, demobot_sweep(0.1, 5))
    assert found.reached.all()
    for want, rest in zip(found.wanted, found.solution.rest_lengths, strict=True):
        settling = settler.settle(want, rest_lengths=rest)
        assert settling.settled
        assert np.abs(pose_difference(settling.pose, want)).max() < 1e-9


def test_told_lengths_lead_a_robot_with_effects_to_the_poses() -> None:
    robot = load_robot(model_path("demobot_parallel"))
    effects = [
        Term.of(robot, "drum_gain", **{f"gain_{i}": 0.002 * i for i in range(1, 9)}),
        Term.of(robot, "pulley_radius", radius_m=0.008),
        Term.of(robot, "stiffness", factor=0.4),
    ]
    poses = demobot_sweep(0.2, 24)
    poses = poses[feasible(robot, poses)]
    assert len(poses) > 8
    plain = measure(robot, Commands(poses), [term.effect() for term in effects])
    found = correct(robot, poses[1:-1], effects=effects)
    assert found.reached.all()
    truth = measure(robot, found.commands, [term.effect() for term in effects])
    assert truth.at_rest.all()
    assert np.abs(pose_difference(plain.pose, poses)[:, :3]).max() > 1e-4
    assert np.abs(pose_difference(truth.pose, found.wanted)).max() < 1e-9


@pytest.mark.slow
def test_with_a_memory_a_micrometre_is_left() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    effects = [
        Term.of(robot, "backlash", gap_m=1e-3),
        Term.of(robot, "hysteresis", amplitude_N=0.05, stretch_m=3e-4),
    ]
    there = demobot_sweep(0.15, 5)
    found = correct(robot, Commands(np.concatenate([there, there[::-1]])), effects=effects)
    truth = measure(robot, found.commands, [term.effect() for term in effects])
    assert truth.at_rest.all()
    assert np.abs(pose_difference(truth.pose, found.wanted)[:, :3]).max() < 1e-6
