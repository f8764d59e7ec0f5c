"""Probabilities and words from scores that are given set by set: each follows by enumeration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, measured

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import DiagnosisVerdict
from crosscheck.inference.catalogue import Key, is_field
from crosscheck.inference.noise import STATED_NOISE, Noise
from crosscheck.inference.posterior import Classes, Posterior
from crosscheck.inference.priors import EQUAL, FEW, SURE
from crosscheck.inference.verdict import Judgement, judged
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms, layout_of

ROBOT = load_robot(COGIRO)
# Of one parameter each, so that an exchange may cost EQUAL.
A, B, C, D = "pulley_radius", "stiffness", "platform_mass", "length_scale"
SCALES, FRICTION = ("tension_scale", "tracker_scale"), "exit_friction"
FRAME, EXITS = "frame_compliance", "exit_point_error"  # of 2 and of 24
NONE: Key = frozenset()
SLOW = Noise(np.array([3.5, 1.0, 1.0]), np.array([0.96, 0.0, 0.0]))


def some(*keys: str) -> Key:
    return frozenset(keys)


@cache
def problem() -> Problem:
    data = replace(measured(ROBOT, points=3), sigma=Sigma(1e-3, 1e-3), sigma_source="stated")
    return Problem(ROBOT, data, Sigma(1e-3, 1e-3), np.ones(data.n_rows, dtype=bool))


def search_of(
    scores: Mapping[Key, float], noise: Mapping[Key, Noise] | None = None,
    near: Mapping[Key, float] | None = None, stood: Key = NONE, sizes: float = 1.0,
    rivals: float = 100.0, needed: float = 100.0,
) -> Any:  # fmt: skip
    """What a posterior asks of a search, with these scores; all else is far worse by ``rivals``."""
    names = (A, B, C, D, FRAME, EXITS, FRICTION, *SCALES)
    members = {n: SimpleNamespace(layout=layout_of(n, ROBOT), key=n) for n in names}

    def fitted(key: Key, score: float) -> Any:
        terms = Terms(
            Term(m.layout, m.layout.null + sizes * m.layout.scale) for n, m in members.items()
            if n in key
        )  # fmt: skip
        fit = SimpleNamespace(noise=(noise or {}).get(key, STATED_NOISE), terms=terms)
        field = next(filter(is_field, key), None)
        return SimpleNamespace(key=key, score=score, fit=fit, field=field, widths={})

    every = SimpleNamespace(members=members, keys_of=lambda terms: {t.name: t.name for t in terms})
    found = {key: fitted(key, score) for key, score in scores.items()}
    best = max(found.values(), key=lambda one: one.score)
    return SimpleNamespace(
        data=SimpleNamespace(problem=problem()), every=every, stood=stood, fitted=found, best=best,
        cache=found, near=near or {}, last=SimpleNamespace(centre=best, score=lambda _key: 50.0),
        challenge=lambda _some: rivals, needed=lambda _some: needed,
    )  # fmt: skip


def of(scores: Mapping[Key, float], **given: Any) -> Posterior:
    return Posterior.of(search_of(scores, **given))


def chance(scores: Mapping[Key, float], *keys: str, least: int = 1) -> float:
    """Of the sets that hold some of these, by enumeration."""
    every = {k: np.exp(s) for k, s in scores.items()}
    return float(sum(p for k, p in every.items() if len(k & set(keys)) >= least)) / sum(
        every.values()
    )


def classes(scores: Mapping[Key, float], **given: Any) -> dict[frozenset[str], float]:
    """The classes of more than one member, or of the best set."""
    known = of(scores, **given).known
    return {frozenset(c): p for c, p in known.classes if len(c) > 1 or set(c) & known.best}


# --- members, fields, something unknown -----------------------------------------------------------

MIXED = {
    NONE: -9.0, some(A): 0.0, some(B): -2.0, some(A, B): -1.0, some(A, C): -4.0, some("~0"): -3.0,
    some(A, "~0"): -1.5, some(A, "~1"): -2.5,
}  # fmt: skip


def test_each_probability_is_a_sum_over_sets() -> None:
    found = of(MIXED)
    for name in (A, B, C, D):
        assert found.known.member[name] == pytest.approx(chance(MIXED, name))
    assert found.unknown == pytest.approx(chance(MIXED, "~0", "~1"))
    assert dict(found.fields) == pytest.approx({k: chance(MIXED, k) for k in ("~0", "~1")})
    assert list(found.fields) == ["~0", "~1"], "the likeliest first"
    assert found.none == pytest.approx(np.exp(-9.0) / sum(map(np.exp, MIXED.values())))
    beside = {k: s for k, s in MIXED.items() if k & {"~0", "~1"}}
    assert found.beside is not None
    for name in (A, B):
        assert found.beside.member[name] == pytest.approx(chance(beside, name))


def test_without_a_field_and_with_noise_as_stated_nothing_is_unknown() -> None:
    found = of({NONE: 0.0, some(A): 5.0})
    assert found.unknown == 0.0 and found.beside is None and not found.fields


def test_noise_that_is_loud_and_slow_is_unknown_in_its_sets() -> None:
    """Each counts by its own noise: a set that leaves noise as stated has nothing unknown."""
    scores = {NONE: 0.0, some(A): 1.0, some(B): 0.5}
    from crosscheck.inference.noise import NoisePrior

    p = NoisePrior.of(problem()).is_unknown(SLOW)
    assert 0.5 < p < 0.99
    found = of(scores, noise={NONE: SLOW, some(B): SLOW})
    share = {k: np.exp(s) / sum(map(np.exp, scores.values())) for k, s in scores.items()}
    assert found.unknown == pytest.approx((share[NONE] + share[some(B)]) * p)
    assert found.none == pytest.approx(share[NONE] * (1.0 - p))
    assert found.beside is not None
    assert found.beside.member[B] == pytest.approx(chance({NONE: 0.0, some(B): 0.5}, B))
    assert found.beside.member[A] == 0.0
    mixed = {NONE: 0.0, some(B): 0.5, some(A, "~0"): 0.6}
    also = of(mixed, noise={NONE: SLOW, some(B): SLOW}).beside
    by = {NONE: p, some(B): p * np.exp(0.5), some(A): np.exp(0.6)}
    assert also is not None
    assert also.member[A] == pytest.approx(by[some(A)] / sum(by.values()))


def test_sets_that_were_not_fitted_count_by_the_linear_model_about_the_best() -> None:
    """None is better than the best; and only those with more, or no larger ones."""
    near = {some(A, B): 49.0, some(C): 53.0, some(B, C): 48.0, some(B): 47.0, some(A): 12.0}
    scores = {NONE: -9.0, some(A): 0.0, some(B): -6.0}
    met = scores | {some(A, B): -1.0, some(C): 0.0}
    for name in (A, B, C):
        assert of(scores, near=near).known.member[name] == pytest.approx(chance(met, name))
    elsewhere = search_of(scores, near=near)
    elsewhere.last.centre = SimpleNamespace(key=some(B))
    for name in (A, B, C):
        assert Posterior.of(elsewhere).known.member[name] == pytest.approx(chance(scores, name))


# --- classes --------------------------------------------------------------------------------------


def against(best: str, other: str, cost: float) -> dict[Key, float]:
    """Scores of an exchange that costs so much; sure without it, and no surer by it."""
    most = 1.0 + np.exp(2.0)
    return {NONE: np.log(0.02 * most), some(best): 0.0, some(best, C): 2.0, some(other): -cost}


@pytest.mark.parametrize(("part", "alike"), [(0.98, True), (1.02, False)])
def test_effects_that_can_be_exchanged_at_little_cost_are_one_class(
    part: float, alike: bool
) -> None:
    scores = against(A, B, part * EQUAL)
    expected = (A, B) if alike else (A,)
    assert classes(scores) == {some(*expected): pytest.approx(chance(scores, *expected))}


@pytest.mark.parametrize(
    ("best", "other", "part", "alike"),
    [
        (D, FRAME, 1.02, True), (D, FRAME, 1.98, True), (D, FRAME, 2.02, False),
        (D, EXITS, 1.02, False), (D, FRICTION, 1.02, False), (FRICTION, FRAME, 1.98, True),
        (FRAME, D, 0.98, True), (FRAME, D, 1.02, False),
    ],
)  # fmt: skip
def test_a_small_effect_with_one_parameter_more_may_cost_as_much_again(
    best: str, other: str, part: float, alike: bool
) -> None:
    """Neither a large effect may, nor one with fewer, nor what only extends another."""
    assert [len(layout_of(n, ROBOT)) for n in (D, FRAME, EXITS, FRICTION)] == [1, 2, 24, 2]
    assert set(classes(against(best, other, part * EQUAL))) == {
        some(best, other) if alike else some(best)
    }


def test_pairs_that_are_the_one_further_difference_of_two_sets_are_alike() -> None:
    """A goes for C by itself; of A + B and C + D the rest is B for D."""
    scores = {NONE: -80.0, some(A, B): 0.0, some(C, B): -1.0, some(C, D): -2.0}
    assert set(classes(scores)) == {some(A, C), some(B, D)}
    # nothing is known of either exchange alone
    pairs = {NONE: -80.0, some(A, B): 0.0, some(C, D): -2.0}
    assert set(classes(pairs)) == {some(A), some(B)}
    # three for three, one known
    more = {NONE: -80.0, some(A, B): 0.0, some(C, B): -1.0, some(C, D): -EQUAL - 0.1}
    assert some(B, D) not in set(classes(more))


def test_sets_of_other_numbers_are_no_exchange() -> None:
    scores = {NONE: -60.0, some(A): 0.0, some(B, C): -0.5, some(A, D): -1.0}
    assert set(classes(scores)) == {some(A)}


def test_another_form_of_what_stands_is_no_exchange() -> None:
    scores = {some(D): -60.0, some(A, D): 0.0, some(A, f"{D}@file"): -0.5}
    assert set(classes(scores, stood=some(D))) == {some(A)}


def test_what_is_alike_with_another_needed_member_stands_for_none_else() -> None:
    """B does what D does, and a little of what A does: A's class does not take D."""
    scores = {NONE: -60.0, some(A, D): 0.0, some(A, B): -1.0, some(B, D): -1.04 * EQUAL}
    assert set(classes(scores)) == {some(A), some(B, D)}


