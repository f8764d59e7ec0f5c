"""What is done again where the fit of all effects ended in a local minimum."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term

from crosscheck.calibration import compared as module
from crosscheck.calibration.compared import fit_and_compare
from crosscheck.calibration.joint_fit.all_effects import Calibration, fit_all_effects
from crosscheck.calibration.joint_fit.joint import scaled_derivatives
from crosscheck.calibration.joint_fit.leave_out import LeftOut, leave_out
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.unknown.beside import unknown_beside
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.given import considered
from seecr.effects import Terms

pytestmark = pytest.mark.slow

ROBOT = soft_cogiro()
FEW = ["pulley_radius", "gravity_tilt", "hysteresis"]


def stuck(whole: Calibration) -> Calibration:
    """As if the fit of all effects had never left the model as it stands."""
    joint, setting = whole.joint, whole.setting
    plain = joint.terms.with_vector(joint.terms.null)
    state = evaluate(setting.problem, plain, setting.factor)
    there = replace(joint, state=state, jacobian=scaled_derivatives(setting, state))
    far = replace(whole.held_out, surprise=np.array([9.0]))
    return replace(whole, joint=there, held_out=far)


def test_what_fewer_effects_explain_all_are_fitted_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four effects with history were unknown: the fit of all of them was ten times as far off."""
    starts: list[Terms | None] = []

    def fit_badly_at_first(*given: Any) -> Calibration:
        starts.append(given[3])
        whole = fit_all_effects(*given)
        return stuck(whole) if len(starts) == 1 else whole

    data = measured(ROBOT, [term(ROBOT, "pulley_radius", radius_m=0.006)])
    ready = prepare(ROBOT, data, Terms(), considered(FEW))
    monkeypatch.setattr(module, "fit_all_effects", fit_badly_at_first)
    found = fit_and_compare(ready.problem, SIGMA, Terms(), lambda _text, _part: None, ())
    first, second = starts
    assert first is None and second is not None and second.names == ("pulley_radius",)
    assert not found.is_unexplained and not found.is_a_local_minimum
    assert found.found.best.names == {"pulley_radius"}


def test_what_stays_unknown_is_compared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fit of all effects that is nearer than any of them is no local minimum."""
    count = 0

    def with_surprise(*given: Any) -> Calibration:
        nonlocal count
        count += 1
        whole = fit_all_effects(*given)
        return replace(whole, held_out=replace(whole.held_out, surprise=np.array([9.0])))

    ready = prepare(ROBOT, measured(ROBOT), Terms(), considered(FEW))
    monkeypatch.setattr(module, "fit_all_effects", with_surprise)
    found = fit_and_compare(ready.problem, SIGMA, Terms(), lambda _text, _part: None, ())
    assert count == 1 and found.is_unexplained and not found.is_a_local_minimum


@pytest.mark.parametrize("foretold", [True, False])
def test_runs_that_few_effects_foretell_are_no_surprise(
    monkeypatch: pytest.MonkeyPatch, foretold: bool
) -> None:
    """With 30 rows, friction beside drums and anchor points was unknown: all effects went far."""

    def with_surprise(*given: Any) -> Calibration:
        whole = fit_all_effects(*given)
        return replace(whole, held_out=replace(whole.held_out, surprise=np.array([2.1])))

    def surprised(*given: Any) -> LeftOut:
        return replace(leave_out(*given), surprise=np.array([2.05]))

    data = measured(ROBOT, [term(ROBOT, "pulley_radius", radius_m=0.006)])
    ready = prepare(ROBOT, data, Terms(), considered(FEW))
    monkeypatch.setattr(module, "fit_all_effects", with_surprise)
    if not foretold:
        monkeypatch.setattr(module, "leave_out", surprised)
    found = fit_and_compare(ready.problem, SIGMA, Terms(), lambda _text, _part: None, ())
    assert found.found.best.names == {"pulley_radius"}
    assert found.surprise == 2.05 if not foretold else found.surprise < 1.5


def test_what_many_effects_foretell_takes_no_surprise_away() -> None:
    """So many imitate what is unknown in the other runs as well."""
    best = SimpleNamespace(names=frozenset("abcdef"))
    whole: Any = SimpleNamespace(surprise=9.0)
    assert module._surprise(whole, cast(Any, SimpleNamespace(best=best, always=frozenset()))) == 9.0


@pytest.mark.parametrize("rho", [0.0, 0.4])
def test_beside_a_few_the_noise_is_their_own(rho: float) -> None:
    """With another fit's noise anything explained more: beside it alone noise was estimated."""
    ready = prepare(ROBOT, measured(ROBOT), Terms(), considered(FEW))
    whole = fit_all_effects(ready.problem, Terms())
    colour = Colour(1.3 * whole.colour.scale, np.full(3, rho))
    odds = unknown_beside(whole.setting, replace(whole.joint, colour=colour)).odds
    assert odds == pytest.approx(unknown_beside(whole.setting, whole.joint).odds, abs=1.0)
    assert odds < 0.0


class ComparedError(Exception):
    """Sets are compared: what comes after does not matter here."""


@pytest.mark.parametrize(("scale", "rho", "surprise", "grow"), [
    (1.0, 0.0, 9.0, False), (3.0, 0.0, 9.0, True), (1.0, 0.9, 9.0, True), (3.0, 0.0, 0.0, False),
])  # fmt: skip
def test_sets_grow_where_the_fit_of_all_leaves_more_than_noise(
    monkeypatch: pytest.MonkeyPatch, scale: float, rho: float, surprise: float, grow: bool
) -> None:
    asked: list[bool] = []

    def poorly(*given: Any) -> Calibration:
        whole = fit_all_effects(*given)
        noisy = replace(whole.joint, colour=Colour(np.full(3, scale), np.full(3, rho)))
        far = replace(whole.held_out, surprise=np.array([surprise]))
        return replace(whole, joint=noisy, held_out=far)

    def compare(*given: Any) -> None:
        asked.append(given[-1])
        raise ComparedError

    ready = prepare(ROBOT, measured(ROBOT), Terms(), considered(FEW))
    monkeypatch.setattr(module, "fit_all_effects", poorly)
    monkeypatch.setattr(module, "compare_sets", compare)
    with pytest.raises(ComparedError):
        fit_and_compare(ready.problem, SIGMA, Terms(), lambda _text, _part: None, ())
    assert asked == [grow]
