"""Where the platform was told to go, cable errors of a known shift, periods: by hand."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from made_data import measured, soft_cogiro
from scipy import signal

from crosscheck.comparison.quantities import (
    STILL,
    Abscissa,
    QuantityKind,
    cable_errors,
    in_time,
    independent_part,
    of_cables,
    of_rows,
    periodogram,
    regions_of,
    travel,
)
from crosscheck.fit.problem import Problem
from seecr.effects import Terms
from seecr.pose import pose_add
from seecr.prediction.experiment import Prediction


@pytest.fixture(scope="module")
def case() -> tuple[Problem, Prediction]:
    robot = soft_cogiro()
    data = measured(robot)
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    return problem, problem.experiment.predict(Terms().effects)


def test_a_run_that_starts_at_its_first_row_has_no_motion_to_it(
    case: tuple[Problem, Prediction],
) -> None:
    """It had one from the reference pose, where such a run never was."""
    problem, prediction = case
    data, m = problem.data, problem.robot.n_cables
    standing = replace(data, stands=data.run == data.runs[0])
    there = Problem(problem.robot, standing, problem.sigma, problem.use)
    way, before = travel(there, prediction), travel(problem, prediction)
    first, second, *_ = np.flatnonzero(there.experiment.commands.starts)
    assert way.direction[first] == STILL != before.direction[first] and not way.step[first].any()
    assert np.delete(way.step, first, axis=0) == pytest.approx(np.delete(before.step, first, 0))
    cables = {q.name: q for q in of_cables(there, prediction, way)}
    words = words_of(cables["whether the cable was paid out or reeled in"])
    moved = np.array(words).reshape(-1, m)
    assert set(moved[first]) == {STILL} and STILL not in moved[second]


@pytest.mark.parametrize("zero", [0.0, 1.7e9])
def test_speeds_that_differ_by_rounding_are_one(
    case: tuple[Problem, Prediction], zero: float
) -> None:
    """They were in several bins, each labelled 0.03704 m/s: times since 1970 are coarse."""
    problem, prediction = case
    way = travel(problem, prediction)
    size = np.linalg.norm(way.step * np.repeat([1.0, problem.robot.length], 3), axis=1)
    speeds = np.where(np.arange(len(size)) % 2, 0.03703703705, 0.05)
    known = np.isfinite(way.speed) & (size > 0.0)
    data = replace(problem.data, t_s=zero + np.cumsum(np.where(known, size / speeds, 1.0)))
    steady = Problem(problem.robot, data, problem.sigma, problem.use)
    found = travel(steady, prediction).speed
    there = known & np.isfinite(found)
    assert there.sum() > 10 and len(np.unique(found[there])) == 2
    assert found[there] == pytest.approx(speeds[there], rel=1e-5)


def test_regions_are_halves_of_what_was_used(case: tuple[Problem, Prediction]) -> None:
    problem, prediction = case
    pose = travel(problem, prediction).pose.copy()
    pose[:, :3] = [0.0, 0.0, 0.5]
    assert set(regions_of(problem, pose)) == {"everywhere"}
    pose[::2, 0] = 1.0
    names = regions_of(problem, pose)
    assert set(names[::2]) == {"x from 0.5 m"} and set(names[1::2]) == {"x below 0.5 m"}
    pose[[2, 3], 0] = 0.5, np.nextafter(0.5, 0.0)
    assert set(regions_of(problem, pose)[[2, 3]]) == {"x from 0.5 m"}, "on the plane"


def words_of(quantity: Abscissa) -> list[str]:
    return [quantity.groups[k] for k in quantity.values]


def test_quantities_are_of_rows_or_of_cables(case: tuple[Problem, Prediction]) -> None:
    problem, prediction = case
    way, n, m = travel(problem, prediction), problem.data.n_rows, problem.robot.n_cables
    rows = {q.name: q for q in of_rows(problem, prediction, way)}
    assert all(len(q.values) == n for q in rows.values())
    assert rows["commanded z"].values.tolist() == way.pose[:, 2].tolist()
    assert rows["the run"].kind is QuantityKind.RUN
    cables = {q.name: q for q in of_cables(problem, prediction, way)}
    assert all(len(q.values) == n * m for q in cables.values())
    assert words_of(cables["the cable"])[:m] == list(problem.robot.cable_names)
    assert cables["the cable's tension"].values[m] == prediction.tensions[1, 0]
    moved = words_of(cables["whether the cable was paid out or reeled in"])
    home = problem.robot.nominal_lengths(problem.robot.reference_pose[None])[0]
    first = problem.robot.nominal_lengths(way.pose[:1])[0] > home
    assert [word == "paid out" for word in moved[:m]] == first.tolist()


def test_errors_of_cables_are_what_the_way_would_be_longer(
    case: tuple[Problem, Prediction],
) -> None:
    problem, prediction = case
    random = np.random.default_rng(0)
    raw = np.zeros((problem.data.n_rows, 6 + problem.robot.n_cables))
    raw[:, :6] = 1e-7 * random.standard_normal((len(raw), 6))
    ways = [
        problem.robot.nominal_lengths(pose_add(prediction.pose, s * raw[:, :6])) for s in (1, -1)
    ]
    errors, _noise = cable_errors(problem, raw, prediction)
    assert errors == pytest.approx((ways[0] - ways[1]) / 2.0, abs=1e-12)
    skipped = Problem(problem.robot, problem.data, problem.sigma, np.arange(len(raw)) > 0)
    assert np.isnan(cable_errors(skipped, raw, prediction)[0]).any(axis=1).tolist() == [
        True, *[False] * (len(raw) - 1)
    ]  # fmt: skip


@pytest.mark.parametrize("kinds", [("position_m",), ("orientation_rad",), ()])
def test_noise_of_errors_of_cables_is_that_of_noise_of_the_pose(
    case: tuple[Problem, Prediction], kinds: tuple[str, ...]
) -> None:
    """Drawn eight hundred times, for rows of different noise; ``kinds`` are without any."""
    problem, prediction = case
    sigma = replace(problem.sigma, **dict.fromkeys(kinds))
    ratio = np.tile(np.linspace(0.5, 2.0, problem.data.n_rows)[:, None], (1, 4))
    data = replace(problem.data, sigma_ratio=ratio)
    noisy = Problem(problem.robot, data, sigma, problem.use)
    size = np.repeat([sigma.position_m or 0.0, sigma.orientation_rad or 0.0], 3)
    random, raw = np.random.default_rng(0), np.zeros((len(ratio), 6 + problem.robot.n_cables))
    draws = []
    for _ in range(800):
        raw[:, :6] = ratio[:, :1] * size * random.standard_normal((len(raw), 6))
        errors, noise = cable_errors(noisy, raw, prediction)
        draws.append(errors)
    assert np.std(draws, axis=0) / noise == pytest.approx(np.ones_like(noise), rel=0.12)
    # m errors count as m^2 / tr C^2, of which 1/800 for each pair is chance
    alike = [np.corrcoef(row.T) for row in np.swapaxes(draws, 0, 1)]
    m = problem.robot.n_cables
    parts = [m / ((one**2).sum() - (1.0 - one**2).sum() / 800) for one in alike]
    assert independent_part(noisy, prediction) == pytest.approx(np.mean(parts), rel=0.02)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_period_is_found_in_time(case: tuple[Problem, Prediction], unit: float) -> None:
    problem, _ = case
    assert problem.data.t_s is not None
    data = replace(problem.data, t_s=unit * problem.data.t_s)
    problem = Problem(problem.robot, data, problem.sigma, problem.use)
    span = float(np.ptp(problem.data.t_s))
    table = np.sin(2.0 * np.pi * problem.data.t_s / (span / 5.0))[:, None]
    found, tried = in_time(problem, table)
    assert found is not None and tried > 10
    period = float(found.name.split()[-2])
    assert period == pytest.approx(span / 5.0, rel=0.05)
    assert in_time(problem, np.full_like(table, np.nan)) == (None, 0)


SPAN = 100.0


def uneven(n: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    t = np.sort(random.uniform(0.0, SPAN, n)) + 7.0
    values = np.sin(2.0 * np.pi * 0.31 * t) + 0.3 * random.standard_normal(n)
    return t, values - values.mean()


def test_power_is_that_of_the_slow_sum() -> None:
    t, values = uneven(400)
    step, count = 0.25 / SPAN, 600
    fast = periodogram(t, values, step, count)
    slow = signal.lombscargle(t, values, 2.0 * np.pi * step * np.arange(1, count + 1))
    assert np.argmax(fast) == np.argmax(slow)
    # what spreading over two cells costs at the shortest period
    assert fast == pytest.approx(slow, rel=0.04, abs=1e-3 * slow.max())


def test_memory_grows_with_rows_and_frequencies_and_not_with_their_product() -> None:
    t, values = uneven(15_000)
    tracemalloc.start()
    periodogram(t, values, 0.25 / SPAN, 20_000)
    _now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6  # the product would be 2.4e9 bytes