def test_members_of_the_best_set_are_named_first_and_the_others_by_probability() -> None:
    assert (B, A) in [c for c, _p in of(against(B, A, 0.5)).known.classes]
    scores = {NONE: np.log(0.001), some(A): np.log(0.96), some(B): np.log(0.009)}
    scores |= {some(D): np.log(0.012), some(C): np.log(0.018)}
    assert of(scores).known.classes[0][0] == (A, C, D)


def test_of_a_class_with_two_needed_members_the_second_has_its_own_probability() -> None:
    scores = {NONE: -90.0, some(A, B): 0.0, some(A, C): -0.5, some(B, C): -0.6, some(A): -4.0,
              some(B): -5.0, some(C): -20.0}  # fmt: skip
    found = of(scores).known
    assert set(map(frozenset, (c for c, _p in found.classes))) >= {some(A, B, C)}
    # without A the best set explains less than without B: A is the most needed
    assert found.further == pytest.approx({B: chance(scores, A, B, C, least=2)})
    unmet = {k: s for k, s in scores.items() if k != some(B)}
    assert list(of(unmet).known.further) == [B], "nobody knows how little is left without A"
    assert found.of(B) == found.further[B] and found.of(A) == pytest.approx(chance(scores, A, B, C))


def test_a_likely_exchange_joins_until_it_is_sure() -> None:
    """A is 0.80, and C in its place equal; with B none of a hundred is a false alarm."""
    p = {some(A, D): 0.80, some(B, D): 0.03, some(C, D): 0.165, some(D): 0.004, NONE: 0.001}
    found = classes({k: float(np.log(v)) for k, v in p.items()})
    assert found[some(A, B, C)] == pytest.approx(0.995) and found[some(D)] == pytest.approx(0.999)


