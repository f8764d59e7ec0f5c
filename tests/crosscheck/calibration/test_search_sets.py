"""From data to effects: nothing missing, two effects, and what a verdict rests on."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration import compared, search
from crosscheck.calibration.joint_fit.beginning import Beginning
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.judgement.verdict import Judgement, SignsOfUnknown, judge
from crosscheck.calibration.search import SetSearch, nothing_by_themselves, search_sets
from crosscheck.calibration.sets import refits
from crosscheck.calibration.unknown.beside import UnknownOdds
from crosscheck.diagnosis.explained import MORE, explained
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.fit.reasons import DiagnosisVerdict, Why
from crosscheck.given import considered
from seecr import processes
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, layout_of
from seecr.effects.actuation import DrumGain
from seecr.effects.cable import Creep

pytestmark = pytest.mark.slow

ROBOT = load_robot(COGIRO)
# What is hidden, and what could be taken for it: the other effects cost most of the time.
FEW = (
    "pulley_radius", "gravity_tilt", "stiffness", "drum_gain", "tracker_frame", "length_scale",
    "cable_length_offset",
)  # fmt: skip


PULLEYS = term(ROBOT, "pulley_radius", radius_m=0.006)


def sought(terms: list[Term]) -> SetSearch:
    data = measured(ROBOT, terms, points=10)
    ready = prepare(ROBOT, data, Terms(), considered(FEW))
    assert ready.refusal is None
    return search_sets(ready.problem, SIGMA)


@cache
def with_pulleys() -> SetSearch:
    return sought([PULLEYS])


def test_where_nothing_is_missing_nothing_is_named() -> None:
    found = sought([])
    assert found.judgement.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
    assert found.judgement.sure == ()
    assert found.found.best.names == frozenset()
    assert found.field_odds < 0.0


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux")
def test_several_processes_find_the_same_with_what_all_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To the last bit, and each fit is one of the commands that were there, not of a copy."""
    alone = with_pulleys().found
    forked = list[int]()

    def counted(job: Callable[[], bytes]) -> tuple[int, int]:
        forked.append(1)
        return fork(job)

    fork = processes._forked
    monkeypatch.setattr(processes, "_forked", counted)
    monkeypatch.setenv(processes.MOST, "3")
    ready = prepare(ROBOT, measured(ROBOT, [PULLEYS], points=10), Terms(), considered(FEW))
    with Beginning(ready.problem, Terms()) as beginning:
        several = search_sets(ready.problem, SIGMA, beginning=beginning).found
    assert len(forked) >= 3
    assert {names: r.score for names, r in several.refits.items()} == {
        names: r.score for names, r in alone.refits.items()
    }
    assert list(several.refits) == list(alone.refits)
    for names, refit in several.refits.items():
        assert np.array_equal(refit.joint.z, alone.refits[names].joint.z)
        assert refit.joint.state.experiment is ready.problem.experiment


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
    assert_shown_as_many(found)
    assert_certain_in_each(found)
    assert_a_model_by_itself(found)
    assert_open_which(found)
    assert_not_beyond_doubt(found)
    unknown = judge(found.found, found.classes, SignsOfUnknown(20.0, 1.0))
    assert unknown.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    surprising = judge(found.found, found.classes, SignsOfUnknown(-5.0, 9.0))
    assert surprising.verdict is DiagnosisVerdict.UNKNOWN_EFFECT


