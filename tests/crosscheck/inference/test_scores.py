"""Moves between sets in a linear model where each has one width: there they are exact."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.inference.evidence import Linear, MemberColumns
from crosscheck.inference.scores import LARGE, Scores, ranked

NAMES = ("a", "b", "c", "d", "a@run", "b@run", "~0", "~1")
SHARES = {"~0": -4.0, "~1": -5.0, "a@run": -2.0, "b@run": -2.0}


def scores_of(
    prices: dict[str, float] | None = None, stood: tuple[str, ...] = (), seed: int = 0
) -> Scores:
    """Eight members of two columns that resemble one another."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(60, 16)) + 0.7 * rng.normal(size=(60, 1))
    y = x @ np.repeat([0.8, 0.0, -0.6, 0.1, 0.0, 0.2, 0.4, 0.0], 2) + rng.normal(size=60)
    groups = {
        name: MemberColumns(np.array([2 * k, 2 * k + 1]), np.array([1.0 + 0.1 * k]))
        for k, name in enumerate(NAMES)
    }
    every = SimpleNamespace(
        log_prior=lambda key: -1.5 * len(key) + sum(SHARES.get(k, 0.0) for k in key),
        log_shares=SHARES, stood_keys=frozenset(stood),
    )  # fmt: skip
    about = SimpleNamespace(linear=Linear.of(x, y, groups), every=every, prices=prices or {})
    centre = SimpleNamespace(key=frozenset("a"), score=100.0)
    return Scores(about, centre)  # type: ignore[arg-type]


def some(*keys: str) -> frozenset[str]:
    return frozenset(keys)


@pytest.mark.parametrize("key", [some(), some("a"), some("a", "c"), some("a", "b@run", "~0")])
def test_neighbours_have_the_scores_of_their_own(key: frozenset[str]) -> None:
    """One effect more, one less, one in another's place; forms and fields stay as they are."""
    scores, exact = scores_of({"a": 0.7, "d": 0.2}), scores_of({"a": 0.7, "d": 0.2})
    found = scores.neighbours(key)
    names = {k.partition("@")[0] for k in key}
    plain = [k for k in "abcd"]
    more = {key | {k} for k in plain if k not in names}
    gone = {k for k in key if not k.startswith("~")}
    less = {key - {k} for k in gone}
    other = {
        key - {k} | {n} for k in gone for n in plain
        if n not in {m.partition("@")[0] for m in key - {k}} and n != k
    }  # fmt: skip
    assert set(found) == more | less | other
    for one, score in found.items():
        assert score == pytest.approx(exact.score(one), abs=1e-8), one
    assert scores.larger(key) == pytest.approx({k: found[k] for k in more})


def test_what_stands_is_neither_dropped_nor_exchanged() -> None:
    scores = scores_of(stood=("a",))
    assert all("a" in key for key in scores.neighbours(some("a", "c")))


def test_fields_and_forms_beside_a_set_have_the_scores_of_their_own() -> None:
    scores, exact = scores_of(), scores_of()
    fields = scores.with_fields(some("a", "c", "~1"))
    assert set(fields) == {some("a", "c", "~0"), some("a", "c", "~1")}
    # a field costs its share; it is no effect, of which any number is as probable
    for key, score in fields.items():
        own = exact.score(key) + 1.5
        assert score == pytest.approx(own, abs=1e-8)
    forms = scores.with_forms(some("a", "c"))
    assert set(forms) == {some("a@run", "c"), some("a", "c", "b@run")}
    for key, score in forms.items():
        assert score == pytest.approx(exact.score(key), abs=1e-8)
    assert set(scores.with_forms(some("a@run"))) == {some("a@run", "b@run")}


