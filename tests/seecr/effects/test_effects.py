"""All effects alike: absent at null, continuous, well described, differentiable, combinable."""

from __future__ import annotations

import inspect
import itertools
from dataclasses import replace

import numpy as np
import pytest
from effect_cases import (
    KINDS,
    experiment_of,
    full_difference,
    moved,
    random_effect,
    random_term,
    robot_of,
    worst_mismatch,
)
from random_robots import random_robot

import seecr
from seecr.effects import BUILT_IN, PLACES, Layout

# what users' model files and other people's scripts name
PROMISED = {
    "actuation": "cable_length_offset length_scale initial_pose_error drum_gain "
    "drum_eccentricity backlash "
    "thermal_expansion",
    "geometry": "pulley_radius exit_point_error anchor_point_error",
    "cable": "stiffness cable_stiffness nonlinear_elasticity winch_side_length cable_weight "
    "hysteresis creep exit_friction",
    "structure": "frame_compliance",
    "load": "platform_mass centre_of_mass external_wrench gravity_tilt",
    "sensing": "tracker_frame tracker_target tracker_scale tension_scale",
}
NAMES = [name for names in PROMISED.values() for name in names.split()]
UNITS = {"", "m", "rad", "N", "Nm", "s", "C", "kg", "1_per_K", "N_per_m", "m_per_N"}


def layouts(robot: seecr.Robot) -> list[Layout]:
    return [seecr.layout_of(effect, robot) for effect in BUILT_IN]


# --- what there is, and how it is described ------------------------------------------------------


def test_the_promised_effects_are_there_in_their_places() -> None:
    places = {place: sorted(names.split()) for place, names in PROMISED.items()}
    found: dict[str, list[str]] = {place: [] for place in PLACES}
    for effect in BUILT_IN:
        found[effect.place].append(effect.name)
    assert {place: sorted(names) for place, names in found.items()} == places
    assert set(NAMES) <= set(seecr.catalogue())


@pytest.mark.parametrize("effect", BUILT_IN, ids=lambda e: e.name)
def test_an_effect_says_what_it_is_and_how_to_check_it(effect: type[seecr.Effect]) -> None:
    words = inspect.getdoc(effect)
    assert words and words != inspect.getdoc(seecr.Effect)
    assert any(sign in words for sign in ("=", "->", "<-", "T length", "exp("))  # a formula
    assert effect.title and effect.title[0].islower() and not effect.title.endswith(".")
    assert len(effect.advice.split()) > 4
    assert set(effect.needs) <= {"time", "temperature", "poses", "tensions"}
    assert effect.parent == "" or effect.parent in seecr.catalogue()


# --- parameters ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_layout_gives_back_the_vector_it_was_given(name: str) -> None:
    robot = robot_of("demobot_cogiro")
    layout = seecr.layout_of(seecr.effect_named(name), robot)
    vector = np.random.default_rng(1).normal(size=len(layout))
    effect = layout.build(vector)
    again = np.concatenate([np.atleast_1d(getattr(effect, f)) for f in vars(effect)])
    assert np.array_equal(again, vector)
    again[:] = 0.0  # what was built is a copy
    assert np.array_equal(np.concatenate([np.atleast_1d(v) for v in vars(effect).values()]), vector)
    assert layout.name == name and len(layout.names) == len(layout.units) == len(vector)


@pytest.mark.parametrize("cables", [3, 8, 12])
def test_parameter_names_are_unique_and_end_in_their_unit(cables: int) -> None:
    robot = random_robot(np.random.default_rng(0), "free", cables)
    for layout in layouts(robot):
        assert len(set(layout.names)) == len(layout.names)
        for name, unit in zip(layout.names, layout.units, strict=True):
            assert unit in UNITS
            assert name.endswith(f"_{unit}") if unit else not name.endswith("_")
    assert seecr.layout_of(seecr.effect_named("drum_gain"), robot).names[-1] == f"gain_{cables}"
    assert seecr.layout_of(seecr.effect_named("exit_point_error"), robot).names[4] == "error_2_y_m"
    assert seecr.layout_of(seecr.effect_named("pulley_radius"), robot).names == ("radius_m",)


@pytest.mark.parametrize("size", [0.01, 1.0, 40.0])
def test_bounds_hold_the_null_and_sizes_are_positive_on_robots_of_any_size(size: float) -> None:
    for layout in layouts(scaled(robot_of("demobot_cogiro"), size)):
        assert np.all(layout.lower < layout.upper), layout.name
        assert np.all((layout.lower <= layout.null) & (layout.null <= layout.upper)), layout.name
        assert np.all(np.isfinite(layout.scale) & (layout.scale > 0)), layout.name
        free = ~layout.shape
        up = layout.null + layout.scale <= layout.upper
        down = layout.null - layout.scale >= layout.lower
        assert np.all((up | down)[free]), layout.name


def scaled(robot: seecr.Robot, by: float) -> seecr.Robot:
    """The robot with all lengths so many times as large, and the same strains."""
    pose = robot.reference_pose.copy()
    pose[:3] *= by
    return replace(
        robot, exit_points=robot.exit_points * by, anchor_points=robot.anchor_points * by,
        rest_lengths=robot.rest_lengths * by, centre_of_mass=robot.centre_of_mass * by,
        reference_pose=pose,
    )  # fmt: skip


def test_plausible_sizes_grow_with_the_robot_as_their_units_say() -> None:
    power = {"m": 1, "m_per_N": 1, "Nm": 1, "N_per_m": -1}
    robot = robot_of("demobot_parallel")
    for small, large in zip(layouts(robot), layouts(scaled(robot, 10.0)), strict=True):
        growth = [10.0 ** power.get(unit, 0) for unit in small.units]
        assert large.scale == pytest.approx(small.scale * growth, rel=1e-9), small.name


