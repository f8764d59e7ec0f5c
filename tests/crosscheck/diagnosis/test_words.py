"""Sentences of a diagnosis that are made of lists."""

from __future__ import annotations

import pytest

from crosscheck.diagnosis.words import agreement, one_of


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
    told = agreement(26, {one_of(["anchor_point_error", "exit_point_error"]): 0.88})
    assert "a hint of anchor_point_error or exit_point_error (88 %), too weak to be sure" in told
    assert "none of 26" not in told and "none of 26 effects" in agreement(26)