def test_structure_beside_all_effects_is_nothing_unknown_if_few_effects_leave_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The fit of all effects may have ended in a local minimum that few effects do not have."""
    asked, refitted = list[int](), list[int]()

    def is_not_noise(_setting: Setting, joint: JointFit, _stated: object) -> bool:
        asked.append(len(joint.terms.names))
        return len(joint.terms.names) == len(FEW)

    def compare_sets(*args: Any) -> refits.ComparedSets:
        refitted.append(args[5])
        return refits.compare_sets(*args)

    monkeypatch.setattr(compared, "is_not_noise", is_not_noise)
    monkeypatch.setattr(compared, "compare_sets", compare_sets)
    found = sought([term(ROBOT, "pulley_radius", radius_m=0.006)])
    assert asked == [len(FEW), 1, 1]
    assert refitted == [4, 20]  # sets refitted: few at first, as if something unknown were there
    assert found.judgement.verdict is DiagnosisVerdict.EFFECTS_FOUND
    assert found.judgement.sure == ("pulley_radius",)


def test_a_member_that_moves_nothing_is_known_and_not_listed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tilt = "gravity_tilt"
    monkeypatch.setattr(refits, "_is_idle", lambda _exact, _scores, _best, name: name == tilt)
    found = sought([
        term(ROBOT, "pulley_radius", radius_m=0.006), term(ROBOT, tilt, tilt_x_rad=0.03),
    ])  # fmt: skip
    assert found.found.best.names >= {"pulley_radius", tilt} and found.found.idle == {tilt}
    assert found.judgement.sure == ("pulley_radius",)


def test_what_a_set_leaves_is_asked_of_a_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the best set by itself, and the answer is told."""
    asked: list[JointFit] = []

    def odds(_setting: Setting, joint: JointFit, stated: bool) -> UnknownOdds:
        asked.append(joint)
        return UnknownOdds(8.0)

    monkeypatch.setattr(search, "unknown_beside", odds)
    found = sought([term(ROBOT, "pulley_radius", radius_m=0.006)])
    assert [joint.terms.names for joint in asked] == [found.found.best.joint.terms.names]
    assert found.judgement.verdict is DiagnosisVerdict.MANY_EFFECTS and found.judgement.more
    assert found.judgement.sure == ("pulley_radius",)
    assert MORE in explained(found, []).notes
    none = replace(found.judgement, sure=())
    assert "most probably" not in explained(replace(found, judgement=none), []).sentence
    few = replace(none, more=False)
    assert "most probably it is pulley" in explained(replace(found, judgement=few), []).sentence


def test_what_is_within_its_error_of_nothing_is_not_sure() -> None:
    """However probable that something of its class is missing; and the others stay."""
    found = with_pulleys()
    setting = found.calibration.setting
    both = Judgement(DiagnosisVerdict.EFFECTS_FOUND, ("stiffness", "pulley_radius"), 0.0)
    assert nothing_by_themselves(setting, found.found, both) == {"stiffness"}
    one = both.without(frozenset({"stiffness"}))
    assert one.sure == ("pulley_radius",) and one.verdict is DiagnosisVerdict.EFFECTS_FOUND
    assert nothing_by_themselves(setting, found.found, one) == frozenset()
    assert one.without(frozenset()) is one
    # nothing that is sure is no finding
    none = one.without(frozenset({"pulley_radius"}))
    assert none.sure == () and none.verdict is DiagnosisVerdict.MANY_EFFECTS
    assert nothing_by_themselves(setting, found.found, none) == frozenset()


