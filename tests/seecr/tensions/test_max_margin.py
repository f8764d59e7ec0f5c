"""What holds a platform on heavy cables: against catenaries, and against itself."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize

from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Term
from seecr.equilibrium.solving import solve
from seecr.inverse.correction import correct
from seecr.prediction.experiment import Experiment, effects_of
from seecr.prediction.model import load_model
from seecr.statics.tables import Tables, assemble
from seecr.tensions.balance import least_of_heavy
from seecr.tensions.max_margin import max_margin_tensions
from seecr.tensions.rest_lengths import hold
from seecr.workspace.maps import workspace_map
from seecr.workspace.zones import margins_with, tension_margin

LARGE = load_robot(model_path("cogiro_large"))
SAG = load_model(model_path("cogiro_large").parent / "sag.toml", LARGE)
WEIGHT = 0.62784
X, Y, Z = np.linspace(-7, 7, 5), np.linspace(-5, 5, 4), np.linspace(0.3, 4.8, 3)


def level(places: list[tuple[float, float, float]]) -> np.ndarray:
    poses = np.zeros((len(places), 7))
    poses[:, :3], poses[:, 3] = places, 1.0
    return poses


def tables_at(poses: np.ndarray) -> Tables:
    told = Commands(poses, lengths=LARGE.commanded_lengths(poses), told=True)
    return assemble(Experiment(LARGE, told).setup(effects_of(SAG, LARGE)))


def held_at(poses: np.ndarray, low: float, high: float) -> np.ndarray:
    found = hold(tables_at(poses), np.zeros((len(poses), 8)), np.full(8, low), np.full(8, high))
    return found.fine


GRID = level(list(itertools.product(X, Y, Z)))


@pytest.mark.parametrize("lowest", [0.0, 15.0])
def test_heavy_cables_hold_what_they_can(lowest: float) -> None:
    """Refused once: tensions above fifteen newtons hold the first two, and limits are wider."""
    poses = level([(-7, -5, 2.55), (-7, -1.6667, 2.55)])
    found = correct(LARGE, poses, effects=SAG, lowest=lowest)
    assert found.reached.all()
    assert np.abs(found.left[:, :3]).max() < 1e-9
    assert found.solution.tensions.min() >= max(lowest, 8.0) - 1e-8


def test_cables_that_hang_loosely_hold_too() -> None:
    """At the first, two cables pull the less the longer they are, down to less than they weigh."""
    poses = level([(-7, -5, 0.3), (-7, -1.667, 0.3)])
    found = correct(LARGE, poses, effects=SAG)
    assert found.reached.all()
    rests = solve(LARGE, poses, rest_lengths=found.solution.rest_lengths, effects=SAG)
    assert rests.converged.all()
    assert np.abs(rests.pose[:, :3] - poses[:, :3]).max() < 1e-9
    ways = LARGE.nominal_lengths(poses)
    assert found.solution.tensions[0].min() < WEIGHT * ways[0].max()
    # they hang longer than their way, none by half
    longest = (found.solution.rest_lengths / ways).max(axis=1)
    assert 1.1 < longest[0] < 1.5 and longest[1] < 1.1


@pytest.mark.parametrize(("low", "high"), [(0.0, np.inf), (0.0, 600.0), (20.0, 2000.0)])
def test_maps_and_corrections_agree(low: float, high: float) -> None:
    found = workspace_map(LARGE, X, Y, Z, effects=SAG, lowest=low, highest=high, elastic=False)
    np.testing.assert_array_equal(found.feasible.ravel(), held_at(GRID, low, high))
    assert 0 < found.feasible.sum() < 60


@pytest.mark.slow
def test_wider_limits_hold_what_narrower_do() -> None:
    limits = [
        (30, 520),
        (20, 550),
        (10, 600),
        (9, 650),
        (8, 700),
        (5, 1000),
        (2, 1800),
        (0, np.inf),
    ]
    # the last two were held with nine newtons at least and not with eight
    poses = np.concatenate([GRID, level([(-7, 5, 0.3), (-6.3, 5, 0.8625)])])
    held = np.array([held_at(poses, low, high) for low, high in limits])
    assert np.all(held[1:] >= held[:-1]) and np.all(np.diff(held.sum(axis=1)) >= 0)
    assert held[0].any() and held[-1].sum() > held[0].sum()


def catenaries(pose: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wrench (6,) of inextensible catenaries by their horizontal pulls (m,), tensions on top."""
    arms = LARGE.anchor_points  # of a level platform
    way = LARGE.exit_points - pose[:3] - arms
    span, rise = np.linalg.norm(way[:, :2], axis=1), way[:, 2]
    half = WEIGHT * span / (2.0 * pull)
    length = np.hypot(rise, span * np.sinh(half) / half)
    low = 0.5 * WEIGHT * (rise / np.tanh(half) - length)
    force = np.column_stack([way[:, :2] / span[:, None] * pull[:, None], low])
    wrench = np.r_[force.sum(axis=0), np.cross(arms, force).sum(axis=0)]
    weight = LARGE.mass * LARGE.gravity
    wrench += np.r_[weight, np.cross(LARGE.centre_of_mass, weight)]
    return wrench, np.hypot(pull, low + WEIGHT * length)


