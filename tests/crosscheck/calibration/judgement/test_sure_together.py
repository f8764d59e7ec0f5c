"""Classes that are sure only together with effects that explain nearly as well."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from crosscheck.calibration.judgement.probability import Classes, of_classes, probabilities
from crosscheck.calibration.judgement.sure_together import sure_together
from crosscheck.calibration.sets.linear_search import Names

# The best set has "a"; "b" to "e" explain less and less in its place.
ALONE = {frozenset("a"): 0.0, frozenset("b"): -3.2, frozenset("c"): -3.4, frozenset("d"): -3.6}
ALONE |= {frozenset("e"): -5.0, frozenset(): -20.0}


def wider(scores: Mapping[Names, float], best: str) -> Classes:
    classes = probabilities(scores, frozenset(best), "abcdef")
    return sure_together(classes, scores, scores, frozenset(best))


def test_what_explains_nearly_as_well_joins_until_the_class_is_sure() -> None:
    before = probabilities(ALONE, frozenset("a"), "abcdef")
    assert before.members[0] == ("a",) and before.of("a") == pytest.approx(0.902, abs=1e-3)
    found = wider(ALONE, "a")
    assert found.members[0] == ("a", "b", "c", "d")
    assert found.of("a") == found.of("d") == found.probability[0]
    assert found.probability[0] == pytest.approx(0.994, abs=1e-3)
    assert ("e",) in found.members and found.effect == before.effect


def test_no_more_join_than_are_needed() -> None:
    found = wider(ALONE | {frozenset("d"): -7.0}, "a")
    assert found.members[0] == ("a", "b", "c") and found.probability[0] > 0.97


def test_what_explains_as_well_as_one_that_joined_is_not_left_out() -> None:
    """A mass, which was there, explained better than four that joined with one of their kind."""
    scores = ALONE | {frozenset("c"): -7.0, frozenset("d"): -4.5, frozenset(): -20.0}
    groups = [("a",), ("b", "e"), ("c",), ("d",)]
    classes = of_classes(scores, frozenset("a"), "abcde", groups)
    found = sure_together(classes, scores, scores, frozenset("a"))
    assert set(found.members[0]) == set("abde") and ("c",) in found.members


def test_a_class_that_is_sure_stays_as_it_is() -> None:
    scores = {frozenset("a"): 0.0, frozenset("b"): -3.2, frozenset(): -20.0}
    assert wider(scores, "a").members[0] == ("a",)


@pytest.mark.parametrize("scores", [
    ALONE | {frozenset(): -1.5},  # that nothing is missing is possible
    ALONE | {frozenset("f"): -9.0, frozenset("ab"): -0.5, frozenset(): -1.5},
    {frozenset("a"): 0.0, frozenset("bc"): -1.5, frozenset(): -20.0},  # several in its place
])  # fmt: skip
def test_where_no_wider_class_is_sure_none_is_named(scores: Mapping[Names, float]) -> None:
    before = probabilities(scores, frozenset("a"), "abcdef")
    assert wider(scores, "a").members == before.members


def test_each_member_has_others_in_its_own_place() -> None:
    """What explains as much in place of one member does not stand for another."""
    scores = {frozenset("ab"): 0.0, frozenset("ac"): -3.1, frozenset("ad"): -3.2}
    scores |= {frozenset("ae"): -5.0, frozenset("a"): -25.0, frozenset("b"): -25.0}
    found = wider(scores, "ab")
    assert set(found.members[:2]) == {("a",), ("b", "c", "d")}
    assert found.of("b") > 0.95 and found.of("e") < 0.1


def test_what_the_model_has_already_is_in_no_class() -> None:
    scores = {names | {"tracker_frame"}: score for names, score in ALONE.items()}
    best = frozenset({"a", "tracker_frame"})
    classes = probabilities(scores, best, "abcdef")
    found = sure_together(classes, scores, scores, best)
    assert found.members[0] == ("a", "b", "c", "d")
    assert not any("tracker_frame" in members for members in found.members)
