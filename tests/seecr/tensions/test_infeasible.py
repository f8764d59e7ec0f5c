"""Sentences that say why a pose cannot be held."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from seecr.tensions.infeasible import why_not_held, without_span


def test_a_load_that_no_pull_can_balance_is_told_as_such() -> None:
    """Two cables in a plane cannot take a torque out of nothing, however they pull."""
    matrix, load = np.array([[1.0, -1.0], [1.0, 1.0], [0.0, 0.0]]), np.array([0.0, 1.0, 0.5])
    names, low, high = ["a", "b"], np.zeros(2), np.full(2, np.inf)
    assert why_not_held(matrix, load, low, high, names).startswith("no pulls of the cables")
    short = why_not_held(matrix, np.array([0.0, 2.0, 0.0]), low, np.array([0.5, 9.0]), names)
    assert short == "cable a would have to pull 1 N, more than 0.5 N"
    less = why_not_held(matrix, np.array([0.0, 2.0, 0.0]), np.array([1.5, 0.0]), high, names)
    assert less == "cable a would have to pull 1 N, less than 1.5 N"
    large = why_not_held(matrix, np.array([0.0, 2e4, 0.0]), low, np.array([6000.0, 9e4]), names)
    assert large == "cable a would have to pull 10000 N, more than 6000 N"


def test_where_only_the_upper_limit_is_in_the_way_no_cable_is_said_to_push() -> None:
    """Two shallow cables from above and one from below: less is exceeded if the latter pushes."""
    matrix, load = np.array([[-1.0, 1.0, 0.0], [0.1, 0.1, -1.0]]), np.array([0.0, 50.0])
    high, names = np.full(3, 60.0), ["a", "b", "c"]
    said = [
        why_not_held(matrix, load, np.array([1.0, 1.0, low]), high, names) for low in (0.0, 1.0)
    ]
    for one, pull in zip(said, (250, 255), strict=True):
        parts = [f"cable {k} would have to pull {pull} N, more than 60 N" for k in "ab"]
        assert sorted(one.split("; ")) == parts
    above = why_not_held(matrix, np.array([0.0, -50.0]), np.ones(3), np.full(3, 9.0), names)
    assert "push" not in above and "cable c would have to pull" in above


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e4])
def test_the_lower_limit_is_told_whatever_its_size(size: float) -> None:
    """Three cables from above, on a point: nothing pulls against them."""
    up = np.array([[2.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    low, high, names = np.full(3, size), np.full(3, np.inf), ["a", "b", "c"]
    said = why_not_held(up, np.zeros(2), low, high, names)
    assert said.startswith(
        "without a load all cables could be slack, but not with the lower limit: cable"
    )
    assert said.count(f"{size:.3g} N" if size < 1e3 else f"{size:.0f} N") >= 2
    nothing = why_not_held(up, np.zeros(2), 0.0 * low, high, names)
    assert nothing.startswith("tensions at their limits would balance")
    loaded = why_not_held(up, np.array([0.0, size]), low, high, names)
    assert loaded.startswith("cable") and "without a load" not in loaded


def test_a_search_for_a_reason_that_fails_gives_none(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = SimpleNamespace(status=4, x=None)
    monkeypatch.setattr("scipy.optimize.linprog", lambda *_, **__: ended)
    low, high = np.zeros(4), np.full(4, 0.2)
    said = why_not_held(np.ones((1, 4)), np.ones(1), low, high, list("abcd"))
    assert said == "no tensions within the limits balance the load there"


def test_of_several_cables_one_is_named() -> None:
    gone, pulleys = np.array([False, True, True]), np.zeros(3, bool)
    assert without_span(gone, pulleys, ["a", "b", "c"]) == (
        "cable b would have no length, its anchor point at its exit point, nor would 1 more cable"
    )


def test_it_is_told_what_a_cable_weighs() -> None:
    matrix, load, names = np.array([[1.0, 1.0]]), np.array([5.0]), ["a", "b"]
    low, high = np.array([4.0, 4.0]), np.array([9.0, 9.0])
    push = why_not_held(matrix, np.array([-3.0]), low, high, names)
    assert re.fullmatch(
        "cable [ab] would have to push with 7 N to keep the others at 4 N or more", push
    )
    free = why_not_held(matrix, np.array([-3.0]), 0.0 * low, high, names)
    assert free in ("cable a would have to push with 3 N", "cable b would have to push with 3 N")
    less = why_not_held(matrix, load, low, high, names, np.array([4.0, 3.0]))
    assert less == "cable a would have to pull 1 N, less than the 4 N that it weighs"
    heavy = why_not_held(matrix, load, low, np.array([9.0, 2.0]), names, low)
    assert heavy == "cable b weighs 4 N, more than the 2 N it may pull"
    just = why_not_held(matrix, np.array([8.0]), low, high, names)
    assert just.startswith("tensions at their limits would balance the load")
