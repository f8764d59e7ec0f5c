"""Derivatives of readings beyond those of single effects (test_effects.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import KINDS, experiment_of, random_term, robot_of, worst_mismatch
from random_robots import random_poses

import seecr
from seecr.compiled.columns import ARM, FORCE, REST, STRAIN
from seecr.pose import Array, pose_difference
from seecr.prediction import sensitivity
from seecr.prediction.sensitivity import (
    are_by_point,
    cable_rates,
    length_sensitivities,
    read_by_length,
    readings_difference,
)


@pytest.mark.parametrize("kind", [*KINDS, "free", "planar", "jointed"])
def test_by_rest_lengths_as_solving_again_gives(kind: str) -> None:
    experiment = experiment_of(kind, seed=2)
    robot, poses = experiment.robot, experiment.commands.pose
    found = length_sensitivities(experiment.predict())
    rest = experiment.setup([]).rest_lengths()
    assert found.shape == (6, 6 + robot.n_cables, robot.n_cables)
    for i in range(robot.n_cables):
        step = np.zeros(robot.n_cables)
        step[i] = 1e-6 * robot.length
        ahead, behind = (seecr.solve(robot, poses, rest_lengths=rest + s * step) for s in (1, -1))
        move = pose_difference(ahead.pose, behind.pose) / (2 * step[i])
        pull = (ahead.tensions - behind.tensions) / (2 * step[i])
        assert found[:, :6, i] == pytest.approx(move, rel=1e-4, abs=1e-5 * np.abs(move).max())
        assert found[:, 6:, i] == pytest.approx(pull, rel=1e-4, abs=1e-5 * np.abs(pull).max())


@pytest.mark.parametrize("part", [1e-9, -1e-9])
def test_by_rest_lengths_on_one_side_of_the_kink_where_a_cable_goes_slack(part: float) -> None:
    """A step across it would give a mean of both sides, at which nothing is right."""
    experiment = experiment_of("demobot_parallel", seed=2)
    there = experiment.predict()
    row, cable = np.argwhere(there.slack)[0]
    states, cables = there.found.states[row, cable], there.tables.cables[row, cable]
    gap = -states[STRAIN] * cables[REST]
    assert gap > 1e-4

    def rates(by: float) -> Array:
        errors = np.zeros(there.tensions.shape)
        errors[row, cable] = -gap - by
        at = experiment.with_length_errors(errors).predict((), there)
        assert at.slack[row, cable] == (by < 0.0)
        return length_sensitivities(at)[row]

    length = experiment.robot.length
    near, far = rates(part * length), rates(1e3 * part * length)
    assert near == pytest.approx(far, rel=1e-2, abs=1e-3 * np.abs(far).max())
    assert (near[6 + cable, cable] == 0.0) == (part < 0.0)


@pytest.mark.parametrize("kind", ["free", "planar", "jointed"])
@pytest.mark.parametrize("seed", range(4))
def test_a_constant_moment_has_no_potential_and_is_accounted_for(kind: str, seed: int) -> None:
    """It skews the stiffness, which an energy's second derivative cannot show."""
    experiment = experiment_of(kind, seed=seed)
    rng = np.random.default_rng(seed)
    terms = seecr.Terms([random_term(rng, experiment, "external_wrench", part=3.0)])
    at = experiment.predict(terms.effects)
    if not np.all(at.solved):
        pytest.skip("this robot does not hold against such a moment")
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


