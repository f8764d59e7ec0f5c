"""The energy of cables that sag: what it is, and that equilibria are told apart by it."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from one_cable import cable, in_direction, pull

from seecr import Robot, Term, barriers, equilibria, load_robot, solve
from seecr.compiled.columns import EA, ENERGY, RADIUS, REST, WEIGHT
from seecr.equilibrium.following import evaluated, moved, step_between
from seecr.pose import Array, pose_add
from seecr.show.pose_words import elsewhere, other_lines
from seecr.statics.tables import Tables, take


def in_many_digits(row: np.ndarray, h: float, v: float, length: float) -> float:
    """H x + V z - int (T + T^2/(2 EA)) ds with nothing rearranged, in 120 digits."""
    with mpmath.workdps(120):
        h, v, length, w, ea = map(mpmath.mpf, (h, v, length, float(row[WEIGHT]), float(row[EA])))
        top = v + w * length
        low, high = mpmath.hypot(h, v), mpmath.hypot(h, top)
        turned = mpmath.asinh(top / h) - mpmath.asinh(v / h)
        squares = (top**3 - v**3) / (3 * w) + h**2 * length
        x = h * turned / w + h * length / ea
        z = (high - low) / w + (top**2 - v**2) / (2 * w * ea)
        tensions = (top * high - v * low + h**2 * turned) / (2 * w)
        return float(h * x + v * z - tensions - squares / (2 * ea))


@pytest.mark.parametrize("weight", [1e-9, 1e-4, 0.4, 30.0])
@pytest.mark.parametrize("ea", [1e3, 1e7])
def test_no_digits_are_lost(weight: float, ea: float) -> None:
    """Straight, slack, steep and hanging in a loop."""
    row = cable(WEIGHT=weight, EA=ea)
    for below in (-89.999, -40.0, 0.0, 60.0, 89.9, 89.999999):
        for chord in (2.02, 2.0 + 1e-6, 1.999, 1.0, 0.1):
            anchor = in_direction(below, chord)
            found = pull(row, anchor)
            truth = in_many_digits(row, *found.guess) - 0.5 * weight * row[REST] * anchor[2]
            # the shape that was found ends where it should but for rounding: its weight's height
            lost = 4e-15 * weight * row[REST] ** 2
            assert found.state[ENERGY] == pytest.approx(truth, rel=1e-12, abs=lost)


def around(row: np.ndarray, place: tuple[float, float]) -> tuple[float, float]:
    """Work [J] of a cable whose anchor point goes once round a circle, and what is said of it.

    That is w r int sin(psi) dS, S being the length [m], before it is stretched, that the stretch
    of the arc and of all else behind the span gives to the span.
    """
    turns = 2.0 * np.pi * np.arange(400) / 400
    work, heights, given = 0.0, [], []
    for c, s in zip(np.cos(turns), np.sin(turns), strict=True):
        found = pull(row, [place[0] + 0.1 * c, 0.0, place[1] + 0.1 * s])
        work += found.force @ [-s, 0.0, c] * 0.1 * 2.0 * np.pi / 400
        psi = np.arctan2(found.guess[0], found.guess[1] + row[WEIGHT] * found.guess[2])
        heights.append(row[RADIUS] * np.sin(psi))
        given.append(found.guess[2] - row[REST] + row[RADIUS] * (np.pi - psi))
    waves = 1j * np.fft.fftfreq(400, 1.0 / 400)
    slopes = np.fft.ifft(waves * np.fft.fft(given)).real
    return float(work), float(row[WEIGHT] * np.mean(heights * slopes) * 2.0 * np.pi)


SERIES = {"WINCH_SIDE": 1.5, "COMPLIANCE": 2e-4, "CREEP": 1e-3, "CREEP_RATE": 1e-6}


@pytest.mark.parametrize("place", [(1.9, -1.0), (1.74, -0.85), (1.4, -0.7)],
                         ids=["taut", "barely slack", "hanging"])  # fmt: skip
@pytest.mark.parametrize("more", [{}, SERIES], ids=["alone", "series"])
def test_over_a_pulley_a_closed_way_does_work(
    more: dict[str, float], place: tuple[float, float]
) -> None:
    """So that the pull is no gradient, of whatever energy."""
    row = cable(WEIGHT=30.0, RADIUS=0.1, **more)
    work, said = around(row, place)
    assert abs(work) > 1e-4 and work == pytest.approx(said, rel=1e-7)
    assert abs(around(cable(WEIGHT=30.0, **more), place)[0]) < 1e-11
    assert abs(around(cable(WEIGHT=30.0, RADIUS=0.1, EA=1e9), (1.4, -0.7))[0]) < 1e-9


def test_there_is_none_over_a_pulley_nor_with_friction() -> None:
    over = cable(WEIGHT=30.0, RADIUS=0.1)
    for row in (over, cable(WEIGHT=0.4, HYSTERESIS=0.1), cable(WEIGHT=0.4, FRICTION=0.1)):
        assert np.isnan(pull(row, in_direction(20.0, 2.03)).state[ENERGY])


def work_of_arcs(robot: Robot, tables: Tables, poses: Array) -> float:
    """w r int sin(psi) dS [J] of all cables through poses near each other (trapezium rule)."""
    at = evaluated(robot, take(tables, np.zeros(len(poses), int)), poses)
    row, (h, v, length) = tables.cables[0], np.moveaxis(at.guess, -1, 0)
    psi = np.arctan2(h, v + row[:, WEIGHT] * length)
    given = length - row[:, REST] + row[:, RADIUS] * (np.pi - psi)
    heights = row[:, WEIGHT] * row[:, RADIUS] * np.sin(psi)
    return 0.5 * float(np.sum((heights[1:] + heights[:-1]) * np.diff(given, axis=0)))


@pytest.mark.parametrize(
    ("name", "weight", "radius", "apart"),
    [("demobot_cogiro", 0.02, 0.03, 5e-7), ("cogiro_large", 0.62784, 0.1, 1e-6)],
)
def test_by_how_much_ways_to_one_pose_differ(
    name: str, weight: float, radius: float, apart: float
) -> None:
    robot, random = load_robot(name), np.random.default_rng(0)
    sag = Term.of(robot, "cable_weight", weight_N_per_m=weight)
    pulleys = Term.of(robot, "pulley_radius", radius_m=radius)
    own = solve(robot, robot.reference_pose, effects=[sag, pulleys])
    spread = 0.1 * np.repeat([robot.length, 1.0], 3)
    by = [moved(robot, own.pose, (random.uniform(-1, 1, 6) * spread)[None]) for _ in range(5)]
    parts = np.linspace(0.0, 1.0, 2001)[:, None]

    def straight(one: Array, two: Array) -> float:
        way = parts * step_between(robot, two, one)
        poses = moved(robot, np.repeat(one, len(parts), axis=0), way)
        return work_of_arcs(robot, own.tables, poses)

    ways = [straight(own.pose, p) + straight(p, by[0]) for p in by[1:]]
    assert 0.3 * apart < np.ptp([straight(own.pose, by[0]), *ways]) < 3.0 * apart


@pytest.mark.parametrize(
    ("name", "weight"),
    [("demobot_parallel", 0.02), ("demobot_cogiro", 0.2), ("cogiro_large", 0.62784)],
)
def test_its_slope_is_the_wrench(name: str, weight: float) -> None:
    robot = load_robot(name)
    sag = [Term.of(robot, "cable_weight", weight_N_per_m=weight)]
    tables = solve(robot, robot.reference_pose, effects=sag).tables
    random = np.random.default_rng(5)
    poses = np.tile(robot.reference_pose, (20, 1))
    spread = 0.1 * np.repeat([robot.length, 1.0], 3)
    poses = pose_add(poses, random.uniform(-1, 1, (20, 6)) * spread)
    many = take(tables, np.zeros(20, int))
    here, size = evaluated(robot, many, poses), 2e-6 * robot.length
    slopes = np.empty((20, 6))
    for k, way in enumerate(np.eye(6)):
        ends = [evaluated(robot, many, moved(robot, poses, s * size * way[None])).energy
                for s in (1, -1)]  # fmt: skip
        slopes[:, k] = (ends[0] - ends[1]) / (2 * size)
    lost = np.linalg.norm(slopes - here.gradient, axis=1)
    assert np.all(lost < 1e-6 * np.linalg.norm(here.gradient, axis=1))


@pytest.mark.slow
def test_equilibria_of_a_robot_that_sags_are_ranked_with_what_is_between_them() -> None:
    robot = load_robot("demobot_parallel")
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    pose = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    for weight, first, barrier in ((1e-6, -0.01533, 6.80e-5), (2e-3, -0.01544, 6.13e-5)):
        sag = [Term.of(robot, "cable_weight", weight_N_per_m=weight)]
        own, every = solve(robot, pose, effects=sag), equilibria(robot, pose, effects=sag)
        assert np.all(np.diff(every.energy) > 0)
        assert every.energy[0] == pytest.approx(first, abs=1e-5)
        other = every.rows(elsewhere(own, every))
        (way,) = barriers(own, other)
        assert way.exact and way.energy == pytest.approx(barrier, rel=2e-3)
        assert way.back - way.energy == pytest.approx(own.energy[0] - other.energy[0], rel=1e-9)
        (line,) = other_lines(own, every, [way])
        assert " -1.61" in line and "mJ to get there, 1.68 mJ back" in line
