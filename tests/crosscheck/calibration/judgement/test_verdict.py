"""The verdict from sets, probabilities, a field's odds and runs left out; no data are needed."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.calibration import search
from crosscheck.calibration.judgement.alternatives import alternatives, shared
from crosscheck.calibration.judgement.probability import Classes, all_scores, probabilities
from crosscheck.calibration.judgement.verdict import Judgement, SignsOfUnknown, judge, too_large
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, gram_of
from crosscheck.calibration.search import with_equivalents
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.calibration.unknown.imitated import Imitated
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.fit.reasons import DiagnosisVerdict
from seecr.effects import Terms

NAMES = ("a", "b", "c", "d", "e", "f", "g")
NO_FIT: Any = None
LARGE = ColumnGroup(np.array([0, 2, 3, 4]), np.array([1.0]))

NO_SIGNS = SignsOfUnknown(-5.0, 1.0)


def found_of(scores: dict[str, float]) -> ComparedSets:
    """Sets refitted to these scores, written as their members' letters."""
    refits = {frozenset(k): Refit(frozenset(k), NO_FIT, {}, s) for k, s in scores.items()}
    best = max(refits.values(), key=lambda r: r.score)
    x = np.random.default_rng(0).normal(size=(20, len(NAMES)))
    groups = {n: ColumnGroup(np.array([k]), np.array([1.0])) for k, n in enumerate(NAMES)}
    return ComparedSets(
        refits, best, Scores(gram_of(x, 0.0 * x[:, 0], groups), len(NAMES)), refits.get
    )


def judged(scores: dict[str, float], odds: float = -5.0, surprise: float = 1.0) -> Judgement:
    found = found_of(scores)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    return judge(found, classes, SignsOfUnknown(odds, surprise))


