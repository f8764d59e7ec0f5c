"""What a diagnosis lists and what not: every effect that was tried has one place."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from made_diagnoses import pulleys, unknown

from crosscheck.calibration.sets.equals import SMALL
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis import unexplained as module
from crosscheck.diagnosis.importance import weighed
from crosscheck.diagnosis.listed import _with_equals, left_out, missing_of, not_listed
from crosscheck.diagnosis.result import Diagnosis, NotListed
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.unexplained import where_of
from crosscheck.fit.least_squares.problem import rms_by_kind
from crosscheck.fit.noise.tolerance import Tolerance
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from seecr.effects import catalogue

pytestmark = pytest.mark.slow


def searched(found: Diagnosis) -> Search:
    assert found.search is not None
    return found.search


def test_every_effect_is_listed_or_has_a_reason_the_best_first() -> None:
    found = pulleys()
    listed = [effect.effect for effect in found.missing]
    others = not_listed(searched(found), listed)
    names = [other.effect for other in others]
    assert sorted(names + listed) == sorted(catalogue())
    scores = [other.score for other in others]
    assert scores == sorted(scores, reverse=True)
    assert all(str(other.why_not) for other in others)


def test_a_reason_of_its_own_goes_before_any_other() -> None:
    search = searched(pulleys())
    said = Reason(Why.NOT_NEEDED)
    start = search.steps[0]
    own = {c.name: c.why_not for c in start.candidates if c.why_not is not None}
    rows = left_out(search, [], lambda candidate: said)
    assert {row.effect: row.why_not for row in rows if row.why_not is not said} == own


def test_where_structure_remains_only_small_effects_explain_a_part_of_it() -> None:
    search = searched(unknown())
    sizes = {c.name: len(c.layout) for c in search.steps[0].candidates if c.why_not is None}
    rows = {row.effect: row.why_not for row in not_listed(search, [])}
    assert {rows[name].why for name in sizes} == {Why.IMITATES, Why.EXPLAINS_PART}
    assert all((rows[name].why is Why.IMITATES) == (sizes[name] > SMALL) for name in sizes)


def test_a_step_tells_the_errors_with_its_effect() -> None:
    found, search = pulleys(), searched(pulleys())
    assert found.chances is not None
    effect = missing_of(search, "pulley_radius", found.chances, rivals=())
    before, after = search.steps[0], search.steps[1]
    assert effect.rms == rms_by_kind(search.problem, after.fit.state.raw)
    assert effect.probability == found.chances.of("pulley_radius")
    assert effect.share == pytest.approx(1.0, abs=0.01) and effect.rivals == ()
    assert before.fit.state.chi2 > 100.0 * after.fit.state.chi2
    wider = replace(after, whiteness=replace(after.whiteness, scale=3.0))
    other = replace(search, steps=(*search.steps[:1], wider))
    there = missing_of(other, "pulley_radius", found.chances, rivals=())
    ratio = wider.whiteness.inflation / after.whiteness.inflation
    assert there.stderr == pytest.approx(ratio * effect.stderr)


def test_structure_that_nothing_explains_is_said_with_what_it_goes_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search, chances, floor = searched(unknown()), unknown().chances, unknown().floor
    assert chances is not None
    monkeypatch.setattr(module, "chances_of", lambda _sought: chances)
    monkeypatch.setattr(module, "estimated_floor", lambda _sought: floor)
    sought: Any = SimpleNamespace(outdone=frozenset())
    found = module.unexplained(search, sought, ["a note"])
    assert found.floor == floor
    assert found.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and "a note" in found.notes
    assert all(len(effect.layout) <= SMALL for effect in found.missing)
    assert [row.p for row in where_of(search)] == sorted(row.p for row in where_of(search))


def test_structure_too_small_to_matter_is_no_unknown_effect() -> None:
    found = replace(unknown(), left=None)
    problem = searched(found).problem
    small = weighed(found, problem, Tolerance(position_m=1.0, orientation_rad=1.0, tension_N=1e3))
    assert small.verdict is not DiagnosisVerdict.UNKNOWN_EFFECT
    assert "is too small to matter: " in small.sentence and small.left is not None
    assert found.chances is not None
    seen = replace(found, chances=replace(found.chances, varies=(Varying.LAG,)))
    told = weighed(seen, problem, Tolerance(position_m=1.0, orientation_rad=1.0, tension_N=1e3))
    assert told.sentence == f"{small.sentence} It looks like {Varying.LAG}."
    large = weighed(found, problem, Tolerance(position_m=1e-6))
    assert large.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and large.sentence == found.sentence


def test_a_joint_fit_in_the_form_of_a_fit_keeps_its_errors_and_names_what_is_unseen() -> None:
    fit = searched(pulleys()).last.fit
    assert fit.terms.names == ("pulley_radius",) and fit.settled
    assert fit.covariance.shape == (1, 1) and fit.stderr[0] == pytest.approx(
        fit.covariance[0, 0] ** 0.5
    )
    assert searched(pulleys()).last.evidence.parameters == 1


def test_what_may_stand_for_a_listed_effect_has_that_reason_and_what_is_in_common_its_own() -> None:
    common: Any = SimpleNamespace(rivals=[SimpleNamespace(name="tracker_scale")])
    first: Any = SimpleNamespace(effect="drum_gain", indistinguishable=("creep",), common=common)
    other: Any = SimpleNamespace(
        effect="exit_point_error", indistinguishable=("anchor_point_error", "creep"), common=None
    )
    mine = Reason(Why.NOT_NEEDED)
    names = ("creep", "anchor_point_error", "tracker_scale", "stiffness")
    rows = [NotListed(name, name, 0.0, mine) for name in names]
    told = {row.effect: row.why_not for row in _with_equals(rows, [first, other])}
    assert told == {
        "creep": Reason(Why.ALIKE, by=("drum_gain",)),
        "anchor_point_error": Reason(Why.ALIKE, by=("exit_point_error",)),
        "tracker_scale": Reason(Why.IN_COMMON, by=("drum_gain",)),
        "stiffness": mine,
    }


def test_what_something_unknown_outdoes_is_not_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    steps: Any = SimpleNamespace(found=("backlash", "tilt"), steps=("none", "one", "two"))
    alone: Any = SimpleNamespace(found=("backlash",))
    monkeypatch.setattr(module, "_is_warranted", lambda _found, _name: True)
    monkeypatch.setattr(module, "replace", lambda _found, steps: SimpleNamespace(found=steps[1:]))
    monkeypatch.setattr(module, "missing_of", lambda _found, name, _chances: name)
    monkeypatch.setattr(module, "small_effects_alone", lambda *_: alone)
    chances: Any = None
    assert module._warranted(steps, chances, frozenset())[0] == ["one", "two"]
    assert module._warranted(steps, chances, frozenset({"tilt"}))[0] == ["one"]
    assert module._warranted(steps, chances, frozenset({"backlash"}))[0] == []
