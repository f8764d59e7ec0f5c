"""Sentences of a diagnosis that are made of lists."""

from __future__ import annotations

import pytest
from made_diagnoses import unknown

from crosscheck.diagnosis.result import Chances
from crosscheck.diagnosis.words import hints_of, one_of, removed
from crosscheck.inference.fields import Varying


@pytest.mark.parametrize(
    ("members", "words"),
    [
        (["a"], "a"),
        (["a", "b"], "a or b"),
        (["a", "b", "c"], "a, b or c"),
        (["a", "b", "c", "d", "e"], "a, b or one of 3 others"),
    ],
)
def test_effects_of_which_it_is_one(members: list[str], words: str) -> None:
    assert one_of(members) == words


def test_what_is_probable_and_not_listed_is_a_hint() -> None:
    """Stiffness at 78 % stood nowhere in the sentence that named the tracker's frame."""
    classes = ((("tracker_frame",), 1.0), (("stiffness", "platform_mass"), 0.78), (("creep",), 0.3))
    chances = Chances({}, classes, 0.0)
    assert hints_of(chances, ["tracker_frame"]) == {"stiffness or platform_mass": 0.78}
    assert hints_of(chances, ["tracker_frame", "platform_mass"]) == {}


def test_what_something_unknown_may_change_is_told_and_kept() -> None:
    chances = Chances({}, (), 0.97, (Varying.POSITION, Varying.WINCHES))
    assert chances.looks_like == f" It looks like {Varying.POSITION} or {Varying.WINCHES}."
    kept = chances.as_json()["unknown"]
    assert kept["seen_in"] is Varying.POSITION and kept["or_in"] == [Varying.WINCHES]
    # what no smooth field follows has no such sentence
    assert unknown().sentence.endswith("an unknown effect is missing.")


def test_where_all_error_is_below_the_noise_no_share_of_it_is_told() -> None:
    """Points that moved were "removes 0 %", beside errors that fell."""
    assert removed(0.0) == "removes no error beyond the noise on test runs by itself"
    assert removed(0.526) == "removes 52.6 % of the unexplained error on test runs"
    assert "removes 0.1 %" in removed(0.001)
