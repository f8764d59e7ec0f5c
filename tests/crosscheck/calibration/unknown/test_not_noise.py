"""What may be taken for noise and what may not."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, measured

from crosscheck.calibration.joint_fit.joint import Setting, settle
from crosscheck.calibration.noise.colour import WHITE, Colour, chain_of
from crosscheck.calibration.unknown.not_noise import (
    is_correlated,
    most_together,
    outliers_cluster,
    too_loud,
    too_many,
)
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from seecr import pose as seecr_pose
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

POSITION = np.array([432, 0, 0])


def noise(scale: float, rho: float) -> Colour:
    return Colour(np.array([scale, 1.0, 1.0]), np.array([rho, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("scale", "rho", "is_noise"),
    [
        (1.0, 0.0, True),
        (1.0, 0.8, True),  # of the stated size: a tracker is smooth in time
        (2.0, 0.0, True),  # white, and stated too small
        (2.0, 0.8, True),  # coloured, and stated half as large as it is
        (2.4, 0.8, True),  # the same: how large it is, 432 readings tell to 7 %
        (2.4, 0.4, False),
        (2.6, 0.8, False),
        (4.0, 0.0, False),
        (1.9, 0.97, True),
        (2.1, 0.97, False),  # a drift, whose size a few runs hardly tell
        (2.1, 0.92, True),  # which 0.88 may look like
    ],
)
def test_stated_noise_may_be_coloured_and_wrong_by_two_but_no_more(
    scale: float, rho: float, is_noise: bool
) -> None:
    assert too_loud(noise(scale, rho), POSITION, ["position"]) is not is_noise


def test_the_size_of_what_goes_together_is_known_as_well_as_its_errors_say() -> None:
    # 400 runs of AR(1) noise, each of 144 rows of three readings
    random, rho, rows = np.random.default_rng(5), 0.8, 144
    noise = random.standard_normal((400, rows, 3))
    for k in range(1, rows):
        noise[:, k] = rho * noise[:, k - 1] + np.sqrt(1.0 - rho**2) * noise[:, k]
    now, before = noise[:, 1:], noise[:, :-1]
    phi = (now * before).sum(axis=(1, 2)) / (before**2).sum(axis=(1, 2))
    left = now - phi[:, None, None] * before
    size = 2.0 * np.sqrt((left**2).mean(axis=(1, 2)) / (1.0 - phi**2))
    assert 0.01 < np.mean(size > 2.3) < 0.06
    most = [most_together(float(one), 3 * rows) for one in phi]
    assert np.mean(size > most) < 0.01


def test_few_readings_may_be_three_times_as_noisy_but_no_more() -> None:
    few = np.array([60, 0, 0])
    assert not too_loud(noise(2.9, 0.9), few, ["position"])
    assert too_loud(noise(3.1, 0.9), few, ["position"])


@pytest.mark.parametrize(
    ("scale", "rho", "is_noise"), [(2.7, 0.8, True), (2.7, 0.95, False), (6.0, 0.5, False)]
)
def test_estimated_noise_may_be_larger_where_it_goes_together(
    scale: float, rho: float, is_noise: bool
) -> None:
    # differences of neighbours show 0.36 of AR(1) noise that goes together by 0.8
    assert too_loud(noise(scale, rho), POSITION, []) is not is_noise


def test_kinds_that_were_not_read_do_not_count() -> None:
    colour = Colour(np.array([1.0, 9.0, 1.0]), np.zeros(3))
    assert not too_loud(colour, POSITION, ["position", "orientation"])


@pytest.mark.parametrize("pulled", [False, True])
def test_residuals_that_agree_with_those_nearby_are_no_noise(pulled: bool) -> None:
    robot = load_robot(COGIRO)
    data = measured(robot, points=10)
    if pulled:  # by a tenth of a millimetre, more and more to one side
        assert data.command_pose is not None
        data.position[:, 2] += 1e-3 * data.command_pose[:, 0] ** 2
    problem = prepare(robot, data, Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    joint = settle(setting, evaluate(problem, Terms(), factor), np.zeros(0), WHITE)
    assert is_correlated(setting, joint) is pulled


@pytest.mark.parametrize("where", ["apart", "together", "in turn"])
def test_outliers_of_two_sensors_are_structure_only_if_they_lie_side_by_side(where: str) -> None:
    # each sensor fails in one row of eight: with an outlier of some sensor are 23 % of the rows
    robot = load_robot(COGIRO)
    data = measured(robot, points=10)
    assert data.position is not None and data.quat_wxyz is not None
    n = data.n_rows
    rows = {
        "apart": np.arange(0, n, 8),
        "together": np.arange(n // 8),
        "in turn": np.arange(0, n // 4, 2),  # neither sensor fails in two rows after another
    }[where]
    other = rows + 1 if where == "in turn" else (rows + 4) % n
    data.position[rows] += 5e-3
    data.quat_wxyz[other] = seecr_pose.quat_multiply(
        seecr_pose.quat_from_rotvec(np.array([0.05, 0.0, 0.0])), data.quat_wxyz[other]
    )
    problem = prepare(robot, data, Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem))
    joint = settle(setting, evaluate(problem, Terms(), factor), np.zeros(0), WHITE)
    assert outliers_cluster(setting, joint) is (where != "apart")


@pytest.mark.parametrize(
    ("outliers", "rows", "many"),
    [
        (0, 0, False),
        (19, 126, False),  # 15.1 %: one row in ten gives as many in one case of twenty
        (24, 126, False),
        (26, 126, True),
        (40, 144, True),
        (299, 2000, False),
        (301, 2000, True),  # of many rows, chance leaves little room
        (10, 40, False),
        (13, 40, True),
    ],
)
def test_few_rows_may_have_more_outliers_by_chance(outliers: int, rows: int, many: bool) -> None:
    assert too_many(outliers, rows) is many
