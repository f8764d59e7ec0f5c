"""Search of sets of effects against all of them; probabilities and classes from scores."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from crosscheck.calibration.judgement.probability import (
    Classes,
    alike_beyond,
    all_scores,
    of_classes,
    probabilities,
    with_hints,
)
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, Gram, gram_of
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names, Scores, explore, log_prior, trimmed
from crosscheck.calibration.sets.refits import ComparedSets

WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])
NONE: Names = frozenset()


def toy(seed: int, there: tuple[int, ...], alike: bool = False) -> Gram:
    """Eight effects of one to four columns, some of which are there."""
    rng = np.random.default_rng(seed)
    counts = [1, 2, 3, 4, 1, 2, 3, 4]
    ends = np.cumsum(counts)
    x = 2.0 * rng.normal(size=(80, ends[-1]))
    if alike:  # the second is the first, turned, and a little of its own
        x[:, 4:5] = x[:, :1] + 1e-3 * rng.normal(size=(80, 1))
        x[:, 1:3] = x[:, 8:10] + 0.3 * rng.normal(size=(80, 2))
    parts = {f"e{k}": np.arange(ends[k] - n, ends[k]) for k, n in enumerate(counts)}
    y = rng.normal(size=80)
    for k in there:
        y = y + x[:, parts[f"e{k}"]] @ rng.normal(size=counts[k])
    return gram_of(x, y, {n: ColumnGroup(c, WIDTHS) for n, c in parts.items()})


def every_set(gram: Gram) -> list[Names]:
    return [frozenset(s) for k in range(9) for s in combinations(gram.names, k)]


# None, two and most of them; other numbers in a sweep.
THERE = [
    (), (0, 5), (0, 2, 3, 5, 7),
    pytest.param((3,), marks=pytest.mark.sweep), pytest.param((1, 2, 6), marks=pytest.mark.sweep),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("alike", [False, True])
@pytest.mark.parametrize("there", THERE)
def test_the_search_ends_at_the_best_of_all_sets(there: tuple[int, ...], alike: bool) -> None:
    for seed in range(1):
        gram = toy(seed, there, alike)
        scores = Scores(gram, 8)
        best = max(every_set(gram), key=scores.score)
        fresh = Scores(gram, 8)
        found = explore(fresh, [NONE, frozenset(gram.names)])
        assert fresh.score(found) == pytest.approx(scores.score(best), abs=1e-6)


def test_neighbours_of_a_set_are_scored_as_those_sets_are() -> None:
    scores = Scores(toy(0, (1, 2, 6)), 8)
    at = frozenset({"e1", "e2"})
    for names, score in scores.neighbours(at).items():
        if len(names) != 2:  # one more or one less: widths are looked for again
            assert score <= scores.score(names) + 0.7
            assert score > scores.score(names) - 3.0


@pytest.mark.slow
def test_what_the_model_has_is_in_every_set_and_no_guess() -> None:
    gram, held = toy(0, (1, 2, 6)), frozenset({"e0"})
    scores = Scores(gram, 7, held)
    best = explore(scores, [held, frozenset(gram.names)])
    assert all(held <= names for names in scores.solved)
    whole = (names for names in every_set(gram) if held <= names)
    assert scores.score(best) == pytest.approx(max(map(scores.score, whole)), abs=1e-6)
    # chosen without a word of the data, the rest is a set of seven
    assert scores.log_prior(held) == log_prior(0, 7)
    assert scores.log_prior(best) == log_prior(len(best) - 1, 7)


def test_prior_is_a_prior() -> None:
    whole = sum(np.exp(log_prior(k, 8)) * len(list(combinations(range(8), k))) for k in range(9))
    assert whole == pytest.approx(1.0)
    assert log_prior(0, 8) == pytest.approx(log_prior(8, 8))


def test_a_large_set_is_thinned_without_losing_what_is_there() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(200, 20))
    y = 3.0 * x[:, 4] - 4.0 * x[:, 11] + rng.normal(size=200)
    gram = gram_of(x, y, {f"e{k}": ColumnGroup(np.array([k]), WIDTHS) for k in range(20)})
    left = trimmed(Scores(gram, 20), frozenset(gram.names))
    assert len(left) <= 8
    assert {"e4", "e11"} <= left


def test_probabilities_are_sums_over_sets_and_equals_are_one_class() -> None:
    a, b, c = "abc"
    scores = {
        NONE: -50.0, frozenset({a}): 0.0, frozenset({b}): -1.0, frozenset({a, c}): np.log(0.25),
        frozenset({c}): -40.0,
    }  # fmt: skip
    found = probabilities(scores, frozenset({a}), [a, b, c])
    total = 1.0 + np.exp(-1.0) + 0.25
    assert found.effect[a] == pytest.approx(1.25 / total)
    assert found.effect[c] == pytest.approx(0.25 / total)
    assert found.members[0] == (a, b)
    assert found.probability[0] == pytest.approx(1.0)
    assert found.undecided == pytest.approx(0.25 / total)


def many_weak(seed: int) -> Gram:
    """Fourteen effects, two of which are there, hardly seen, and two much like those."""
    rng = np.random.default_rng(seed)
    x = 2.0 * rng.normal(size=(80, 14))
    for there, like in ((0, 6), (5, 7)):
        x[:, like] = 0.8 * x[:, there] + 0.6 * x[:, like]
    y = rng.normal(size=80) + 0.17 * (x[:, 0] + x[:, 5])
    return gram_of(x, y, {f"e{k}": ColumnGroup(np.array([k]), WIDTHS) for k in range(14)})


def test_what_stands_in_a_place_beside_an_equal_is_an_equal_too() -> None:
    """A curve with a misplaced target did what a stiffness with a tilt does, and no exchange."""
    scores = {frozenset("ab"): 0.0, frozenset("ac"): -0.8, frozenset("dc"): -0.9}
    scores |= {frozenset("db"): -9.0, frozenset("ef"): -0.5, frozenset("a"): -20.0}
    found = probabilities(scores, frozenset("ab"), "abcdef")
    assert {frozenset(members) for members in found.members} == set(
        map(frozenset, ("ad", "bc", "e", "f"))
    )
    assert found.of("d") == pytest.approx(found.of("a")) and found.of("e") < 0.4


@pytest.mark.slow
def test_members_of_the_best_set_are_as_sure_as_all_sets_say() -> None:
    """Larger sets about the best one alone made them surer: 0.71 for 0.59, 0.96 for 0.94."""
    off = []
    for seed in (0, 3, 9):
        gram = many_weak(seed)
        every = Scores(gram, 14)
        # a thousand sets of four would change these probabilities by 0.02
        sets = [frozenset(s) for k in range(4) for s in combinations(gram.names, k)]
        fresh = Scores(gram, 14)
        explore(fresh, [NONE])
        fit: Any = None  # of linear models there is none
        some = {n: Refit(n, fit, {}, fresh.score(n)) for n in {NONE, *fresh.best(20, 12.0)}}
        best = max(some.values(), key=lambda r: r.score)
        found = all_scores(ComparedSets(some, best, fresh, some.get))
        alone = [(name,) for name in gram.names]
        true = of_classes({n: every.score(n) for n in sets}, best.names, gram.names, alone).effect
        said = of_classes(found, best.names, gram.names, alone).effect
        off += [said[e] - true[e] for e in best.names]
    assert len(off) == 5 and np.max(off) < 0.03 and np.min(off) > -0.08


def test_beside_what_the_linear_model_does_not_know_others_gain_what_they_do_elsewhere() -> None:
    """All that explain there what it explains here were counted as if they cost nothing."""
    gram = many_weak(0)
    scores = Scores(gram, 14)
    best, other = frozenset({"e0", "e5"}), frozenset({"e9"})
    fit: Any = None
    top = scores.score(best)
    some = {
        NONE: Refit(NONE, fit, {}, top - 20.0), best: Refit(best, fit, {}, top),
        other: Refit(other, fit, {}, top - 1.0),
    }  # fmt: skip
    # about the best set the linear model sees little of what the other does
    scores.solved[other] = (top - 60.0, {"e9": 1.0})
    found = all_scores(ComparedSets(some, some[best], scores, some.get))
    larger = {names - other: s for names, s in found.items() if other < names and not best < names}
    assert len(larger) == 11
    # what they gain but for the prior, which pays less for a third effect than for a second
    second, third = (
        scores.log_prior(some | {"e1"}) - scores.log_prior(some) for some in (other, best)
    )
    assert second < third - 0.3
    for one, score in larger.items():
        there = found[best | one] - top
        assert score - (top - 1.0) <= there + second - third + 1e-9
    assert np.median([*larger.values()]) < top - 2.0


def hinting(same: float) -> Scores:
    """c is listed; a explains something more, b goes with it, and d something else again."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(200, 6))
    x[:, 1] = same * x[:, 0] + np.sqrt(1.0 - same**2) * x[:, 1]
    y = rng.normal(size=200) + 2.0 * x[:, 2] + 0.3 * (x[:, 0] + x[:, 3])
    groups = {n: ColumnGroup(np.array([k]), WIDTHS) for k, n in enumerate("abcdef")}
    scores = Scores(gram_of(x, y, groups), 6)
    scores.score(frozenset("c"))
    return scores


