"""How cables change with their rest lengths: against finite differences, and the law inverted."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import lengthened

import seecr
from seecr.compiled.columns import EA, FRICTION, HYSTERESIS, LIFT, REST, STUCK, TENSION, WINCH_SIDE
from seecr.prediction.experiment import effects_of
from seecr.statics import batch
from seecr.tensions.balance import here, rest_after, rest_for, with_rest

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