@pytest.mark.parametrize("place", [(0, 0, 1.5), (3, -2, 2.0), (-6, -4, 2.5), (5.5, 3, 0.8)])
def test_margins_are_those_of_catenaries(place: tuple[float, float, float]) -> None:
    """An optimisation of its own, with cables that do not stretch: by 5e-4 they do."""
    (pose,) = level([place])
    tables = tables_at(pose[None])
    low = np.maximum(5.0, least_of_heavy(tables)[0])
    ours = max_margin_tensions(tables, np.full(8, 5.0), np.full(8, 800.0))

    def balance(v: np.ndarray) -> np.ndarray:
        return np.asarray(catenaries(pose, v[:8])[0]) / LARGE.weight

    def room(v: np.ndarray) -> np.ndarray:
        tension = catenaries(pose, v[:8])[1]
        return np.r_[tension - low - v[8], 800.0 - tension - v[8]] / LARGE.weight

    best = minimize(
        lambda v: -v[8] / LARGE.weight, np.r_[np.full(8, 150.0), 0.0], method="SLSQP",
        bounds=[(1.0, None)] * 8 + [(None, None)],
        constraints=[{"type": "eq", "fun": balance}, {"type": "ineq", "fun": room}],
        options={"maxiter": 500, "ftol": 1e-12},
    )  # fmt: skip
    assert best.success and np.abs(balance(best.x)).max() < 1e-8
    assert ours.margins[0] == pytest.approx(best.x[8], abs=0.1)


def test_a_set_of_wrenches_counts_with_its_least_margin() -> None:
    pushes = np.array([[50.0, 0, 0, 0, 0, 0], [0, 0, -80.0, 0, 10.0, 0]])
    both = margins_with(LARGE, GRID, SAG, 5.0, 900.0, pushes)
    pushed = [
        [*SAG.terms, Term.of(LARGE, "external_wrench", force_x_N=50.0)],
        [*SAG.terms, Term.of(LARGE, "external_wrench", force_z_N=-80.0, moment_y_Nm=10.0)],
    ]
    each = [margins_with(LARGE, GRID, effects, 5.0, 900.0) for effects in pushed]
    np.testing.assert_allclose(both, np.min(each, axis=0), rtol=1e-6, atol=1e-6)


SMALL = load_robot("demobot_cogiro")
HEAVY = [Term.of(SMALL, "cable_weight", weight_N_per_m=0.1 * SMALL.weight)]


@pytest.mark.parametrize("part", [0.3, 0.9])
def test_limits_that_close_in_take_as_much_from_the_margin(part: float) -> None:
    """It is counted from the limits asked for, not from what the cables weigh."""
    random = np.random.default_rng(3)
    poses = np.tile(SMALL.reference_pose, (8, 1))
    poses[:, :3] += random.uniform(-0.06, 0.06, (8, 3))
    high = 1.5 * SMALL.weight
    margin = tension_margin(SMALL, poses, highest=high, effects=HEAVY)
    assert np.sum(margin > 0.0) > 4
    for pose, own in zip(poses[margin > 0.0], margin[margin > 0.0], strict=True):
        less = part * own
        there = tension_margin(SMALL, pose, lowest=less, highest=high - less, effects=HEAVY)
        assert there[0] == pytest.approx(own - less, abs=1e-5 * SMALL.weight)