def test_effects_that_hint_at_the_same_are_put_together() -> None:
    """An exit point at 56 % and an anchor point at 28 %: it is one of them."""
    listed = frozenset("c")
    assert alike_beyond(hinting(0.98), listed, {}) == [("a", "b")]
    assert alike_beyond(hinting(0.3), listed, {}) == []  # a and d both hint, at two things


def test_hints_are_classes_beside_those_of_what_is_listed() -> None:
    members = [("c", "f"), ("a",), ("b",), ("d",)]
    found = with_hints(members, [("a", "b", "f")])
    assert found == [("a", "b"), ("c", "f"), ("d",)]
    assert with_hints(members, []) == members


def test_no_probability_is_more_than_one() -> None:
    """Printed once: 1.0000000000000242."""
    random = np.random.default_rng(0)
    for count in range(2, 60):
        scores = {frozenset({"a", str(k)}): float(random.uniform(-9.0, 0.0)) for k in range(count)}
        found = of_classes(scores, frozenset({"a", "0"}), ["a"], [("a",)])
        assert 1.0 - 1e-12 < found.effect["a"] <= 1.0 and found.probability[0] <= 1.0


def test_a_second_of_a_class_has_a_probability_of_its_own() -> None:
    scores = {
        NONE: -50.0, frozenset("ab"): 0.0, frozenset("a"): -1.0, frozenset("ac"): -1.0,
        frozenset("bc"): -1.5,
    }  # fmt: skip
    found = probabilities(scores, frozenset("ab"), "abc")
    assert found.members == [("a", "b", "c")] and found.probability == [pytest.approx(1.0)]
    one = np.exp(-1.0) / (1.0 + 2.0 * np.exp(-1.0) + np.exp(-1.5))
    assert found.further == {"b": pytest.approx(1.0 - one)}
    assert found.of("a") == found.of("c") == found.probability[0]
    assert found.of("b") == pytest.approx(1.0 - one)
    assert found.undecided == pytest.approx(one)


