"""Which members of the best set are left out to see whether fewer explain the data as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.calibration.sets import own_noise
from crosscheck.calibration.sets.exact import FEW


def found(
    worth: dict[str, float],
    fitted: dict[str, float] | None = None,
    always: frozenset[str] = frozenset(),
) -> Any:
    """A best set whose members are worth so much ln evidence, beside those of the model.

    Its score is 0; ``fitted`` are those of other sets that were fitted.
    """
    names = frozenset(worth) | always
    near = {names - {name}: 1000.0 - value for name, value in worth.items()}
    near |= {names - {name}: 1000.0 for name in always}
    scores = SimpleNamespace(neighbours=lambda _names: near, score=lambda _names: 1000.0)
    refits = {frozenset(n): SimpleNamespace(score=score) for n, score in (fitted or {}).items()}
    best = SimpleNamespace(names=names, score=0.0)
    return SimpleNamespace(best=best, always=always, scores=scores, refit=refits.get)


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
    some = list(own_noise._doubtful_members(found({"a": 1.0}, always=frozenset("b"))))
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
        assert own_noise.by_own_noise(setting, one).fewer is None and not fitted
    assert own_noise.by_own_noise(setting, found({"a": 1.0})).fewer is None
    assert fitted == [frozenset()]  # nor any other, if the best set itself has no fit


@pytest.mark.parametrize("best", ["", "a", "ab"])
def test_the_set_with_the_most_evidence_by_its_own_noise_is_taken(
    monkeypatch: pytest.MonkeyPatch, best: str
) -> None:
    monkeypatch.setattr(own_noise, "_fitted", fit_of)
    monkeypatch.setattr(
        own_noise, "evidence_by_own_noise", lambda _s, _f, fit: float(fit.out == best)
    )
    setting: Any = None
    taken = own_noise.by_own_noise(setting, found({"a": 1.0, "b": 2.0}))
    assert taken.fewer is None if best == "" else taken.fewer.out == best  # type: ignore[union-attr]
    louder = own_noise.by_own_noise(
        setting, found({"a": 1.0, "b": 2.0}), lambda fit: fit.out != best
    )
    assert louder.fewer is None, "noise must not be as large as this"
    assert set(taken.without) == {frozenset(some) for some in ("", "a", "b", "ab")}


def test_a_member_is_as_probable_as_by_the_noise_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = {"": 10.0, "a": 9.0, "b": 8.0, "ab": 7.0}
    monkeypatch.setattr(own_noise, "_fitted", fit_of)
    monkeypatch.setattr(own_noise, "evidence_by_own_noise", lambda _s, _f, fit: own[fit.out])
    setting: Any = None
    taken = own_noise.by_own_noise(setting, found({"a": 1.0, "b": 2.0, "c": 1e4}))
    assert taken.fewer is None
    total = sum(np.exp(list(own.values())))
    assert taken.without == pytest.approx(
        {frozenset(out): np.exp(e) / total for out, e in own.items()}
    )
    alone = own_noise.by_own_noise(
        setting, found({"a": 1.0, "b": 2.0}), lambda fit: fit.out in ("", "b")
    )
    less = 1.0 / (1.0 + np.exp(2.0))
    assert alone.without == pytest.approx({frozenset(): 1.0 - less, frozenset("b"): less})


def fit_of(_setting: Any, _found: Any, out: frozenset[str]) -> Any:
    """A fit without some of two members."""
    gone = "".join(sorted(out))
    return SimpleNamespace(out=gone)
