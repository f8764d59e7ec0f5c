"""Two effects that explain together what one effect of several values explains."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_data import measured, term
from made_diagnoses import POINTS, SLOW, diagnose_with, pulleys, robot

from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.diagnosis.averaged import spread_by_others
from crosscheck.diagnosis.explained import _not_listed
from crosscheck.diagnosis.pairs import pairs_instead
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.effects.systematic import moves_by_effect
from crosscheck.fit.reasons import DiagnosisVerdict, Why
from crosscheck.measurements.data import Sigma
from crosscheck.planning.deciding import _least_signal, telling_models_apart
from crosscheck.planning.extensions import extensions
from crosscheck.planning.planned import Planned, Reads
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

SIGMA, WHOLE = Sigma(position_m=1e-4), Sigma(position_m=1e-4, orientation_rad=3.5e-4)
SOME = ("external_wrench", "stiffness", "platform_mass", "gravity_tilt", "drum_gain")


@cache
def soft_and_tilted() -> Diagnosis:
    """Softer cables on a frame out of level, at a point: much like a force."""
    camera = load_robot("camera")
    hidden = [
        term(camera, "stiffness", factor=0.8),
        term(camera, "gravity_tilt", tilt_x_rad=0.03, tilt_y_rad=0.01),
    ]
    data = measured(camera, hidden, points=4, sigma=replace(SIGMA, orientation_rad=1e-4))
    return diagnose_with(camera, replace(data, quat_wxyz=None, sigma=SIGMA), exclude=SLOW)


def test_what_two_effects_do_is_not_called_a_hose_for_sure() -> None:
    """It was, at > 99 %: a quarter of the weight as a force, and nothing said of the two."""
    found = soft_and_tilted()
    assert found.verdict is DiagnosisVerdict.MANY_EFFECTS and not found.missing
    assert "it is external_wrench, or gravity_tilt + " in found.sentence
    assert "gravity_tilt + stiffness" in found.sentence


def test_what_one_of_the_sets_has_is_open_and_not_too_little() -> None:
    """A force at 40 %, of which the sentence said that it may be it, "explains too little"."""
    found = soft_and_tilted()
    assert found.search is not None and found.chances is not None
    chances = replace(found.chances, effect=dict.fromkeys(found.chances.effect, 0.4))
    many = Judgement(DiagnosisVerdict.MANY_EFFECTS, (), 0.0)
    rows = _not_listed(found.search, chances, many, frozenset({"external_wrench"}))
    why = {row.effect: row.why_not.why for row in rows}
    assert why["external_wrench"] is Why.OPEN and why["drum_gain"] is Why.IMPROBABLE


def test_a_payload_that_tells_them_apart_is_proposed_first() -> None:
    first, *_others = soft_and_tilted().measure_next
    assert first.startswith(
        "to find out which effects are missing: repeat the poses with a known extra "
    )
    assert "(payload_kg) (signal that separates them: " in first


def test_gains_of_drums_are_no_two_other_effects() -> None:
    gains = term(robot(), "drum_gain", gain_1=0.004, gain_2=-0.003, gain_3=0.002, gain_4=0.003)
    data = measured(robot(), [gains], points=POINTS, sigma=WHOLE)
    found = diagnose_with(robot(), data, only=SOME)
    assert [one.effect for one in found.missing] == ["drum_gain"]
    assert found.search is not None and pairs_instead(found.search) == []


def test_what_has_one_value_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two effects have two values or more."""
    monkeypatch.setattr("crosscheck.diagnosis.pairs._others", lambda *_some: pytest.fail())
    search = pulleys().search
    assert search is not None and pairs_instead(search) == []


def test_nothing_tells_a_model_from_itself() -> None:
    search = pulleys().search
    assert search is not None
    plan = Planned(search.problem, search.last.fit, search.factor, Reads.of(search.problem.data))
    fitted, options = search.last.fit.terms, list(extensions(plan))
    other = Terms([term(robot(), "stiffness", factor=0.5)])
    assert telling_models_apart(plan, options, [fitted, fitted]) == []
    # nor is anything worth proposing that tells all but two of several apart
    assert _least_signal(plan, [fitted, other]) > 1e3
    assert _least_signal(plan, [fitted, other, fitted]) == 0.0


@pytest.mark.parametrize(("p", "matters"), [(0.3, True), (0.04, False)])
def test_an_effect_that_may_be_there_widens_what_it_would_move(p: float, matters: bool) -> None:
    """A cable's length was 14 standard errors off beside a mass that was there at 29 %."""
    found = pulleys()
    assert found.search is not None and found.chances is not None
    problem, fit = found.search.problem, found.search.last.fit
    chances = replace(found.chances, classes=((("pulley_radius",), 1.0), (("stiffness",), p)))
    ((_fall, move),) = moves_by_effect(problem, fit, ["stiffness"]).values()
    assert np.abs(move[0]) > 0.1 * fit.stderr[0]
    wider = np.sqrt(p) * np.abs(move) if matters else np.zeros(1)
    assert spread_by_others(problem, fit, chances) == pytest.approx(wider)
