"""Sets grow member by member from exact fits."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.calibration.sets import grown as grown_module
from crosscheck.calibration.sets.grown import grown

Names = frozenset[str]


class Toy:
    """Sets of single letters with the evidence of a table; others explain nothing."""

    def __init__(self, table: dict[str, float], nothing: float = -1000.0) -> None:
        self.table = {frozenset(names): score for names, score in table.items()}
        self.nothing = nothing
        self.catalogue = SimpleNamespace(names=tuple("abcdefgh"))
        self.plain = SimpleNamespace(terms=SimpleNamespace(names=()))
        self.joint = "all effects"
        self.impossible: set[Names] = set()
        self.fitted: dict[Names, Any] = {}
        self.about: list[object] = []
        self.fit(None, frozenset())

    def fit(self, _scores: object, names: Names) -> Any:
        score = self.table.get(names, self.nothing)
        self.fitted[names] = SimpleNamespace(names=names, score=score, joint=names)
        return self.fitted[names]

    def fit_all(self, scores: object, some: Iterable[Names]) -> list[Any]:
        return [self.fit(scores, names) for names in some]

    def scores_about(self, joint: object) -> Any:
        self.about.append(joint)
        return SimpleNamespace(score=lambda names: self.table.get(names, self.nothing))

    def can_be(self, refit: Any) -> bool:
        return refit.names not in self.impossible

    @property
    def best(self) -> Any:
        possible = (one for one in self.fitted.values() if self.can_be(one))
        return max(possible, key=lambda one: one.score)


GROWS = {"a": -300.0, "b": -310.0, "ae": -250.0, "bc": -200.0, "bcd": -50.0}


def test_the_second_best_effect_grows_as_well() -> None:
    toy: Any = Toy(GROWS)
    assert grown(toy).names == frozenset("bcd")
    # each member is chosen about the exact fit of those before it, never about that of all
    assert "all effects" not in toy.about
    assert [frozenset("b"), frozenset("bc"), frozenset("bcd")] == toy.about[-3:]


def test_a_set_stops_growing_when_it_cannot_become_the_best(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    toy: Any = Toy(GROWS)
    monkeypatch.setattr(grown_module, "_MOST", 3)
    toy.table[frozenset("gh")] = 0.0
    toy.fit(None, frozenset("gh"))  # found before
    assert grown(toy).names == frozenset("gh")
    # 50 more than -250, and 110 more than -200, are still far below 0
    assert frozenset("abe") not in toy.fitted
    assert frozenset("bcd") not in toy.fitted
    toy = Toy(GROWS)
    toy.table[frozenset("gh")] = -95.0  # which 110 more than -200 are not
    toy.fit(None, frozenset("gh"))
    grown(toy)
    assert frozenset("bcd") in toy.fitted


def test_values_that_no_robot_can_have_do_not_grow() -> None:
    toy: Any = Toy(GROWS)
    toy.impossible = {frozenset("bc"), frozenset("bcd")}
    assert grown(toy).names == frozenset("ae")
    toy = Toy({**GROWS, "g": -20.0, "h": -30.0})  # two negative masses took both places
    toy.impossible = {frozenset("g"), frozenset("h")}
    assert grown(toy).names == frozenset("bcd")


def test_of_a_model_without_an_equilibrium_nothing_grows() -> None:
    toy: Any = Toy(GROWS)
    toy.fitted = {frozenset(): None, frozenset("a"): toy.fit(None, frozenset("a"))}
    toy.can_be = lambda one: one is not None
    assert grown(toy).names == frozenset("a")
    assert len(toy.fitted) == 2


def test_the_member_that_promises_most_is_not_the_only_one_tried() -> None:
    toy: Any = Toy(GROWS)
    promise = {frozenset("bg"): -150.0, frozenset("bh"): -160.0}  # which they do not keep
    toy.scores_about = lambda _joint: SimpleNamespace(
        score=lambda names: promise.get(names, toy.table.get(names, toy.nothing))
    )
    assert grown(toy).names == frozenset("bcd")


def test_a_member_that_adds_next_to_nothing_ends_a_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grown_module, "_FROM", 1)
    toy: Any = Toy({"a": -300.0, "ab": -298.0, "abc": -10.0})
    assert grown(toy).names == frozenset("ab")
    assert frozenset("abc") not in toy.fitted
