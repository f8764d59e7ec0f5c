"""Cables that hang: lengths for tensions, and the least that they are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import lengthened

import seecr
from seecr import Commands, Effect, Experiment, Robot, load_robot
from seecr.compiled.columns import EA, FRICTION, HYSTERESIS, LIFT, REST, STUCK, TENSION, WINCH_SIDE
from seecr.effects.cable import CableWeight
from seecr.effects.geometry import FrameCompliance, PulleyRadius
from seecr.prediction.experiment import effects_of
from seecr.statics import batch
from seecr.statics.tables import Tables, assemble
from seecr.tensions.balance import (
    balance_of,
    bridged_lengths,
    here,
    least_of_heavy,
    linearised_at,
    rest_after,
    rest_for,
    with_rest,
)
from seecr.tensions.rest_lengths import Held, hold, hold_again

WEIGHT = 0.62784


def tables_at(robot: Robot, poses: np.ndarray, weight: float = WEIGHT) -> Tables:
    commands = Commands(poses, lengths=robot.commanded_lengths(poses), told=True)
    return assemble(Experiment(robot, commands).setup([CableWeight(weight)] if weight else []))


def all_over(robot: Robot) -> np.ndarray:
    """Poses (3, 7): at home, aside and high, right below some exit points."""
    poses = np.tile(robot.reference_pose, (3, 1))
    poses[1, :3] += [4.0, 3.0, 2.0]
    poses[2, :3] = robot.exit_points[0] - robot.anchor_points[0] - [0.0, 0.0, 3.0]
    return poses


def tensions_of(tables: Tables, rest: np.ndarray) -> np.ndarray:
    n, m = rest.shape
    at = batch.evaluate(with_rest(tables, rest), batch.Evaluation.empty(n, m, tables.n_dof))
    return np.asarray(at.states[..., TENSION])


@pytest.mark.parametrize("times", [1.0, 1.5, 4.0, 50.0])
def test_a_cable_has_the_tension_its_length_is_for(times: float) -> None:
    robot = load_robot("cogiro_large")
    tables = tables_at(robot, all_over(robot))
    wanted = times * least_of_heavy(tables)
    # what is left: the stretch of a cable is not the mean of its ends
    assert tensions_of(tables, rest_for(tables, wanted)) == pytest.approx(wanted, rel=3e-3)


def test_cables_without_weight_are_as_long_as_their_stretch_says() -> None:
    robot = load_robot("cogiro_large")
    tables, pulls = tables_at(robot, all_over(robot), 0.0), np.full((3, 8), 300.0)
    assert not least_of_heavy(tables).any()
    np.testing.assert_array_equal(
        rest_for(tables, pulls), bridged_lengths(tables) / (1.0 + pulls / robot.ea)
    )


def test_balance_about_tensions_is_exact_there() -> None:
    """A pose that tensions at their limits hold, far from where cables just pull, is held."""
    robot = load_robot("cogiro_large")
    tables, low, high = tables_at(robot, all_over(robot)[:2]), np.zeros(8), np.full(8, 5000.0)
    first = hold(tables, np.zeros((2, 8)), low, high)
    assert first.fine.all()
    matrix, load = balance_of(tables, low, first.tensions)
    left = np.einsum("ndm,nm->nd", matrix, first.tensions) - load
    assert np.abs(left).max() < 1e-8 * robot.weight
    least = first.tensions.min(axis=0)
    most = first.tensions.max(axis=0) * (1.0 + 1e-9)
    again = hold(tables, np.zeros((2, 8)), least, most)
    assert again.fine.all()


@pytest.mark.parametrize(
    "effects",
    [
        [CableWeight(WEIGHT), PulleyRadius(0.2)],
        [FrameCompliance(2e-5, 1e-5)],
        [FrameCompliance(1e-6, 3e-5), PulleyRadius(0.2)],
    ],
)
def test_balance_is_linearised_at_the_tensions_it_is_asked_for(effects: list[Effect]) -> None:
    """Their lengths were approximate: what is left of the balance then is no error of the pose."""
    robot = load_robot("cogiro_large")
    poses = all_over(robot)
    commands = Commands(poses, lengths=robot.commanded_lengths(poses), told=True)
    tables = assemble(Experiment(robot, commands).setup(effects))
    wanted = 2.0 * np.maximum(least_of_heavy(tables), 0.1 * robot.weight)
    at, rates = linearised_at(tables, wanted)
    assert np.abs(at.states[..., TENSION] - wanted).max() < 1e-8 * robot.weight
    left = np.einsum("ndm,nm->nd", rates.by_tension, wanted) - rates.load(at)
    np.testing.assert_allclose(left, at.gradient, atol=1e-7 * robot.weight)


def test_cables_that_pull_nothing_are_longer_than_their_span() -> None:
    """A slack cable that is just as long would pull as soon as the platform moves a little."""
    robot = load_robot("demobot_parallel")
    apart = np.random.default_rng(0).random((40, 3)) - 0.5
    poses = np.tile(robot.reference_pose, (40, 1))
    poses[:, :3] += np.ptp(robot.exit_points, axis=0) * [0.6, 0.6, 0.18] * apart
    tables, m = tables_at(robot, poses, 0.0), robot.n_cables
    low, high = np.zeros(m), np.full(m, np.inf)
    held = hold(tables, np.zeros((len(tables), m)), low, high)
    again = hold_again(tables, held, np.zeros((len(tables), m)), low, high)
    spans = bridged_lengths(tables)
    for one in (held, again):
        slack = (one.tensions < 1e-9) & one.fine[:, None]
        assert slack.sum() >= 5
        assert np.all(one.rest[slack] > 1.001 * spans[slack])
        pulls = ~slack & one.fine[:, None]
        assert np.all(one.rest[pulls] < spans[pulls])


def test_lengths_that_are_lost_are_sought_from_the_start() -> None:
    """Where lengths held before do not lead to any, as if nothing had been held before."""
    robot = load_robot("cogiro_large")
    tables, m = tables_at(robot, all_over(robot)), robot.n_cables
    low, high, aim = np.full(m, 50.0), np.full(m, np.inf), np.full((len(tables), m), 50.0)
    held = hold(tables, aim, low, high)
    assert held.fine.any()
    astray = Held(10.0 * held.rest, held.tensions, held.fine)
    again = hold_again(tables, astray, aim, low, high)
    assert again.fine.tolist() == held.fine.tolist()
    assert again.rest[held.fine] == pytest.approx(held.rest[held.fine], rel=1e-6)


# --- How cables change with their rest lengths: against finite differences, and the law inverted


LAWS = ("nonlinear_elasticity", "hysteresis", "creep", "exit_friction", "frame_compliance")
ALL = ("pulley_radius", "cable_weight", *LAWS)


def predicted(kind: str, names: tuple[str, ...]) -> seecr.Prediction:
    """A short way with effects of expected sizes, each row with its history."""
    robot = seecr.load_robot(kind)
    poses = np.tile(robot.reference_pose, (5, 1))
    poses[:, 0] += np.linspace(0.0, 0.05 * robot.length, 5)
    terms = []
    for name in names:
        layout = seecr.layout_of(seecr.catalogue()[name], robot)
        size = np.where(layout.shape, layout.null, layout.null + 0.7 * layout.scale)
        terms.append(seecr.Term(layout, np.clip(size, layout.lower, layout.upper)))
    commands = seecr.Commands(poses, time=5.0 * np.arange(5))
    return seecr.Experiment(robot, commands).predict(effects_of(terms, robot))


@pytest.mark.parametrize("lifted", [False, True])
@pytest.mark.parametrize("names", [(), LAWS, ("cable_weight",), ALL])
@pytest.mark.parametrize("kind", ["demobot_cogiro", "planar_vertical"])
def test_derivatives_by_length_are_those_of_differences(
    kind: str, names: tuple[str, ...], lifted: bool
) -> None:
    found = predicted(kind, names)
    assert found.solved.all()
    tables, step = found.tables, 1e-6 * found.setup.robot.length
    if lifted:
        tables.cables[..., LIFT] = 2e-5
    at = batch.evaluate(tables, found.found)
    there, pull, tension = batch.pull_and_change(tables, at)
    assert there.gradient == pytest.approx(at.gradient, abs=1e-11 * tables.scale.max())
    assert there.states[..., TENSION] == pytest.approx(at.states[..., TENSION], rel=1e-11)
    sides = lengthened(tables, step), lengthened(tables, -step)
    force, own = batch.change_by_cable(*sides, at)
    assert np.all(tension < 0.0)
    assert tension == pytest.approx(own / (2.0 * step), rel=1e-5)
    assert pull == pytest.approx(force / (2.0 * step), abs=1e-6 * np.abs(pull).max())


def test_a_slack_cable_does_not_change() -> None:
    found = predicted("demobot_cogiro", ())
    longer = with_rest(found.tables, rest_for(found.tables, np.full((5, 8), 0.7)))
    longer.cables[:, 3] = lengthened(found.tables, 0.1).cables[:, 3]
    _at, pull, tension = batch.pull_and_change(longer, here(longer))
    assert np.all(tension[:, 3] == 0.0) and np.all(pull[:, :, 3] == 0.0)
    assert np.all(np.delete(tension, 3, axis=1) < 0.0)


@pytest.mark.parametrize("pulls", [1e-3, 0.7, 20.0])
def test_lengths_have_their_tensions_whatever_the_law_and_its_history(pulls: float) -> None:
    tables = predicted("demobot_cogiro", ("pulley_radius", *LAWS)).tables
    wanted = pulls * np.linspace(0.5, 1.5, 40).reshape(5, 8)
    now = with_rest(tables, rest_for(tables, wanted))
    assert batch.evaluate(now, here(now)).states[..., TENSION] == pytest.approx(wanted, abs=1e-11)


@pytest.mark.parametrize(("pulls", "sticks"), [(0.8, False), (1.0 + 1e-7, True), (1.3, False)])
@pytest.mark.parametrize("names", [("exit_friction",), ("pulley_radius", *LAWS)])
def test_what_is_paid_out_changes_the_tension_behind_a_cable_that_sticks(
    names: tuple[str, ...], pulls: float, sticks: bool
) -> None:
    """With that tension held, lengths for 2,000 poses did not converge in forty rounds."""
    tables = predicted("demobot_cogiro", names).tables
    tables = with_rest(tables, rest_for(tables, np.full((5, 8), 0.7)))
    for _ in range(30):  # until all stick, with the tension that they have then
        there = batch.evaluate(tables, here(tables)).states[..., TENSION]
        tables.cables[..., STUCK] = there
    wanted = pulls * there
    rest = rest_after(tables, rest_for(tables, wanted), wanted)
    now = with_rest(tables, rest)
    paid = rest - tables.cables[..., REST]
    now.cables[..., STUCK] -= paid * tables.cables[..., EA] / tables.cables[..., WINCH_SIDE]
    assert batch.evaluate(now, here(now)).states[..., TENSION] == pytest.approx(wanted, rel=1e-9)
    grip = np.exp(now.cables[..., FRICTION])
    stuck = (now.cables[..., STUCK] > wanted / grip) & (now.cables[..., STUCK] < wanted * grip)
    assert stuck.all() if sticks else not stuck.any()


def test_lengths_are_exact_where_a_cable_with_hysteresis_sticks() -> None:
    """Each round changed the hysteresis nearly as much as it had been changed."""
    tables = predicted("demobot_cogiro", ("exit_friction", "hysteresis")).tables
    tables.cables[..., HYSTERESIS] *= 1000.0
    tables = with_rest(tables, rest_for(tables, np.full((5, 8), 0.7)))
    tables.cables[..., STUCK] = 0.7
    there = batch.evaluate(tables, here(tables)).states[..., TENSION]
    wanted = there * (1.0 + 1e-5 * np.random.default_rng(0).normal(size=there.shape))
    now = with_rest(tables, rest_after(tables, rest_for(tables, wanted), wanted))
    paid = now.cables[..., REST] - tables.cables[..., REST]
    now.cables[..., STUCK] -= paid * tables.cables[..., EA] / tables.cables[..., WINCH_SIDE]
    assert batch.evaluate(now, here(now)).states[..., TENSION] == pytest.approx(wanted, rel=1e-9)