def test_one_that_is_not_enough_does_not_join() -> None:
    p = {some(A, D): 0.90, some(B, D): 0.03, some(D): 0.04, NONE: 0.03}
    found = classes({k: float(np.log(v)) for k, v in p.items()})
    assert some(A) in found and some(A, B) not in found


@pytest.mark.parametrize(
    ("alone", "each", "joined"),
    [(0.93, 0.0112, 2), (0.93, 0.0056, 4), (0.928, 0.0045, 0), (0.96, 0.008, 4), (0.96, 0.007, 0)],
)
def test_few_join_at_most(alone: float, each: float, joined: int) -> None:
    """As many as make it sure, or then no false alarm, and are FEW with the first."""
    others = (B, C, D, *SCALES)
    scores = {some(A): np.log(alone)}
    scores |= {some(k): np.log(each - 1e-6 * n) for n, k in enumerate(others)}
    scores[NONE] = np.log(1.0 - sum(map(np.exp, scores.values())))
    assert joined < FEW and some(A, *others[:joined]) in classes(scores)


def test_classes_that_were_taken_into_a_larger_one_are_not_listed_again() -> None:
    """B and C are one class by their exchange in another set, and join A's together."""
    scores = {some(A): 0.0, some(B): -1.02 * EQUAL, some(C): -1.03 * EQUAL, NONE: -60.0}
    found = of(scores).known
    listed = [set(c) for c, _p in found.classes if set(c) & {A, B, C}]
    assert listed == [{A, B, C}]
    assert found.classes[0][0][0] == A, "the best set's first"
    assert found.of(B) == found.of(A) == pytest.approx(1.0)
    assert set(found.alike(C)) == {A, B, C} and found.alike("unheard") == ("unheard",)
    assert found.of("unheard") == 0.0


@pytest.mark.parametrize(("worth", "best"), [(0.98, some(A)), (1.02, some(A, B))])
def test_the_best_set_has_no_member_that_is_worth_nothing(worth: float, best: Key) -> None:
    scores = {NONE: -60.0, some(A): -worth * EQUAL, some(A, B): 0.0, some(B): -60.0}
    assert of(scores).known.best == best


