"""Which members of the best set are left out to see whether fewer explain the data as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.calibration import own_noise
from crosscheck.calibration.exact import FEW


def found(worth: dict[str, float], always: frozenset[str] = frozenset()) -> Any:
    """A best set whose members are worth so much ln evidence, beside those of the model."""
    names = frozenset(worth) | always
    near = {names - {name}: 1000.0 - value for name, value in worth.items()}
    near |= {names - {name}: 1000.0 for name in always}
    scores = SimpleNamespace(neighbours=lambda _names: near, score=lambda _names: 1000.0)
    return SimpleNamespace(best=SimpleNamespace(names=names), always=always, scores=scores)


@pytest.mark.parametrize(
    ("worth", "left_out"),
    [
        ({"a": 299.0, "b": 301.0}, ["a"]),
        ({"a": 301.0, "b": 1e6}, []),
        ({"b": 10.0, "a": 20.0, "c": 1e3}, ["a", "b", "ab"]),
        ({"a": -5.0}, ["a"]),
        ({}, []),
    ],
)
def test_those_worth_little_are_left_out_alone_and_then_together(
    worth: dict[str, float], left_out: list[str]
) -> None:
    some = own_noise._doubtful_members(found(worth))
    assert ["".join(sorted(names)) for names in some] == left_out


def test_what_the_model_has_already_is_not_doubted() -> None:
    some = list(own_noise._doubtful_members(found({"a": 1.0}, frozenset("b"))))
    assert some == [frozenset("a")]


def test_nothing_is_fitted_where_nothing_is_doubtful_or_the_set_is_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fitted: list[frozenset[str]] = []

    def none_of(_setting: Any, _found: Any, out: frozenset[str]) -> None:
        fitted.append(out)

    monkeypatch.setattr(own_noise, "_fitted", none_of)
    setting: Any = None
    many = {f"effect {k}": 1.0 for k in range(FEW + 1)}
    for one in (found({"a": 1e4}), found(many)):
        assert own_noise.noise_of_fewer(setting, one) is None and not fitted
    assert own_noise.noise_of_fewer(setting, found({"a": 1.0})) is None
    assert fitted == [frozenset()]  # nor any other, if the best set itself has no fit


@pytest.mark.parametrize("best", ["", "a", "ab"])
def test_the_set_with_the_most_evidence_by_its_own_noise_is_taken(
    monkeypatch: pytest.MonkeyPatch, best: str
) -> None:
    def joint(_setting: Any, _found: Any, out: frozenset[str]) -> str:
        return "".join(sorted(out))

    def evidence(_setting: Any, _found: Any, fit: str) -> float:
        return 2.0 if fit == best else 1.0

    monkeypatch.setattr(own_noise, "_fitted", joint)
    monkeypatch.setattr(own_noise, "evidence", evidence)
    setting: Any = None
    taken = own_noise.noise_of_fewer(setting, found({"a": 1.0, "b": 2.0}))
    assert taken == (best or None)