def test_none_is_best() -> None:
    said = judged({"": 0.0, "a": -4.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.NO_EFFECT_MISSING, ())


def test_a_hint_of_an_effect_is_not_named() -> None:
    said = judged({"": -0.7, "a": 0.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.NO_EFFECT_MISSING, ())


def test_one_effect_beyond_doubt() -> None:
    said = judged({"": -900.0, "a": 0.0, "ab": -3.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))


def test_an_effect_that_may_be_noise_is_not_sure_but_nor_does_it_take_many() -> None:
    found = found_of({"": -900.0, "a": -6.0, "b": -800.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    sure = judge(found, classes, NO_SIGNS)
    assert (sure.verdict, sure.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a", "b"))
    said = judge(found, classes, NO_SIGNS, without={frozenset(): 0.5, frozenset("b"): 0.5})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))
    assert said.undecided == sure.undecided


def test_sure_effects_are_a_diagnosis_though_many_others_stay_open() -> None:
    some = [*"cdefg", *map("".join, combinations("cdefg", 2))]
    hints = {"ab" + x: -0.1 for x in some}
    said = judged({"": -900.0, "a": -300.0, "b": -500.0, "ab": 0.0, **hints})
    assert 1.0 < said.undecided < 2.0
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a", "b"))


def test_many_open_effects_beside_one_that_is_not_sure_are_no_diagnosis() -> None:
    some = [*"cdefg", *map("".join, combinations("cdefg", 2))]
    hints = {"ab" + x: -0.1 for x in some}
    said = judged({"": -900.0, "a": -0.01, "b": -500.0, "ab": 0.0, **hints})
    assert 1.0 < said.undecided < 2.0 and said.sure == ("a",)
    assert said.verdict is DiagnosisVerdict.MANY_EFFECTS


def test_equals_share_their_certainty() -> None:
    said = judged({"": -900.0, "a": 0.0, "b": -1.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))
    assert said.undecided < 0.5


def test_of_two_equals_both_are_sure_only_where_both_are_missing() -> None:
    """c could stand in for either, so that all three are of one class, which is sure."""
    exchanged = {"": -900.0, "ac": -1.0, "bc": -1.2}
    said = judged({**exchanged, "ab": 0.0, "a": -300.0, "b": -400.0, "c": -350.0})
    assert (said.verdict, set(said.sure)) == (DiagnosisVerdict.EFFECTS_FOUND, {"a", "b"})
    said = judged({**exchanged, "ab": 0.0, "a": -0.3, "b": -400.0, "c": -350.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))
    assert 0.2 < said.undecided < 0.8


def test_the_one_that_is_needed_is_listed_and_not_the_likelier_by_itself() -> None:
    """Of a's place b has a share; d beside it is worth nothing, but is in most sets."""
    scores = {"": -900.0, "ad": 0.0, "a": -0.4, "bd": -0.1, "b": -0.5, "d": -300.0, "cd": -1.0}
    said = judged({**scores, "ac": -1.1})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))


def test_what_is_listed_explains_about_as_much_as_the_best_set() -> None:
    """Two others might do instead of b, so that b is not sure; without it nothing is explained."""
    open_ = {"": -900.0, "ab": 0.0, "acd": -1.5, "b": -400.0}
    assert judged({**open_, "a": -100.0}).sure == ("a", "b")
    assert judged({**open_, "a": -3.0}).sure == ("a",)
    assert judged({**open_, "a": -100.0}).verdict is DiagnosisVerdict.EFFECTS_FOUND


def test_what_is_of_a_size_that_does_not_happen_is_not_sure() -> None:
    """A frame tilted by eleven degrees was listed: what it imitates is something else."""
    found = found_of({"": -900.0, "a": -300.0, "b": -500.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    said = judge(found, classes, NO_SIGNS)
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a", "b"))
    said = judge(found, classes, NO_SIGNS, implausible=frozenset("b"))
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ("a",))


@pytest.mark.parametrize("alone", [-3.2, -40.0])
def test_what_moves_nothing_beside_its_equal_is_not_listed(alone: float) -> None:
    """Two that act as one, and a wider prior together: one of them stays where it does nothing."""
    scores = {"": -900.0, "ab": 0.0, "a": alone, "b": alone - 0.2}
    found = found_of(scores)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    assert set(judge(found, classes, NO_SIGNS).sure) == {"a", "b"}
    said = judge(replace(found, idle=frozenset("b")), classes, NO_SIGNS)
    assert (said.verdict, said.sure) == (DiagnosisVerdict.EFFECTS_FOUND, ("a",))


def test_a_field_or_runs_left_out_make_it_unknown() -> None:
    scores = {"": -900.0, "a": 0.0}
    assert judged(scores, odds=6.0).verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert judged(scores, odds=6.0).sure == ()
    assert judged(scores, surprise=3.0).verdict is DiagnosisVerdict.UNKNOWN_EFFECT


@pytest.mark.parametrize("odds", [4.4, 5.5, 7.5, 8.5])
def test_something_unknown_in_place_of_members_must_be_sure(odds: float) -> None:
    """A robot all of whose tolerances were off was called unknown, with a probability of 0.89.

    Nor are effects found where one in three such fields is there: of a lens of 35 %, three known
    effects had been listed as sure.
    """
    found = found_of({"": -900.0, "a": -300.0, "b": -500.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    field = Imitated(odds, frozenset("b"), (Varying.POSITION,), {"a": 400.0})
    said = judge(found, classes, SignsOfUnknown(-5.0, 1.0, in_place=field))
    is_sure = field.probability > 0.95
    assert is_sure == (odds == 8.5) and said.sure == ("a",) and said.imitated is field
    unknown = said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert unknown == is_sure and (unknown or said.verdict is DiagnosisVerdict.MANY_EFFECTS)
    # a field beside the whole catalogue leaves no doubt
    said = judge(found, classes, SignsOfUnknown(6.0, 1.0, in_place=field))
    assert said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    # nor is one in the place of members that are likelier then what is unknown
    assert said.imitated is (field if field.is_likelier else None)


def test_a_field_beside_the_best_set_alone_makes_it_many() -> None:
    """The whole catalogue takes it in: that can be a calibration, few effects it is not."""
    found = found_of({"": -9000.0, "a": -30.0, "b": -8970.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    assert judge(found, classes, SignsOfUnknown(-5.0, 1.0, beside_best=4.0)).sure == ("a", "b")
    said = judge(found, classes, SignsOfUnknown(-5.0, 1.0, beside_best=6.0))
    # b, which is worth 30 of 9000, may stand for what a field is
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ("a",)) and said.more
    # nor is an effect of many parameters sure then, or one that carries a half
    grown = replace(found.scores.gram, groups={**found.scores.gram.groups, "a": LARGE})
    large = replace(found, scores=replace(found.scores, gram=grown))
    assert judge(large, classes, SignsOfUnknown(-5.0, 1.0, beside_best=6.0)).sure == ()
    halves = found_of({"": -9000.0, "a": -4400.0, "b": -4600.0, "ab": 0.0})
    assert judge(halves, classes, NO_SIGNS).sure == ("a", "b")
    assert judge(halves, classes, SignsOfUnknown(-5.0, 1.0, beside_best=6.0)).sure == ("a",)
    none = found_of({"": 0.0, "a": -4.0})
    classes = probabilities(all_scores(none), none.best.names, NAMES, fitted=none.refits)
    said = judge(none, classes, SignsOfUnknown(1.0, 1.0, beside_best=6.0))
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ())


def test_a_field_in_the_place_of_members_is_something_unknown() -> None:
    found = found_of({"": -9000.0, "a": -30.0, "b": -8970.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    here = Imitated(9.0, frozenset("b"), (), {"a": 800.0})

    def said(
        in_place: Imitated, of: ComparedSets = found, implausible: Names = frozenset()
    ) -> Judgement:
        return judge(of, classes, replace(NO_SIGNS, in_place=in_place), implausible)

    assert said(here).verdict is DiagnosisVerdict.UNKNOWN_EFFECT
    assert (said(here).sure, said(here).imitated) == (("a",), here)
    assert said(replace(here, odds=3.5)).sure == ("a", "b")
    # of several that stay none is, nor what is worth little, has many parameters or hardly happens
    assert said(replace(here, worth={"a": 800.0, "c": 80.0})).sure == ()
    assert said(replace(here, worth={"a": 20.0})).sure == ()
    grown = replace(found.scores.gram, groups={**found.scores.gram.groups, "a": LARGE})
    large = replace(found, scores=replace(found.scores, gram=grown))
    assert said(here, large).sure == ()
    assert said(here, implausible=frozenset("a")).sure == ()
    assert said(replace(here, worth={"a": 800.0, "c": 1.0})).sure == ("a",)
    # where runs left out are off, too, nothing is said of what imitates what unless one is sure
    far = judge(found, classes, SignsOfUnknown(-5.0, 9.0, in_place=here))
    assert (far.sure, far.imitated) == (("a",), here)
    far = judge(
        found, classes, SignsOfUnknown(-5.0, 9.0, in_place=replace(here, worth={"a": 20.0}))
    )
    assert (far.verdict, far.sure) == (DiagnosisVerdict.UNKNOWN_EFFECT, ())
    assert far.imitated is None


def test_beside_what_all_effects_leave_one_is_sure_that_outweighs_all_else() -> None:
    """Platform misplaced by a hundred times the noise, while the tracker drifts by ten."""
    found = found_of({"": -9000.0, "a": -30.0, "b": -8970.0, "ab": 0.0})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    field = Imitated(20.0, frozenset(), (), {"a": 800.0, "b": 5.0})

    def sure(
        beside: Imitated, of: ComparedSets = found, implausible: Names = frozenset()
    ) -> tuple[str, ...]:
        signs = SignsOfUnknown(9.0, 1.0, beside_field=lambda: beside)
        said = judge(of, classes, signs, implausible)
        assert said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and said.imitated is None
        return said.sure

    assert sure(field) == ("a",)
    # not if others are worth something too, the field is worth a third as much, or it is little
    assert sure(replace(field, worth={"a": 800.0, "b": 80.0})) == ()
    assert sure(replace(field, odds=270.0)) == ()
    assert sure(replace(field, odds=0.0, worth={"a": 20.0})) == ()
    assert sure(field, implausible=frozenset("a")) == ()
    # nor one of many parameters that is not worth more for it
    seven = ColumnGroup(np.arange(7), np.array([1.0]))
    grown = replace(found.scores.gram, groups={**found.scores.gram.groups, "a": seven})
    large = replace(found, scores=replace(found.scores, gram=grown))
    assert sure(field, large) == ("a",)
    assert sure(replace(field, worth={"a": 80.0}), large) == ()
    # and if no field explains what is unknown, a may follow it
    far = judge(found, classes, SignsOfUnknown(-5.0, 9.0, beside_field=lambda: field))
    assert (far.verdict, far.sure) == (DiagnosisVerdict.UNKNOWN_EFFECT, ())


def test_a_large_set_of_large_groups_is_a_calibration() -> None:
    assert not too_large([24, 8, 6, 6, 6]) and too_large([24, 8, 7])
    best = {"": -9000.0, "ab": -4000.0, "ac": -4100.0, "bc": -4200.0, "abc": 0.0}
    found = found_of(best)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    assert judge(found, classes, NO_SIGNS).verdict is DiagnosisVerdict.EFFECTS_FOUND
    seven = ColumnGroup(np.arange(7), np.array([1.0]))
    for names, verdict in (
        ("ab", DiagnosisVerdict.EFFECTS_FOUND),
        ("abc", DiagnosisVerdict.MANY_EFFECTS),
    ):
        groups = {**found.scores.gram.groups, **dict.fromkeys(names, seven)}
        grown = replace(found.scores, gram=replace(found.scores.gram, groups=groups))
        assert judge(replace(found, scores=grown), classes, NO_SIGNS).verdict is verdict


def test_a_large_set_is_many_effects_and_names_what_carries_it() -> None:
    without = {"abcdef".replace(x, ""): -40.0 for x in "bcdef"}
    said = judged({"": -90000.0, "abcdef": 0.0, "bcdef": -50000.0, **without})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ("a",))


def test_what_each_of_several_sets_has_is_sure_though_what_is_open_is_worth_more() -> None:
    either = {"": -9000.0, "ab": 0.0, "acd": -0.1, "a": -5000.0, "b": -300.0, "cd": -301.0}
    said = judged(either)
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ("a",))
    # beside one that is worth more than a tenth of all, too
    large = {k + "e" * bool(k): s for k, s in either.items()} | {"ab": -2000.0, "acd": -2001.0}
    assert set(judged(large).sure) == {"a", "e"}
    # unless what it is worth is little, or there is one set only
    said = judged({**either, "b": -20.0, "cd": -21.0})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ())
    more = [k for size in (2, 3) for k in combinations("cdefg", size)]
    alone = {"".join(("ab", *k)): -0.1 for k in more}
    said = judged({"": -9000.0, "ab": 0.0, "a": -5000.0, "b": -300.0, **alone})
    assert (said.verdict, said.sure) == (DiagnosisVerdict.MANY_EFFECTS, ("b",))
    # or many others that explain nearly as well lack it
    assert judged({**either, **{f"b{other}": -3.2 for other in "cdefg"}}).sure == ()
    # or a member is of a size that may stand for anything
    found = found_of(either)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    assert judge(found, classes, NO_SIGNS, implausible=frozenset("b")).sure == ()
    # or all are groups that together imitate anything
    found = found_of(large)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    seven = dict.fromkeys("abe", ColumnGroup(np.arange(7), np.array([1.0])))
    gram = replace(found.scores.gram, groups={**found.scores.gram.groups, **seven})
    grown = replace(found, scores=replace(found.scores, gram=gram))
    assert judge(grown, classes, NO_SIGNS).sure == ("e",)
    # or a set has something else in its place
    assert judged({**either, "ec": -0.2}).sure == ()


def test_an_equivalent_counts_as_the_same_member() -> None:
    found = found_of({"": -900.0, "ab": 0.0, "cb": -0.5})
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    assert shared([frozenset("ab"), frozenset("cbd")], classes) == {"a", "b"}
    assert shared([frozenset("ab"), frozenset("d")], classes) == frozenset()
    assert shared([], classes) == frozenset()


def open_sets(scores: dict[str, float]) -> list[set[str]]:
    found = found_of(scores)
    classes = probabilities(all_scores(found), found.best.names, NAMES, fitted=found.refits)
    return [set(names) for names in alternatives(found, classes)]


def test_others_that_explain_as_well_are_alternatives_of_a_set_and_its_part_just_one() -> None:
    """The part: it was "a force with a mass" where the force alone explains as much."""
    others = {"a": -1.0, "abf": -0.5, "cd": -1.2, "cdg": -1.3, "ef": -2.9, "eg": -3.1}
    assert open_sets({"": -900.0, "ab": 0.0, **others}) == [{*"a"}, {*"cd"}, {*"ef"}]


def test_what_is_open_about_the_listed_effects_alone_is_not_found() -> None:
    """A force had 75 % there, as a tilt with softer cables explained the same."""
    both = Judgement(DiagnosisVerdict.EFFECTS_FOUND, ("a", "b"), 0.0)
    sure = Classes({"a": 0.99, "b": 0.96}, [("a",), ("b",)], [0.99, 0.96], {})
    found = found_of({"": -900.0, "ab": 0.0, "acd": -0.5})
    assert both.with_sure_ones(found, sure) is both
    open_one = replace(sure, probability=[0.99, 0.75], effect={"a": 0.99, "b": 0.75})
    left = both.with_sure_ones(found, open_one)
    assert left.verdict is DiagnosisVerdict.MANY_EFFECTS and left.sure == ("a",)
    many = replace(both, verdict=DiagnosisVerdict.MANY_EFFECTS)
    assert many.with_sure_ones(found, open_one) is many
    # where no other set explains as well, only its name is open
    alone = found_of({"": -900.0, "ab": 0.0, "acd": -9.0})
    assert both.with_sure_ones(alone, open_one) is both


def test_a_swap_within_a_class_is_no_alternative() -> None:
    assert open_sets({"": -900.0, "ab": 0.0, "ac": -0.5, "bc": -400.0}) == [{*"ab"}]


def test_two_effects_that_do_what_an_equivalent_of_the_first_does_are_an_alternative() -> None:
    """A centre of mass elsewhere beside a tilt, or a force: the tilt had 76 % and was found."""
    scores = {"": -900.0, "abd": 0.0, "ac": -1.0, "ab": -200.0, "cd": -300.0, "acd": -4.0}
    found = found_of(scores)
    sure = Classes(
        {"a": 0.99, "b": 0.65, "c": 0.34, "d": 0.7},
        [("a",), ("b", "c"), ("d",)], [0.99, 0.99, 0.7], {},
    )  # fmt: skip
    found = replace(found, refit=lambda names: found.refits.get(names))
    assert alternatives(found, sure) == [frozenset("ac"), frozenset("abd")]
    said = Judgement(DiagnosisVerdict.EFFECTS_FOUND, ("a", "b", "d"), 0.0)
    left = said.with_sure_ones(found, sure)
    assert left.verdict is DiagnosisVerdict.MANY_EFFECTS and left.sure == ("a", "b")
    # where the first of them does without the second, the larger set is no other
    better = found_of({**scores, "ab": -1.5})
    better = replace(better, refit=lambda names: better.refits.get(names))
    assert alternatives(better, sure) == [frozenset("ac")]


def test_a_large_best_set_has_no_alternatives_of_few() -> None:
    assert open_sets({"": -900.0, "abcdef": 0.0, "g": -1.0}) == []
    assert open_sets({"": 0.0, "a": -1.0}) == []


def test_equals_in_a_larger_set_are_looked_for_in_what_is_listed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A mass did what a cable does beside gains; the gains were not listed, nor the mass named."""
    joint: Any = SimpleNamespace(terms=Terms())
    robot: Any = None
    scores = {"": -900.0, "abg": 0.0, "cbg": -0.3, "ab": -0.7}
    refits = {frozenset(k): Refit(frozenset(k), joint, {}, s) for k, s in scores.items()}
    fitted: list[Names] = []

    def refit(names: Names) -> Refit | None:
        fitted.append(names)
        return None if names == frozenset("ac") else Refit(names, joint, {}, -1.0)

    base = found_of(scores)
    found = ComparedSets(refits, refits[frozenset("abg")], base.scores, refit)
    classes = probabilities(scores_of(refits), found.best.names, NAMES, fitted=refits)
    assert classes.members[0] == ("a", "c")
    assert with_equivalents(found, frozenset("ab"), classes, robot, Terms()) == {
        frozenset("cb"): -1.0
    }
    assert fitted == [frozenset("cb")]
    # what has no solution and what no robot can have says nothing
    unsolved = ComparedSets(refits, found.best, base.scores, lambda _names: None)
    assert with_equivalents(unsolved, frozenset("ab"), classes, robot, Terms()) == {}
    monkeypatch.setattr(search, "can_be", lambda *_: False)
    assert with_equivalents(found, frozenset("ab"), classes, robot, Terms()) == {}


def scores_of(refits: dict[Names, Refit]) -> dict[Names, float]:
    return {names: one.score for names, one in refits.items()}