def test_start_sets_the_shape_parameters_only() -> None:
    layout = seecr.layout_of(seecr.effect_named("hysteresis"), robot_of("demobot_cogiro"))
    assert layout.start({"stretch": 0.004}).tolist() == [0.0, 0.004]
    assert layout.shape.tolist() == [False, True]


# --- null and continuity -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_at_null_an_effect_changes_no_bit_of_any_reading(name: str, kind: str) -> None:
    experiment = experiment_of(kind)
    plain = experiment.predict()
    layout = seecr.layout_of(seecr.effect_named(name), experiment.robot)
    shapes = layout.effect.shapes(experiment.setup([])) or [{}]
    for shape in (shapes[0], shapes[-1], {}):
        vector = np.where(layout.shape, layout.start(shape), layout.null)
        found = experiment.predict([layout.build(vector)])
        assert not found.has_history
        for reading in ("position", "quat_wxyz", "tensions"):
            assert np.array_equal(
                getattr(found.readings, reading), getattr(plain.readings, reading)
            )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_a_small_effect_makes_a_small_change(name: str, kind: str) -> None:
    if kind == "lengths" and name == "initial_pose_error":
        pytest.skip("lengths commanded as such have no zero pose")
    experiment = experiment_of(kind)
    unit = np.array([experiment.robot.length] * 3 + [1.0] * 3
                    + [experiment.robot.weight] * experiment.robot.n_cables)  # fmt: skip
    sizes = [
        np.abs(moved(experiment, [random_effect(experiment, name, part=part)]) / unit).max()
        for part in (0.3, 3e-3, 3e-5)
    ]
    assert sizes[0] > 1e-6  # it does something
    assert sizes[1] < 0.1 * sizes[0] and sizes[2] < 0.1 * sizes[1] + 1e-10


# --- sensitivities -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [*KINDS, "jointed"])
@pytest.mark.parametrize("name", NAMES)
def test_sensitivities_are_what_solving_again_gives(name: str, kind: str) -> None:
    experiment = experiment_of(kind, seed=5)
    terms = seecr.Terms([random_term(np.random.default_rng(7), experiment, name)])
    at = experiment.predict(terms.effects)
    assert np.all(at.solved)
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


COMBINATIONS = [
    ("cable_weight", "pulley_radius", "hysteresis", "creep", "exit_friction", "frame_compliance"),
    *[tuple(np.random.default_rng(seed).permutation(NAMES)[: 2 + seed % 3]) for seed in range(20)],
]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(len(COMBINATIONS)))
def test_effects_together_are_solved_and_differentiated(seed: int) -> None:
    # nothing has a derivative where a cable is a micrometre from slack: other poses then
    for poses in range(seed, seed + 10):
        experiment = experiment_of((*SHAPES, *KINDS)[seed % 7], seed=poses)
        rng = np.random.default_rng(seed)
        terms = seecr.Terms(random_term(rng, experiment, name) for name in COMBINATIONS[seed])
        at = experiment.predict(terms.effects)
        assert np.all(at.solved), COMBINATIONS[seed]
        nearly_slack = (at.tensions > 0.0) & (at.tensions < 1e-3 * experiment.robot.weight)
        if not nearly_slack.any():
            break
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-3, (COMBINATIONS[seed], whose)


def test_a_cable_that_turns_round_within_a_step_of_the_difference_has_its_derivative() -> None:
    """At a fixed pose the step stretches a stiff cable further than its motion does."""
    experiment = experiment_of("free", seed=1)
    radius = seecr.Term.of(experiment.robot, "pulley_radius", radius_m=0.0184)
    sticking = seecr.Term.of(experiment.robot, "hysteresis", amplitude_N=1.34, stretch_m=2.36e-4)
    terms = seecr.Terms([radius, sticking])
    found = seecr.sensitivities(experiment, terms, experiment.predict(terms.effects))[..., 6:, 0]
    full = full_difference(experiment, terms, radius, 0, 1e-4 * radius.layout.scale[0])[:, 6:]
    assert found == pytest.approx(full, abs=1e-3 * np.abs(full).max())


SHAPES = ("free", "planar", "jointed")


@pytest.mark.parametrize("seed", range(6))
def test_the_order_of_effects_on_the_robot_does_not_matter(seed: int) -> None:
    experiment = experiment_of("demobot_cogiro", seed=seed)
    rng = np.random.default_rng(seed)
    robot_side = [n for n in NAMES if n not in PROMISED["sensing"].split()]
    names = rng.permutation(robot_side)[:3]
    effects = [random_effect(experiment, name, seed) for name in names]
    first = moved(experiment, effects)
    for order in itertools.permutations(effects):
        assert moved(experiment, order) == pytest.approx(first, rel=1e-7, abs=1e-10), names


# --- what is said when it is used wrongly --------------------------------------------------------


def test_an_unknown_effect_is_answered_with_the_known_ones_nearest_first() -> None:
    with pytest.raises(seecr.InputError) as caught:
        seecr.effect_named("pully_radius")
    text = str(caught.value)
    assert "'pully_radius'" in text and "\n" not in text
    listed = text.split("nearest first: ")[1].split(", ")
    assert listed[0] == "pulley_radius" and sorted(listed) == sorted(seecr.catalogue())


@pytest.mark.parametrize("name", NAMES)
def test_plausible_sizes_are_some_without_gravity_too(name: str) -> None:
    """A robot under pretension alone: sizes of 0 had been divided by."""
    robot = seecr.load_robot("ipanema")
    floating = seecr.layout_of(seecr.catalogue()[name], replace(robot, gravity=np.zeros(3)))
    assert np.all(np.isfinite(floating.scale)) and np.all(floating.scale > 0.0)
