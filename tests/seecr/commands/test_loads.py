"""Known loads, lengths as told to the winches, and where runs start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from effect_cases import experiment_of, full_difference, random_term, robot_of

from seecr.commands import Commands, Loads, waypoints_of
from seecr.effects import Effect, Terms, effect_named
from seecr.errors import InputError
from seecr.prediction.experiment import Experiment, Prediction
from seecr.prediction.sensitivity import sensitivities

PAYLOAD, CENTRE = 0.15, np.array([0.03, -0.02, -0.05])


def effect(name: str, **values: object) -> Effect:
    return effect_named(name)(**values)


def with_loads(experiment: Experiment, loads: Loads | None) -> Experiment:
    return Experiment(experiment.robot, replace(experiment.commands, loads=loads))


def solved(experiment: Experiment, *effects: Effect) -> Prediction:
    found = experiment.predict(effects)
    assert np.all(found.solved)
    return found


def same(one: Prediction, other: Prediction, rows: Sequence[int] | slice = slice(None)) -> None:
    assert one.pose[rows] == pytest.approx(other.pose[rows], abs=1e-11)
    assert one.tensions[rows] == pytest.approx(other.tensions[rows], rel=1e-8, abs=1e-8)


# --- statics -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["demobot_cogiro", "planar_vertical", "lengths"])
def test_a_payload_is_a_heavier_platform_with_its_centre_of_mass_between(kind: str) -> None:
    experiment = experiment_of(kind)
    robot, n = experiment.robot, len(experiment.commands)
    centre = CENTRE * [1.0, 0.0 if kind == "planar_vertical" else 1.0, 1.0]
    loaded = solved(with_loads(experiment, Loads.of(n, mass=PAYLOAD, centre=centre)))
    mass = robot.mass + PAYLOAD
    between = (robot.mass * robot.centre_of_mass + PAYLOAD * centre) / mass
    heavy = replace(robot, mass=mass, centre_of_mass=between)
    same(loaded, solved(Experiment(heavy, experiment.commands)))
    assert np.abs(loaded.pose - solved(experiment).pose).max() > 1e-5


def test_no_load_changes_nothing_bit_for_bit() -> None:
    experiment = experiment_of("demobot_cogiro")
    nothing = with_loads(experiment, Loads.of(len(experiment.commands), centre=CENTRE))
    assert np.array_equal(solved(nothing).pose, solved(experiment).pose)


def test_effects_move_the_default_centre_along_and_turn_its_weight() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot, n = experiment.robot, len(experiment.commands)
    there = (
        effect("centre_of_mass", shift=CENTRE),
        effect("gravity_tilt", tilt_x=0.02, tilt_y=-0.01),
        effect("platform_mass", added=0.05),
    )
    loaded = solved(with_loads(experiment, Loads.of(n, mass=PAYLOAD)), *there)
    heavy = replace(robot, mass=robot.mass + PAYLOAD)
    same(loaded, solved(Experiment(heavy, experiment.commands), *there))


def test_a_known_wrench_acts_like_the_effect_and_beside_it() -> None:
    experiment = experiment_of("demobot_cogiro")
    n, push = len(experiment.commands), np.array([0.3, -0.2, 0.4])
    twist = np.array([0.01, 0.02, -0.01])
    loads = Loads.of(n, wrench=np.concatenate([push, twist]))
    wrench = effect("external_wrench", force=push, moment=twist)
    same(solved(with_loads(experiment, loads)), solved(experiment, wrench))
    twice = effect("external_wrench", force=2 * push, moment=2 * twist)
    same(solved(with_loads(experiment, loads), wrench), solved(experiment, twice))


def test_loads_of_another_shape_are_refused() -> None:
    with pytest.raises(InputError, match=r"payload centre must be \(3, 3\), got \(2,\)"):
        Loads.of(3, centre=np.zeros(2))
    with pytest.raises(InputError, match="wrench must be finite numbers"):
        Loads.of(1, wrench=np.full(6, np.nan))


@pytest.mark.parametrize(
    "name", ["platform_mass", "centre_of_mass", "gravity_tilt", "stiffness", "pulley_radius"]
)
def test_sensitivities_stay_exact_under_loads(name: str) -> None:
    bare = experiment_of("demobot_cogiro", rows=3)
    mass = np.array([PAYLOAD, 0.0, 2 * PAYLOAD])
    centre = np.array([CENTRE, CENTRE, [np.nan] * 3])
    wrench = np.outer([0.0, 1.0, -0.5], [0.3, -0.2, 0.4, 0.01, 0.02, -0.01])
    experiment = with_loads(bare, Loads(mass, centre, wrench))
    term = random_term(np.random.default_rng(4), experiment, name)
    terms = Terms([term])
    found = sensitivities(experiment, terms, experiment.predict(terms.effects))
    for k in range(len(term.layout)):
        step = 1e-3 * float(term.layout.scale[k])
        truth = full_difference(experiment, terms, term, k, step)
        assert found[..., k] == pytest.approx(truth, rel=1e-4, abs=1e-5 * np.abs(truth).max())


# --- lengths as told -----------------------------------------------------------------------------

TOLD = (
    ("drum_gain", {"gain": np.linspace(-0.01, 0.01, 8)}),
    ("cable_length_offset", {"offset": np.linspace(-1e-3, 1e-3, 8)}),
    ("drum_eccentricity", {"sine": np.full(8, 5e-4), "cosine": np.full(8, 3e-4),
                           "drum_radius": 0.02}),
    ("initial_pose_error", {"position": np.array([2e-3, -1e-3, 1e-3]),
                            "rotation": np.array([0.01, 0.0, -0.01])}),
    ("pulley_radius", {"radius": 0.01}),
)  # fmt: skip


@pytest.mark.parametrize(("name", "values"), TOLD)
def test_lengths_as_told_are_poses_said_in_the_winches_words(name: str, values: dict) -> None:
    experiment = experiment_of("demobot_cogiro", rows=3)
    robot, poses = experiment.robot, experiment.commands.pose
    told = replace(experiment.commands, lengths=robot.commanded_lengths(poses), told=True)
    there = effect(name, **values)
    by_pose, by_length = solved(experiment, there), solved(Experiment(robot, told), there)
    same(by_length, by_pose)
    if name != "cable_length_offset":  # a constant is a constant to both
        absolute = solved(Experiment(robot, replace(told, told=False)), there)
        assert np.abs(absolute.pose - by_pose.pose).max() > 1e-5


def test_backlash_starts_centred_on_the_told_reference() -> None:
    experiment = experiment_of("demobot_cogiro", rows=2)
    robot = experiment.robot
    lengths = robot.rest_lengths + np.array([[0.01], [0.005]])
    commands = Commands(experiment.commands.pose, lengths=lengths, told=True)
    setup = Experiment(robot, commands).setup([effect("backlash", gap=4e-3)])
    paid = setup.rest_lengths() - robot.rest_lengths
    assert paid == pytest.approx(np.repeat([[0.008], [0.007]], 8, axis=1), abs=1e-12)


# --- the way -------------------------------------------------------------------------------------


def test_a_payload_hangs_before_the_way_to_its_row_begins() -> None:
    robot = robot_of("demobot_cogiro")
    poses = experiment_of("demobot_cogiro").commands.pose[:3]
    commands = Commands(poses, loads=Loads.of(3, mass=np.array([0.1, 0.2, 0.2])))
    path = waypoints_of(robot, commands)
    assert path.commands.loads is not None
    mass = path.commands.loads.mass
    first, second, third = path.rows.tolist()
    assert np.all(mass[: first + 1] == 0.1) and np.all(mass[first + 1 :] == 0.2)
    assert np.array_equal(path.commands.pose[0], robot.reference_pose)
    assert path.commands.pose[first + 1] == pytest.approx(poses[0], abs=1e-12)
    assert (second - first, third - second) == (path.steps[1] + 1, path.steps[2])
    assert path.fresh.sum() == 1


@pytest.mark.parametrize("name", ["hysteresis", "exit_friction"])
def test_hung_on_at_the_row_before_it_leaves_the_same_history(name: str) -> None:
    bare = experiment_of("demobot_cogiro")
    term = random_term(np.random.default_rng(0), bare, name, part=1.0)
    a, b = bare.commands.pose[0], bare.commands.pose[1]
    short = Commands(np.array([a, b]), loads=Loads.of(2, mass=np.array([0.0, PAYLOAD])))
    said = Commands(np.array([a, a, b]), loads=Loads.of(3, mass=np.array([0.0, PAYLOAD, PAYLOAD])))
    one = solved(Experiment(bare.robot, short), term.effect())
    other = solved(Experiment(bare.robot, said), term.effect())
    assert one.pose[1] == pytest.approx(other.pose[2], abs=1e-9)
    late = replace(
        said, pose=np.array([a, b, b]), loads=Loads.of(3, mass=np.array([0.0, 0.0, PAYLOAD]))
    )
    assert (
        np.abs(solved(Experiment(bare.robot, late), term.effect()).pose[2] - one.pose[1]).max()
        > 1e-8
    )


def test_a_run_that_starts_at_its_first_row_has_no_history_there() -> None:
    experiment = experiment_of("demobot_cogiro")
    n = len(experiment.commands)
    stands = Experiment(experiment.robot, replace(experiment.commands, stands=np.ones(n, bool)))
    path = stands.path
    assert np.array_equal(np.flatnonzero(path.fresh), path.rows[[0, 3]])
    assert np.array_equal(path.commands.pose[path.rows], experiment.commands.pose)
    play, dahl = effect("backlash", gap=2e-3), effect("hysteresis", amplitude=0.3, stretch=1e-4)
    plain = solved(experiment)
    for one in (play, dahl):
        here = solved(stands, one)
        assert here.pose[[0, 3]] == pytest.approx(plain.pose[[0, 3]], abs=1e-10)
        assert np.abs(here.pose - plain.pose)[[1, 2, 4, 5]].max() > 1e-6
        assert np.abs(here.pose - solved(experiment, one).pose).max() > 1e-6


def test_creep_knows_nothing_of_what_another_clock_saw() -> None:
    experiment = experiment_of("demobot_cogiro")
    there = effect("creep", amount=0.2, time=30.0)
    clocks = replace(experiment.commands, clock=np.repeat([0, 1], 3))
    found = solved(Experiment(experiment.robot, clocks), there)
    commands = experiment.commands
    assert commands.time is not None
    alone = Commands(commands.pose[3:], time=commands.time[3:], temperature=None)
    assert found.pose[3:] == pytest.approx(
        solved(Experiment(experiment.robot, alone), there).pose, abs=1e-10
    )
    assert np.abs(found.pose - solved(experiment, there).pose)[3:].max() > 1e-7


def test_commands_with_other_poses_do_not_keep_the_lengths_of_the_old_ones() -> None:
    experiment = experiment_of("demobot_cogiro")
    robot, commands = experiment.robot, experiment.commands
    before = commands.nominal_change(robot)
    other = replace(commands, pose=commands.pose[::-1].copy())
    assert np.array_equal(other.nominal_change(robot), before[::-1])