def test_nothing_is_the_best_only_where_that_is_not_excluded() -> None:
    assert of({NONE: -2.0, some(A): 0.0}).known.best == NONE
    many = {NONE: -2.9, some(A): 0.0, some(B): -0.1, some(C): -0.1}
    assert np.exp(-2.9) / sum(map(np.exp, many.values())) < 1.0 - SURE
    assert of(many).known.best == some(A)
    stood = some(D)
    beside = {stood: -2.0, some(A, D): 0.0}
    assert of(beside, stood=stood).known.best == stood


def test_sure_members_are_the_most_probable_first_and_open_ones_are_counted() -> None:
    given = ((("a",), 0.96), (("b", "c"), 0.99), (("d",), 0.7), (("e",), 0.04), (("f",), 0.06))
    found = Classes(frozenset("abd"), {}, given, {"g": 0.2, "h": 0.96})
    assert found.sure(NONE) == ["b", "a"] and found.sure(frozenset("b")) == ["a"]
    assert found.open == pytest.approx(0.3 + 0.06 + 0.2)


# --- the word -------------------------------------------------------------------------------------

FOUND, MANY = DiagnosisVerdict.EFFECTS_FOUND, DiagnosisVerdict.MANY_EFFECTS
ALONE = {NONE: -40.0, some(A): 0.0, some(A, B): -6.0}


def word(scores: Mapping[Key, float], **given: Any) -> Judgement:
    return judged(search_of(scores, **given))


def test_a_sure_effect_is_found_and_nothing_is_missing_where_that_is_not_excluded() -> None:
    said = word(ALONE)
    assert said.verdict is FOUND and said.sure == (A,) and not said.implausible
    few = word({NONE: 0.0, some(A): 2.0, some(B): 1.9, some(C): -9.0})
    assert few.verdict is DiagnosisVerdict.NO_EFFECT_MISSING and few.sure == ()


def test_nothing_is_named_where_something_unknown_may_be() -> None:
    for p, verdict in ((0.2, FOUND), (0.3, MANY)):
        scores = {NONE: -40.0, some(A): np.log(1 - p), some(A, "~0"): np.log(p)}
        said = word(scores)
        assert said.verdict is verdict and said.sure == ((A,) if verdict is FOUND else ())


def test_an_effect_larger_than_any_is_is_not_named() -> None:
    for sizes, verdict in ((49.0, FOUND), (51.0, MANY)):
        said = word(ALONE, sizes=sizes)
        assert said.verdict is verdict
        assert said.implausible == (() if verdict is FOUND else (A,))
        assert said.sure == ((A,) if verdict is FOUND else ())


def test_of_many_effects_those_without_a_rival_are_named() -> None:
    """C or D may be missing, too, or neither: one class is open, and more than OPEN are."""
    scores = {NONE: -90.0}
    for c in (NONE, some(C)):
        for d in (NONE, some(D)):
            for b in (NONE, some(B)):
                scores[some(A) | b | c | d] = float(len(c | d | b)) * 0.01
    assert word(scores).verdict is MANY
    assert word(scores).sure == (A,)
    assert word(scores, rivals=11.0).sure == () and word(scores, needed=11.0).sure == ()


@pytest.mark.parametrize(("unknown", "asked"), [(0.2, True), (0.3, False)])
def test_rivals_of_what_would_be_named_are_fitted_first(unknown: float, asked: bool) -> None:
    """One that was not met does as well: then both are named as one."""
    known = np.log(1.0 - unknown)
    search = search_of({NONE: -40.0, some(A): known, some(A, "~0"): np.log(unknown)})
    rival = search_of({NONE: -40.0, some(B): known - 1.0}).fitted[some(B)]

    def challenge(alike: tuple[str, ...]) -> float:
        assert A in alike
        search.cache[some(B)] = rival  # the same mapping as what is fitted
        return 1.0

    search.challenge = challenge
    assert set(judged(search).classes.alike(A)) == ({A, B} if asked else {A})


def test_beside_something_unknown_is_named_what_every_field_leaves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "crosscheck.inference.verdict.is_beyond_fields", lambda _search, _best, key: key != B
    )
    scores = {NONE: -90.0, some("~0"): -80.0, some(A, B, "~0"): 0.0, some(A, B): -30.0}
    said = word(scores)
    assert said.verdict is DiagnosisVerdict.UNKNOWN_EFFECT and said.sure == (A,)
    assert said.classes is said.posterior.beside
    every = (A, C, D, FRAME, EXITS, B)
    for count, named in ((5, 5), (6, 0)):
        assert len(word({NONE: -90.0, some(*every[:count], "~0"): 0.0}).sure) == named
