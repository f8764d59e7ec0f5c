"""What may be there in place of a listed effect reaches the diagnosis, by steps or by sets."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import made_diagnoses
import pytest

from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.unknown.imitated import NOT_ASKED, Imitated
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis.chances import Chances, chances_of
from crosscheck.diagnosis.explained import _or_in_its_place, _sentence
from crosscheck.diagnosis.listed import diagnosis_of
from crosscheck.diagnosis.nearby import _with_equals
from crosscheck.fit.reasons import DiagnosisVerdict

DOUBT = Imitated(3.5, frozenset({"pulley_radius"}), (Varying.POSITION,))


def by_sets(in_place: Imitated) -> Chances:
    classes = SimpleNamespace(members=(), probability=(), effect={}, further={})
    sought: Any = SimpleNamespace(
        classes=classes, in_place=in_place, field_odds=None, shown=None, varies=(),
        calibration=SimpleNamespace(together=None), judgement=SimpleNamespace(imitated=None),
    )  # fmt: skip
    return chances_of(sought)


def by_steps(in_place: Imitated) -> Chances:
    scores = {frozenset[str](): 0.0, frozenset({"pulley_radius"}): 50.0}
    return _with_equals(scores, ["pulley_radius"], {"pulley_radius": []}, [], None, in_place)


@pytest.mark.parametrize("way", [by_sets, by_steps])
def test_a_doubt_is_kept_and_nothing_else_is(way: Any) -> None:
    assert way(DOUBT).doubt is DOUBT
    assert way(NOT_ASKED).doubt is None and way(replace(DOUBT, odds=1.0)).doubt is None


@pytest.mark.slow
def test_a_diagnosis_notes_it_unless_something_unknown_is_there_anyway() -> None:
    found = made_diagnoses.pulleys()
    assert found.chances is not None and found.search is not None
    for verdict, told in (
        (DiagnosisVerdict.EFFECTS_FOUND, True),
        (DiagnosisVerdict.UNKNOWN_EFFECT, False),
    ):
        again = diagnosis_of(
            verdict, "", found.missing, found.search, before=found.before, floor=found.floor,
            candidates=(), notes=("first",), chances=replace(found.chances, doubt=DOUBT),
        )  # fmt: skip
        said = [note for note in again.notes if "something else in place of pulley_radius" in note]
        assert again.notes[0] == "first" and bool(said) is told


def test_what_does_the_same_in_another_set_is_told_beside_a_listed_effect() -> None:
    """A force where the other set has a centre of mass elsewhere beside a tilt."""
    rivals = [SimpleNamespace(name=name) for name in ("external_wrench", "initial_pose_error")]
    centre: Any = SimpleNamespace(effect="centre_of_mass", rivals=rivals)
    both = [{"cable_weight", "external_wrench"}, {"cable_weight", "centre_of_mass", "tilt"}]
    some = [frozenset(names) for names in both]
    assert _or_in_its_place(centre, some) == "centre_of_mass (or external_wrench)"
    assert _or_in_its_place(centre, some[1:]) == "centre_of_mass"
    weight: Any = SimpleNamespace(effect="cable_weight", rivals=rivals)
    assert _or_in_its_place(weight, some) == "cable_weight"


@pytest.mark.parametrize(
    "verdict", [DiagnosisVerdict.MANY_EFFECTS, DiagnosisVerdict.UNKNOWN_EFFECT]
)
def test_the_sentence_says_how_probable_something_unknown_is_unless_it_is_sure(
    verdict: DiagnosisVerdict,
) -> None:
    unknown = Imitated(6.0, frozenset({"length_scale"}), (Varying.POSITION,))
    said = Judgement(verdict, (), 0.0, imitated=unknown)
    nothing: Any = None
    sentence = _sentence(said, [], 25, nothing)
    assert sentence.startswith("An unknown effect is more probable than length_scale, which can")
    told = "imitate it (probability 73 %), but not certain: " in sentence
    assert told == (verdict is DiagnosisVerdict.MANY_EFFECTS)


def test_something_unknown_is_not_called_more_probable_where_it_is_less() -> None:
    unknown = Imitated(4.4, frozenset({"creep", "length_scale"}), (Varying.POSITION,))
    said = Judgement(DiagnosisVerdict.MANY_EFFECTS, (), 0.0, imitated=unknown)
    nothing: Any = None
    assert _sentence(said, [], 25, nothing).startswith(
        "An unknown effect may be there in place of creep + length_scale, which can imitate it "
        "(probability 35 %): something that varies smoothly"
    )