def test_a_price_and_what_moves_nothing_count_as_such() -> None:
    dear, cheap = scores_of({"a": 0.7}), scores_of()
    assert dear.score(some("a", "b")) == pytest.approx(cheap.score(some("a", "b")) - 0.7)
    assert cheap.score(some("a", "idle")) == pytest.approx(cheap.score(some("a")) - 1.5)
    assert cheap.gain(some("a"), "idle") == 0.0
    assert cheap.promised(some("a")) == pytest.approx(100.0)
    gained = cheap.score(some("a", "c")) - cheap.score(some("a"))
    assert cheap.promised(some("a", "c")) == pytest.approx(100.0 + gained)


@pytest.mark.parametrize("seed", range(4))
def test_a_climb_ends_where_no_move_is_better(seed: int) -> None:
    scores = scores_of(seed=seed)
    exact = scores_of(seed=seed)
    end = scores.climb(some())
    assert exact.score(end) > exact.score(some()) + 1.0
    assert max(map(exact.score, exact.neighbours(end))) <= exact.score(end) + 1e-6
    without = scores.climb(some("b"), without=some("a", "d"))
    others = [k for k in exact.neighbours(without) if not k & some("a", "d")]
    assert not without & some("a", "d")
    assert max(map(exact.score, others)) <= exact.score(without) + 1e-6
    best = scores.best(3)
    assert scores.seen[best[0]] == max(scores.seen.values()) and len(best) <= 3
    assert [scores.seen[k] for k in best] == sorted((scores.seen[k] for k in best), reverse=True)
    assert ranked({some("b"): 1.0, some("a"): 1.0, some("c"): 2.0}) == [
        some("c"), some("a"), some("b"),
    ]  # fmt: skip


def orthogonal(power: list[float], names: Sequence[str] = ()) -> Scores:
    """Members at right angles, each with so much power, in units of the noise."""
    names = [*names, *(f"e{k:02d}" for k in range(len(power)))][: len(power)]
    x = np.linalg.qr(np.random.default_rng(0).normal(size=(60, len(power))))[0]
    groups = {n: MemberColumns(np.array([k]), np.array([30.0])) for k, n in enumerate(names)}
    every = SimpleNamespace(log_prior=lambda key: -0.0 * len(key), stood_keys=frozenset())
    about = SimpleNamespace(
        linear=Linear.of(x, x @ np.sqrt(2.0 * np.array(power)), groups), every=every, prices={}
    )
    return Scores(about, SimpleNamespace(key=frozenset(), score=0.0))  # type: ignore[arg-type]


@pytest.mark.parametrize(("weak", "kept"), [(2.9, LARGE), (3.1, LARGE + 2)])
def test_large_sets_are_thinned_while_a_member_is_worth_little(weak: float, kept: int) -> None:
    """Ten members, of which two gain ``weak`` each: more than LARGE stay only if worth it."""
    cost = 0.5 * np.log1p(30.0**2)
    power = [(30.0 + k + cost) * (1.0 + 30.0**-2) for k in range(LARGE)]
    power += [(weak + cost) * (1.0 + 30.0**-2)] * 2
    scores = orthogonal(power)
    every = frozenset(scores.about.linear.groups)
    assert scores.score(every) - scores.score(every - {"e09"}) == pytest.approx(weak)
    assert len(scores.climb(every, moves=0)) == kept
    assert frozenset(f"e{k:02d}" for k in range(LARGE)) <= scores.climb(every, moves=0)
    # so are sets that are not large as they are
    few = orthogonal(power[-1:] * LARGE)
    assert len(few.climb(frozenset(few.about.linear.groups), moves=0)) == LARGE


def test_what_stands_and_a_field_stay_in_a_set_that_is_thinned() -> None:
    """They do not count as its members, and are worth nothing here."""
    cost = 0.5 * np.log1p(30.0**2)
    power = [0.1, 0.1] + [(30.0 + k + cost) * (1.0 + 30.0**-2) for k in range(LARGE)]
    scores = orthogonal(power, names=["stands", "~0"])
    scores.stood = frozenset(["stands"])
    every = frozenset(scores.about.linear.groups)
    assert scores.climb(every, moves=0) == every