def test_what_its_set_needs_stays_sure_however_near_nothing_it_seems(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Errors are those of a linear model, which may not hold there."""
    found = with_pulleys()
    both = Judgement(DiagnosisVerdict.EFFECTS_FOUND, ("stiffness", "pulley_radius"), 0.0)
    near = {"pulley_radius": 0.1, "stiffness": 0.2}
    monkeypatch.setattr(
        search, "_near_nothing", lambda _setting, _fit, some: {n: near[n] for n in some}
    )
    setting = found.calibration.setting
    assert nothing_by_themselves(setting, found.found, both) == {"stiffness"}


def assert_a_model_by_itself(found: SetSearch) -> None:
    """Of effects that are found alone the values are the best without those not listed."""
    one = Judgement(DiagnosisVerdict.EFFECTS_FOUND, ("gravity_tilt",), 0.0)
    (listed,) = explained(replace(found, judgement=one), []).missing
    assert listed.values == pytest.approx(value_of(found, {"gravity_tilt"}), rel=1e-3)
    # the pulleys, which are not listed, are taken in by the tilt
    both = value_of(found, {"gravity_tilt", "pulley_radius"})
    assert listed.values != pytest.approx(both, rel=0.2)


def assert_open_which(found: SetSearch) -> None:
    """As it is told where others explain as well, so that none is sure."""
    best = found.found.best
    pair = frozenset({"backlash", "drum_gain"})
    refits = {**found.found.refits, pair: replace(best, names=pair)}
    none = Judgement(DiagnosisVerdict.MANY_EFFECTS, (), 0.0)
    said = explained(replace(found, found=replace(found.found, refits=refits), judgement=none), [])
    assert "these data leave open whether it is " in said.sentence
    assert "gravity_tilt + pulley_radius" in said.sentence
    assert "backlash + drum_gain" in said.sentence
    assert any(line.endswith("(gravity_tilt)") for line in said.measure_next)


def assert_certain_in_each(found: SetSearch) -> None:
    """As it is told where sets that explain as well have one effect in common."""
    best = found.found.best
    pair = frozenset({"gravity_tilt", "drum_gain"})
    one = Judgement(DiagnosisVerdict.MANY_EFFECTS, ("gravity_tilt",), 0.0)

    def told(names: frozenset[str]) -> Diagnosis:
        refits = {**found.found.refits, names: replace(best, names=names)}
        sets = replace(found.found, refits=refits)
        return explained(replace(found, found=sets, judgement=one), [])

    said = told(pair)
    assert ", or drum_gain + gravity_tilt. Certain in each of them: gravity_tilt. On" in (
        said.sentence
    )
    (pulley,) = (row for row in said.candidates if row.effect == "pulley_radius")
    assert pulley.why_not.why is Why.NOT_SURE
    assert any(line.endswith("(pulley_radius)") for line in said.measure_next)
    # not what only one of them has
    assert told(frozenset({"backlash", "drum_gain"})).sentence.endswith(
        "Certain among them: gravity_tilt."
    )


def assert_not_beyond_doubt(found: SetSearch) -> None:
    """As it is told where nothing else explains as well, and yet none is sure."""
    none = Judgement(DiagnosisVerdict.MANY_EFFECTS, (), 0.0)
    said = explained(replace(found, judgement=none), [])
    start = "No few effects explain the error with certainty; most probably it is "
    assert said.sentence.startswith(start) and not said.missing
    assert "gravity_tilt (" in said.sentence and "pulley_radius (" in said.sentence
    for name in ("gravity_tilt", "pulley_radius"):
        assert any(line.endswith(f"({name})") for line in said.measure_next)


def value_of(found: SetSearch, names: set[str]) -> list[float]:
    """The tilt in a model of some effects."""
    refit = found.found.refit(frozenset(names))
    assert refit is not None
    return list(refit.joint.terms["gravity_tilt"].vector)


def assert_shown_as_many(found: SetSearch) -> None:
    """As it is told where only one of the two effects carries enough to be sure of."""
    many = Judgement(DiagnosisVerdict.MANY_EFFECTS, ("gravity_tilt",), 0.0)
    said = explained(replace(found, judgement=many), [])
    assert said.sentence.startswith("No few effects explain the error, but 7 effects together do: ")
    assert said.sentence.endswith("Certain among them: gravity_tilt.")
    (listed,) = said.missing
    # beside all that are probable
    both = value_of(found, {"gravity_tilt", "pulley_radius"})
    assert listed.values == pytest.approx(both, rel=1e-3)
    (pulley,) = (one for one in said.candidates if one.effect == "pulley_radius")
    assert pulley.why_not.why is Why.DOES_LITTLE
    assert "does little beside the others that are probable" in pulley.why_not.words
    assert pulley.why_not.p > 0.95
    other = replace(many, replaceable=frozenset({"pulley_radius"}))
    rows = explained(replace(found, judgement=other), []).candidates
    (pulley,) = (one for one in rows if one.effect == "pulley_radius")
    assert pulley.why_not.why is Why.REPLACEABLE
    assert "others together explain as much without it" in pulley.why_not.words
    assert any("crosscheck calibrate" in text for text in said.measure_next)


@pytest.mark.parametrize(
    ("amplitude", "without", "idle"),
    [(1e-3, -12.0, True), (1e-3, -13.0, False), (1e-3, None, False), (0.0, -13.0, True)],
)
def test_a_member_is_idle_at_null_or_if_the_set_explains_as_much_without_it(
    monkeypatch: pytest.MonkeyPatch, amplitude: float, without: float | None, idle: bool
) -> None:
    """What has a history may move nothing, and yet decide in which rest the platform is."""
    monkeypatch.setattr(refits, "does_nothing", lambda _setting, _best, name: name == "creep")
    creep, gain = (layout_of(effect, ROBOT) for effect in (Creep, DrumGain))
    moved = np.where(creep.shape, creep.null, creep.null + amplitude)
    terms = Terms([Term(creep, moved), Term(gain, gain.null + 1e-3)])
    best = SimpleNamespace(
        names=frozenset({"creep", "drum_gain"}), score=0.0, joint=SimpleNamespace(terms=terms)
    )

    def fit(_scores: object, names: frozenset[str]) -> object:
        assert names == {"drum_gain"}
        return None if without is None else SimpleNamespace(score=without)

    exact = SimpleNamespace(setting=None, fit=fit)
    assert refits._is_idle(exact, None, best, "creep") is idle  # type: ignore[arg-type]
    assert not refits._is_idle(exact, None, best, "drum_gain")  # type: ignore[arg-type]