@pytest.mark.parametrize(("loss", "own", "other", "equal"), [
    (2.9, 1, 1, True), (3.1, 1, 1, False),
    (5.9, 2, 3, True),  # the third parameter costs that much by itself
    (3.1, 3, 2, False), (5.9, 1, 8, False),  # a large group has to be as good as it is
])  # fmt: skip
def test_equals_may_cost_what_their_parameters_do(
    loss: float, own: int, other: int, equal: bool
) -> None:
    scores = {NONE: -50.0, frozenset({"a"}): 0.0, frozenset({"b"}): -loss}
    found = probabilities(scores, frozenset({"a"}), "ab", {"a": own, "b": other})
    assert (found.members[0] == ("a", "b")) is equal


def test_the_best_set_is_among_the_best_at_any_size_of_score() -> None:
    """A reading of -99999 m makes scores so large that a difference of 15 is lost in rounding."""
    scores = Scores(toy(0, (1, 2, 6)), 8)
    scores.solved = {NONE: (-1e21, {}), frozenset({"e1"}): (-2e21, {})}
    assert scores.best(2, 15.0) == [NONE]


def test_members_of_the_best_set_that_may_be_noise_are_less_sure() -> None:
    """Of a class with two members, the one that is needed beyond noise stands for it."""
    best = frozenset("abc")
    chances = Classes(
        {"a": 0.99, "b": 0.98, "c": 0.97, "d": 0.3},
        [("a", "b"), ("c", "d")],
        [0.99, 0.97],
        {"b": 0.9},
    )
    less = chances.at_most(best, {frozenset(): 0.1, frozenset("a"): 0.6, frozenset("ac"): 0.3})
    assert less.members == [("a", "b"), ("c", "d")]
    assert less.probability == pytest.approx([0.99, 0.7])
    assert less.effect == pytest.approx({"a": 0.1, "b": 0.98, "c": 0.7, "d": 0.3})
    assert less.of("b") == pytest.approx(0.99) and less.of("a") == pytest.approx(0.1)
    same = chances.at_most(best, {})
    assert (same.members, same.probability) == (chances.members, chances.probability)
    assert same.further == chances.further and same.effect == chances.effect
