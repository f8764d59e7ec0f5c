"""Noise that nobody stated, and whether what is left is noise: chances are what the tests say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from box_of_poses import box_of_poses
from made_data import COGIRO, SIGMA, measured, term
from scipy import stats

import crosscheck
from crosscheck.fit.problem import Problem
from crosscheck.fit.residual_noise import STRUCTURED, agreement, best_of, overestimated, whiteness
from crosscheck.inference.noise import chain_of
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.preparation.prepare import prepare
from seecr.commands import Commands
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term, Terms
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.prediction.experiment import Experiment


def test_noise_that_nobody_stated_is_estimated_and_said(robot: Robot) -> None:
    data = measured(robot, points=24)
    ready = prepare(robot, replace(data, sigma=Sigma(orientation_rad=3.5e-4)), Terms())
    assert ready.problem.sigma.position_m == pytest.approx(3e-5, rel=0.2)
    assert ready.notes[0].startswith("position_m is not stated: estimated from differences")
    position = data.position.copy()
    position[::2] = np.nan  # read in every second row alone
    half = replace(data, position=position, sigma=Sigma(orientation_rad=3.5e-4))
    found = prepare(robot, half, Terms()).problem.sigma.position_m
    assert found == pytest.approx(3e-5, rel=0.35)


def test_an_estimate_that_is_larger_than_all_that_is_left_is_told(robot: Robot) -> None:
    """A large model error at poses in no order looks like noise, until an effect explains it."""
    problem = prepare(robot, replace(measured(robot), sigma=Sigma()), Terms()).problem
    noise = problem.sigma
    assert noise.position_m is not None and noise.orientation_rad is not None
    left = {"position_rms_m": 0.4 * noise.position_m, "tension_rms_N": None,
            "orientation_rms_rad": 0.9 * noise.orientation_rad}  # fmt: skip
    (said,) = overestimated(problem, left)
    assert said.startswith("position_m was estimated too large: the residuals are only ")
    assert "--sigma position=" in said and "mm rms; state the noise" in said
    stated = replace(problem, data=replace(problem.data, sigma=noise))
    assert overestimated(stated, left) == []


@pytest.mark.parametrize("rows", [1, 3])
def test_of_few_rows_no_noise_can_be_estimated_and_that_is_said(
    robot: Robot, data: Measurements, rows: int
) -> None:
    """Once it was said to come from differences between neighbours, of which there were none."""
    alone = replace(data.rows(np.arange(rows)), sigma=Sigma(orientation_rad=3.5e-4))
    (note,) = [n for n in prepare(robot, alone, Terms()).notes if "is not stated" in n]
    assert note.startswith("position_m is not stated: no run has the 4 rows that an estimate needs")
    assert note.endswith("mm, are taken as noise; state it with --sigma position=...")


def in_no_order(robot: Robot, terms: Sequence[Term], rows: int) -> Measurements:
    """Readings at places in no order, with no word of their noise."""
    rng = np.random.default_rng(0)
    pose = np.tile(robot.reference_pose, (rows, 1))
    pose[:, :3] += rng.uniform(-1.0, 1.0, (rows, 3)) * np.array([0.15, 0.1, 0.08])
    found = Experiment(robot, Commands(pose)).predict(Terms(terms).effects).readings
    turn = quat_from_rotvec(SIGMA.orientation_rad * rng.standard_normal((rows, 3)))
    return Measurements(
        path=Path("measured.csv"),
        n_cables=robot.n_cables,
        run=np.full(rows, "a"),
        command_pose=pose,
        position=found.position + SIGMA.position_m * rng.standard_normal((rows, 3)),
        quat_wxyz=quat_multiply(turn, found.quat_wxyz),
    )


@pytest.mark.parametrize(("rows", "most"), [(12, 8.0), (30, 3.0), (100, 2.0)])
def test_poses_in_no_order_are_no_noise(robot: Robot, rows: int, most: float) -> None:
    """Differences of neighbours that are far apart hold the whole error of the model."""
    data = in_no_order(robot, [term(robot, "pulley_radius", radius_m=0.006)], rows)
    ready = prepare(robot, data, Terms())
    assert all(
        "from the part that no smooth function of the pose explains" in n for n in ready.notes[:2]
    )
    assert ready.problem.sigma.position_m < most * SIGMA.position_m
    assert ready.problem.sigma.orientation_rad < most * SIGMA.orientation_rad


def test_where_the_model_is_right_their_differences_are(robot: Robot) -> None:
    data = in_no_order(robot, [], 60)
    ready = prepare(robot, data, Terms())
    assert "estimated from differences" in ready.notes[0]
    assert ready.problem.sigma.position_m == pytest.approx(SIGMA.position_m, rel=0.3)
    found = crosscheck.compare(robot, data)
    assert found.is_noise and found.sentence.endswith("times the estimated noise).")


@pytest.mark.slow
def test_a_diagnosis_estimates_noise_beside_everything_together() -> None:
    """Steps take what a second effect does for the noise that was estimated."""
    stiff = load_robot(COGIRO)
    hidden = [
        term(stiff, "pulley_radius", radius_m=0.006),
        term(stiff, "gravity_tilt", tilt_x_rad=0.03),
    ]
    angles = replace(in_no_order(stiff, hidden, 60), position=np.full((60, 3), np.nan))
    found = crosscheck.diagnose(stiff, angles, only=[t.name for t in hidden])
    assert {one.effect for one in found.missing} == {t.name for t in hidden}
    assert found.floor["orientation_rms_rad"] == pytest.approx(SIGMA.orientation_rad, rel=0.2)


def test_rows_that_do_not_follow_in_time_are_no_further_alike(robot: Robot) -> None:
    data = in_no_order(robot, [], 12)
    clock = np.random.default_rng(1).permutation(12).astype(float)
    chain = chain_of(prepare(robot, replace(data, t_s=clock), Terms()).problem)
    assert np.all(chain.gap > 0.0)


def test_rows_of_one_moment_follow_as_any_others_do(robot: Robot) -> None:
    """Two rows at one time have noise of their own: it was taken for one reading, and no number."""
    data = in_no_order(robot, [], 12)
    for clock in (np.sort(np.append(np.arange(11.0), 4.0)), np.zeros(12)):
        chain = chain_of(prepare(robot, replace(data, t_s=clock), Terms()).problem)
        assert set(chain.gap[chain.before >= 0]) == {1.0}


@pytest.mark.parametrize(("stated", "odd"), [(3e-5, False), (2.4e-4, False), (0.03, True)])
def test_stated_noise_far_above_the_scatter_is_told(robot: Robot, stated: float, odd: bool) -> None:
    """Millimetres that were stated as metres hide every effect, and nothing else shows it."""
    sigma = replace(SIGMA, position_m=stated)
    ready = prepare(robot, replace(measured(robot, points=12), sigma=sigma), Terms())
    said = [note for note in ready.notes if "is it in another unit?" in note]
    assert len(said) == odd
    if odd:
        assert said[0].startswith(
            "position_m is stated as 30.0 mm, but neighbouring rows differ as "
        )


SEEDS = 600


@pytest.fixture(scope="module")
def problem() -> Problem:
    return box_of_poses()


def noise(problem: Problem, seed: int) -> Array:
    return np.random.default_rng(seed).standard_normal(problem.n_readings)


@pytest.mark.slow
def test_the_chance_of_its_size_is_uniform_under_noise(problem: Problem) -> None:
    found = [whiteness(problem, noise(problem, k), 0) for k in range(SEEDS)]
    assert stats.kstest([w.p for w in found], "uniform").pvalue > 0.01
    assert np.mean([w.scale for w in found]) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_fitted_directions_are_taken_off(problem: Problem) -> None:
    rng = np.random.default_rng(0)
    span = np.linalg.qr(rng.standard_normal((problem.n_readings, 40)))[0]
    chances = []
    for k in range(SEEDS):
        white = noise(problem, k)
        chances.append(whiteness(problem, white - span @ (span.T @ white), 40).p)
    assert stats.kstest(chances, "uniform").pvalue > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("pairs", ["next", "far"])
def test_agreement_of_one_channel_is_that_of_noise(pairs: str) -> None:
    """Standard errors whose chances are uniform, where rows do not know each other."""
    rng = np.random.default_rng(2)
    index = np.arange(399)
    chosen = np.stack([index, index + 1 if pairs == "next" else 399 - index], axis=1)
    chosen = chosen[chosen[:, 0] < chosen[:, 1]]
    chances = []
    for _ in range(SEEDS):
        errors = agreement(rng.standard_normal((400, 1)), chosen)[1]
        chances.append(float(stats.norm.sf(errors)))
    # where rows agree less than by chance it says none: half of all
    low = np.array([p for p in chances if p < 0.5])
    assert len(low) / SEEDS == pytest.approx(0.5, abs=0.07)
    assert stats.kstest(2.0 * low, "uniform").pvalue > 0.01


@pytest.mark.slow
def test_the_best_of_many_is_as_likely_as_one_of_its_errors() -> None:
    assert best_of(3.0, 1) == pytest.approx(3.0)
    rng = np.random.default_rng(4)
    best = rng.standard_normal((4000, 7)).max(axis=1)
    single = [stats.norm.sf(best_of(float(errors), 7)) for errors in best]
    assert stats.kstest(single, "uniform").pvalue > 0.01
    for errors, tests in ((4.0, 15), (6.0, 7), (60.0, 9)):
        chance = stats.norm.logsf(best_of(errors, tests))
        assert chance == pytest.approx(stats.norm.logsf(errors) + np.log(tests), rel=1e-4)
    assert best_of(5.0 - 1e-12, 9) == pytest.approx(best_of(5.0, 9), abs=1e-6)


@pytest.mark.slow
def test_structure_in_one_channel_does_not_drown_in_the_others(problem: Problem) -> None:
    table = noise(problem, 1).reshape(problem.data.n_rows, 6)
    wave = np.sin(np.arange(len(table)) / 4.0)
    table[:, 2] += 2.0 * wave
    found = whiteness(problem, table.ravel(), 0)
    assert found.structured and found.lag_errors > STRUCTURED
    table[:, 2] = noise(problem, 2)[: len(table)]
    assert not whiteness(problem, table.ravel(), 0).structured


@pytest.mark.slow
def test_too_few_pairs_say_nothing() -> None:
    table = np.ones((6, 2))
    assert agreement(table, np.zeros((0, 2), dtype=int)) == (0.0, 0.0)
    assert agreement(table[:, :1], np.array([[0, 1], [2, 3]])) == (0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("channels", [1, 6, 14])
def test_many_channels_give_no_more_false_alarms_than_one(channels: int) -> None:
    """The best of many is large by chance: that is taken off."""
    rng = np.random.default_rng(3)
    pairs = np.stack([np.arange(199), np.arange(1, 200)], axis=1)
    errors = [agreement(rng.standard_normal((200, channels)), pairs)[1] for _ in range(2000)]
    limit = float(stats.norm.isf(0.02))
    assert np.mean(np.array(errors) > limit) < 0.03
