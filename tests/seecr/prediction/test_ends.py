"""Sensitivities to where cables begin and end: by one evaluation of each, and by differences."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import experiment_of, random_term

from seecr.compiled.columns import ARM, FORCE
from seecr.effects import Terms
from seecr.pose import Array
from seecr.prediction import sensitivity
from seecr.prediction.experiment import Prediction
from seecr.prediction.parted import forget
from seecr.prediction.sensitivity import are_by_point, cable_rates, sensitivities
from seecr.statics import batch

ENDS = ("exit_point_error", "anchor_point_error")
LAWS = ("nonlinear_elasticity", "hysteresis", "creep", "exit_friction", "frame_compliance")
LIGHT, HEAVY = ("pulley_radius", *LAWS), ("cable_weight", *LAWS)


def predicted(kind: str, names: tuple[str, ...]) -> tuple[Prediction, Terms, Array]:
    """A prediction with such effects beside both ends, and its derivatives, history constant."""
    experiment, rng = experiment_of(kind, seed=5, reach=0.4), np.random.default_rng(5)
    terms = Terms(random_term(rng, experiment, name) for name in (*ENDS, *names))
    at = experiment.predict(terms.effects)
    assert at.solved.all()
    return at, terms, sensitivities(experiment, terms, at, frozen=True)


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


def test_they_are_computed_once_for_a_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    at, terms, _found = predicted("demobot_cogiro", LIGHT)
    monkeypatch.setattr(batch, "rates_of_cables", None)  # whoever asks once more is refused
    sensitivities(experiment_of("demobot_cogiro", seed=5, reach=0.4), terms, at, frozen=True)


@pytest.mark.parametrize("frozen", [True, False])
@pytest.mark.parametrize("names", [("pulley_radius",), LIGHT])
def test_what_a_prediction_forgot_is_computed_again(names: tuple[str, ...], frozen: bool) -> None:
    at, terms, _found = predicted("demobot_cogiro", names)
    experiment = experiment_of("demobot_cogiro", seed=5, reach=0.4)
    before, pose = sensitivities(experiment, terms, at, frozen=frozen), at.pose
    forget(at)
    assert at.walk is None and not at.kept
    assert np.array_equal(at.pose, pose)
    assert np.array_equal(sensitivities(experiment, terms, at, frozen=frozen), before)


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


def test_a_row_whose_cables_cannot_be_solved_changes_nothing() -> None:
    at, _terms, _found = predicted("demobot_cogiro", HEAVY)
    at.found.deviation[2] = np.nan
    rates = batch.rates_of_cables(at.tables, at.found)
    assert np.all(rates[2] == 0.0)
    force = rates[[0, 1, 3, 4, 5], :, FORCE : FORCE + 3]
    assert np.all(np.linalg.norm(force, axis=2) > 0.0)
