"""From data to effects: nothing missing, two effects, and what a verdict rests on."""

from __future__ import annotations

import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration.judgement import judge
from crosscheck.calibration.search import Sought, seek
from crosscheck.fit.prepare import prepare
from crosscheck.fit.reasons import DiagnosisVerdict
from seecr.effects import Term, Terms
from seecr.mjcf import load_robot

pytestmark = pytest.mark.slow

ROBOT = load_robot(COGIRO)


def sought(terms: list[Term]) -> Sought:
    data = measured(ROBOT, terms, points=10)
    ready = prepare(ROBOT, data, Terms())
    assert ready.refusal is None
    return seek(ready.problem, SIGMA)


def test_where_nothing_is_missing_nothing_is_named() -> None:
    found = sought([])
    assert found.judgement.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    assert found.judgement.sure == ()
    assert found.found.best.names == frozenset()
    assert found.field_odds < 0.0


def test_two_effects_are_named_and_a_field_makes_the_verdict_unknown() -> None:
    hidden = [
        term(ROBOT, "pulley_radius", radius_m=0.006),
        term(ROBOT, "gravity_tilt", tilt_x_rad=0.03),
    ]
    found = sought(hidden)
    assert found.judgement.verdict is DiagnosisVerdict.EFFECTS_FOUND
    assert set(found.judgement.sure) == {"pulley_radius", "gravity_tilt"}
    assert min(found.classes.effect[t.name] for t in hidden) > 0.95
    values = found.found.best.joint.terms
    assert values["pulley_radius"].vector[0] == pytest.approx(0.006, rel=0.05)
    unknown = judge(found.found, found.classes, 20.0, 1.0)
    assert unknown.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert judge(found.found, found.classes, -5.0, 9.0).verdict is DiagnosisVerdict.UNKNOWN_EFFECT
