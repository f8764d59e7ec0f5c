"""Sentences of a diagnosis that are made of lists."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.unknown.imitated import Imitated
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.explained import _sentence
from crosscheck.diagnosis.result import MissingEffect
from crosscheck.diagnosis.words import doubts_about, hints_of, noise_left, one_of, removed, words_of
from crosscheck.fit.reasons import DiagnosisVerdict


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


def test_what_is_probable_but_not_sure_is_no_none_of_all() -> None:
    """A class at 88 % stood beside "none of 26 effects tried explains any of it"."""
    classes = ((("anchor_point_error", "exit_point_error"), 0.88), (("creep",), 0.3))
    nothing = Judgement(DiagnosisVerdict.NO_EFFECT_MISSING, (), 0.0)
    told = _sentence(nothing, [], 26, Chances({}, classes, None, None))
    assert "a hint of anchor_point_error or exit_point_error (88 %), too weak to be certain" in told
    assert "none of 26" not in told and "creep" not in told
    assert "none of 26 effects" in _sentence(nothing, [], 26, Chances({}, classes[1:], None, None))


def test_what_is_left_beside_what_was_found_may_hide_something() -> None:
    """Stiffness at 78 % stood nowhere in the sentence that named the tracker's frame."""
    classes = ((("tracker_frame",), 1.0), (("stiffness", "platform_mass"), 0.78), (("creep",), 0.3))
    chances = Chances({}, classes, None, None)
    hints = hints_of(chances, ["tracker_frame"])
    assert noise_left(hints) == (
        "the remaining residuals are noise, "
        "with a hint of stiffness or platform_mass (78 %), too weak to be certain"
    )
    assert noise_left({}) == "the remaining residuals are noise"
    # what a search ended with is a hint at any probability, unless it or an equal is listed
    assert list(hints_of(chances, ["tracker_frame"], ["creep"])) == [
        "stiffness or platform_mass", "creep",
    ]  # fmt: skip
    assert hints_of(chances, ["tracker_frame", "platform_mass"], ["stiffness"]) == {}


def test_what_imitates_something_unknown_is_told_with_where_that_shows() -> None:
    imitated = Imitated(9.0, frozenset({"length_scale", "creep"}), (Varying.POSITION,))
    said = Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, (), 0.0, imitated=imitated)
    assert _sentence(said, [], 26, Chances({}, (), None, None)) == (
        "An unknown effect is more probable than creep + length_scale, which can imitate it: "
        "something that varies smoothly over the workspace, in the position alone. 26 effects were "
        "tried."
    )


def test_what_a_field_could_replace_is_told_if_that_is_not_excluded() -> None:
    """Expansion was listed above 95 % where a field of the position is likely, too."""
    doubt = Imitated(3.5, frozenset({"thermal_expansion"}), (Varying.POSITION,))
    chances = Chances({}, (), None, None, doubt=doubt)
    listed = cast(MissingEffect, SimpleNamespace(effect="creep", indistinguishable=[]))
    alike = cast(
        MissingEffect, SimpleNamespace(effect="creep", indistinguishable=["thermal_expansion"])
    )
    assert doubts_about([alike], chances) == [
        "there may be something else in place of thermal_expansion (probability 18 %): something "
        "that varies smoothly over the workspace, in the position alone; move the tracker and "
        "measure some poses again; an error that moves with it comes from the tracker"
    ]
    assert (
        doubts_about([listed], chances) == [] == doubts_about([alike], Chances({}, (), None, None))
    )
    assert chances.as_json()["unknown"]["not_excluded"] == {
        "probability": doubt.probability, "instead_of": ["thermal_expansion"],
        "seen_in": Varying.POSITION,
    }  # fmt: skip


def test_where_all_error_is_below_the_noise_no_share_of_it_is_told() -> None:
    """Points that moved were "removes 0 %", beside errors that fell."""
    assert removed(0.0) == "removes no error beyond the noise on held-out runs by itself"
    assert removed(0.526) == "removes 52.6 % of the unexplained error on held-out runs"
    assert "removes 0.1 %" in removed(0.001)


def test_an_effect_that_predicts_only_with_the_next_one_tells_what_it_leaves_on_all_rows() -> None:
    """Certain effects "explained error that is not larger than the noise", of millimetres."""
    names = ("centre_of_mass", "platform_mass")
    left = {"position_rms_m": 0.00221, "orientation_rms_rad": None, "tension_rms_N": None}
    first, then = (
        cast(MissingEffect, SimpleNamespace(effect=n, indistinguishable=[], share=s, rms=left))
        for n, s in zip(names, (0.0, 0.9997), strict=True)
    )
    assert words_of([first, then]) == (
        "adding centre_of_mass leaves 2.21 mm on all rows, though it removes no error beyond the "
        "noise on held-out runs by itself; then adding platform_mass removes 99.9 % of the "
        "unexplained error on held-out runs"
    )


def test_what_data_do_not_tell_apart_is_told_with_what_to_do_about_each() -> None:
    seen = (Varying.POSITION, Varying.WINCHES)
    doubt = Imitated(3.5, frozenset({"creep"}), seen)
    chances = Chances({}, (), None, None, doubt=doubt)
    listed = cast(MissingEffect, SimpleNamespace(effect="creep", indistinguishable=[]))
    (note,) = doubts_about([listed], chances)
    assert f": {Varying.POSITION}; or {Varying.WINCHES}; move the tracker" in note
    assert note.endswith("; measure what each winch pays out turn by turn, over all of its travel")
    unknown = chances.as_json()["unknown"]["not_excluded"]
    assert unknown["seen_in"] is Varying.POSITION and unknown["or_in"] == [Varying.WINCHES]