def test_columns_picks_parameters_through_all_terms() -> None:
    experiment = experiment_of("demobot_cogiro")
    rng = np.random.default_rng(0)
    names = ("pulley_radius", "drum_gain", "tracker_target")
    terms = seecr.Terms(random_term(rng, experiment, name) for name in names)
    at = experiment.predict(terms.effects)
    whole = seecr.sensitivities(experiment, terms, at)
    assert whole.shape == (6, 14, 1 + 8 + 6)
    some = seecr.sensitivities(experiment, terms, at, columns=(9, 0, 3))
    assert some == pytest.approx(whole[..., [9, 0, 3]], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", ["hysteresis", "creep", "backlash", "exit_friction"])
def test_history_that_is_not_there_yet_is_seen_from_its_null(name: str) -> None:
    """One-sided: its amplitude cannot be negative."""
    experiment = experiment_of("demobot_parallel", seed=3)
    layout = seecr.layout_of(seecr.effect_named(name), experiment.robot)
    shapes = layout.effect.shapes(experiment.setup([]))
    term = seecr.Term(layout, layout.start(shapes[len(shapes) // 2]))
    plain = experiment.predict([term.effect()])
    found = seecr.sensitivities(experiment, seecr.Terms([term]), plain)[..., 0]
    step = 1e-4 * layout.scale[0]
    vector = term.vector.copy()
    vector[0] = step
    ahead = experiment.predict([layout.build(vector)])
    assert np.all(ahead.solved)
    full = readings_difference(ahead.readings, plain.readings) / step
    largest = np.abs(full).max(axis=0)
    assert np.all(np.abs(full[:, :3]).max() * layout.scale[0] > 1e-6)
    for part in (slice(0, 3), slice(3, 6), slice(6, None)):
        assert found[:, part] == pytest.approx(full[:, part], abs=1e-2 * largest[part].max())


def test_at_a_bound_the_difference_stays_inside() -> None:
    experiment = experiment_of("demobot_cogiro")
    layout = seecr.layout_of(seecr.effect_named("pulley_radius"), experiment.robot)
    seen: list[float] = []

    class Watched(layout.effect):  # type: ignore[name-defined,misc]
        def edit_setup(self, setup: object) -> None:
            seen.append(self.radius)
            super().edit_setup(setup)

    term = seecr.Term(replace(layout, effect=Watched), layout.null)
    at = experiment.predict([term.effect()])
    found = seecr.sensitivities(experiment, seecr.Terms([term]), at)
    assert min(seen) >= 0.0 and max(seen) > 0.0
    assert np.abs(found).max() > 1e-2


def test_a_row_that_is_free_to_move_gives_finite_numbers() -> None:
    """Three cables through one line leave a swing: its direction is no one's to say."""
    robot = replace(robot_of("demobot_cogiro"), anchor_points=np.zeros((8, 3)))
    experiment = seecr.Experiment(robot, seecr.Commands(robot.reference_pose[None]))
    at = experiment.predict()
    assert at.singular.tolist() == [True] and not at.solved.any()
    layout = seecr.layout_of(seecr.effect_named("stiffness"), robot)
    found = seecr.sensitivities(experiment, seecr.Terms([seecr.Term(layout, layout.null)]), at)
    assert np.all(np.isfinite(found))
    assert np.abs(found[:, 3:6]).max() < 1e-6 and found[0, 2, 0] > 0  # stiffer: higher


def test_the_planes_of_hanging_cables_tilt_with_gravity() -> None:
    """No cable's own numbers change then, and still every cable pulls another way."""
    experiment = experiment_of("demobot_cogiro")
    rng = np.random.default_rng(3)
    names = ("gravity_tilt", "cable_weight")
    terms = seecr.Terms(random_term(rng, experiment, name) for name in names)
    at = experiment.predict(terms.effects)
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


def test_a_platform_that_stands_still_turns_no_cable_round() -> None:
    """Where nothing moves a cable is stiff either way, by different amounts."""
    robot = robot_of("demobot_cogiro")
    poses = random_poses(np.random.default_rng(3), robot, 3)[[0, 1, 1, 1, 2]]
    experiment = seecr.Experiment(robot, seecr.Commands(poses, run=np.zeros(5, dtype=np.int64)))
    rng = np.random.default_rng(2)
    names = ("hysteresis", "exit_friction", "pulley_radius", "centre_of_mass", "drum_gain")
    terms = seecr.Terms(random_term(rng, experiment, name) for name in names)
    at = experiment.predict(terms.effects)
    assert np.abs(at.pose[1] - at.pose[3]).max() < 1e-12
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


def test_friction_that_is_not_there_yet_has_its_cable_behind_the_exit_point() -> None:
    """Beside another effect with history, whose way was walked without that cable."""
    experiment = experiment_of("demobot_parallel", seed=3)
    layout = seecr.layout_of(seecr.effect_named("exit_friction"), experiment.robot)
    term = seecr.Term(layout, layout.start(layout.effect.shapes(experiment.setup([]))[-1]))
    creep = random_term(np.random.default_rng(1), experiment, "creep")
    terms = seecr.Terms([creep, term])
    at = experiment.predict([creep.effect()])
    column = terms.part("exit_friction").start
    found = seecr.sensitivities(experiment, terms, at, columns=[column], frozen=True)[..., 0]
    step = 1e-4 * layout.scale[0]
    vector = term.vector.copy()
    vector[0] = step
    both = [experiment.predict([creep.effect(), layout.build(v)]) for v in (vector, term.vector)]
    full = readings_difference(both[0].readings, both[1].readings) / step
    assert found[:, :3] == pytest.approx(full[:, :3], abs=1e-3 * np.abs(full[:, :3]).max())


def test_errors_of_lengths_reach_beyond_what_hysteresis_holds() -> None:
    """Stuck, a row seemed to feel half of its lengths' noise, which fits took hysteresis for."""
    robot = robot_of("free")
    poses = random_poses(np.random.default_rng(4), robot, 6)
    experiment = seecr.Experiment(robot, seecr.Commands(poses))
    third = 0.3 * float(seecr.layout_of(seecr.effect_named("hysteresis"), robot).scale[0])
    term = seecr.Term.of(robot, "hysteresis", amplitude_N=third, stretch_m=1e-9)
    plain, stuck = experiment.predict(), experiment.predict([term.effect()])
    assert stuck.has_history
    free, noisy = read_by_length(plain), read_by_length(stuck)
    near = np.linalg.norm(noisy - free, axis=(1, 2)) / np.linalg.norm(free, axis=(1, 2))
    assert np.max(near) < 1e-2


def test_errors_of_lengths_reach_beyond_what_friction_holds() -> None:
    """A cable that sticks where it turned back a hundredth of a millimetre is none the stiffer."""
    robot = robot_of("free")
    poses = np.repeat(random_poses(np.random.default_rng(4), robot, 2), 2, axis=0)
    poses[1::2, 0] -= 1e-5 * robot.length
    term = seecr.Term.of(robot, "exit_friction", friction=0.03, length_m=0.25)
    at = seecr.Experiment(robot, seecr.Commands(poses)).predict([term.effect()])
    slips, sticks = read_by_length(at)[::2], read_by_length(at)[1::2]
    assert np.linalg.norm(sticks - slips) < 0.01 * np.linalg.norm(slips)
    assert np.linalg.norm(length_sensitivities(at)[1::2] - slips) > 0.05 * np.linalg.norm(slips)


# --- Sensitivities to where cables begin and end: by one evaluation of each, and by differences


ENDS = ("exit_point_error", "anchor_point_error")
LAWS = ("nonlinear_elasticity", "hysteresis", "creep", "exit_friction", "frame_compliance")
LIGHT, HEAVY = ("pulley_radius", *LAWS), ("cable_weight", *LAWS)


def predicted(kind: str, names: tuple[str, ...]) -> tuple[seecr.Prediction, seecr.Terms, Array]:
    """A prediction with such effects beside both ends, and its derivatives, history constant."""
    experiment, rng = experiment_of(kind, seed=5, reach=0.4), np.random.default_rng(5)
    terms = seecr.Terms(random_term(rng, experiment, name) for name in (*ENDS, *names))
    at = experiment.predict(terms.effects)
    assert at.solved.all()
    return at, terms, seecr.sensitivities(experiment, terms, at, frozen=True)


@pytest.mark.parametrize("names", [(), LIGHT, HEAVY])
@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "planar_vertical"])
def test_they_are_those_of_differences(
    kind: str, names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    at, terms, found = predicted(kind, names)
    assert are_by_point(at.tables)
    monkeypatch.setattr(sensitivity, "are_by_point", lambda _tables: False)
    _at, _terms, differences = predicted(kind, names)
    for name in ENDS:
        own = terms.part(name)
        largest = np.abs(differences[..., own]).max(axis=(0, 2))
        off = np.abs(found[..., own] - differences[..., own]).max(axis=(0, 2))
        assert np.all(off <= 1e-6 * largest + 1e-12), name


def test_the_stiffness_of_heavy_cables_over_pulleys_is_no_derivative() -> None:
    """It is the symmetric part of one: differences are taken."""
    at, _terms, _found = predicted("demobot_cogiro", ("cable_weight", "pulley_radius"))
    assert not are_by_point(at.tables)


def test_the_force_is_what_the_platform_is_held_with() -> None:
    at, _terms, _found = predicted("demobot_cogiro", LIGHT)
    rates = cable_rates(at)
    force, arm = rates[..., FORCE : FORCE + 3], rates[..., ARM : ARM + 3]
    assert np.linalg.norm(force, axis=2) == pytest.approx(at.tensions, rel=1e-9)
    weight, length = at.setup.mass * at.setup.gravity, at.setup.robot.length
    off = 1e-6 * float(np.linalg.norm(weight))
    assert force.sum(axis=1) == pytest.approx(np.tile(-weight, (6, 1)), abs=off)
    moment = np.cross(arm, force).sum(axis=1)
    assert np.abs(moment).max() < off * length
