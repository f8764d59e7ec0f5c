"""What would explain the data without a member of the best set: pairs that do what pairs do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.calibration.judgement.probability import probabilities
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, Gram, gram_of
from crosscheck.calibration.sets import challenge as module
from crosscheck.calibration.sets import refits
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.challenge import challenge, excluding, tried_equals
from crosscheck.calibration.sets.exact import Exact, Refit
from crosscheck.calibration.sets.linear_search import Names, Scores, explore
from crosscheck.calibration.sets.refits import (
    _beside_equals,
    containing,
    does_nothing,
    looked_about,
)
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import Term, Terms, effect_named, layout_of

NAMES = "abcdefgh"
WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])
NO_FIT: Any = None
PLAIN: Any = SimpleNamespace(terms=Terms())


class Linear(Exact):
    """Sets of a linear model: what is fitted is what the linear scores say."""

    def __init__(self, gram: Gram) -> None:
        self.scores = Scores(gram, len(NAMES))
        self.fitted = {}
        self.setting: Any = None
        self.longer = frozenset[str]()
        self.catalogue, self.plain = Catalogue(Terms(), Terms()), PLAIN
        self.fit(self.scores, frozenset())

    @property
    def possible(self) -> dict[Names, Refit]:
        return {names: refit for names, refit in self.fitted.items() if refit is not None}

    def size(self, name: str) -> int:
        return 2 if name in self.longer else 1

    def fit_all(self, scores: Scores, some: Iterable[Names]) -> list[Refit | None]:
        del scores
        fits = [Refit(names, NO_FIT, {}, self.scores.score(names)) for names in some]
        return [self.fitted.setdefault(refit.names, refit) for refit in fits]

    def scores_about(self, joint: Any) -> Scores:
        del joint
        return Scores(self.scores.gram, len(NAMES))


def gram(weights: Mapping[str, float], alike: bool = False) -> Gram:
    """Eight effects of a column each; together a and b do what c and d do together.

    Where others are alike, e and f do what a does, and g and h what b does.
    """
    rng = np.random.default_rng(3)
    x = rng.normal(size=(120, len(NAMES)))
    x[:, 3] = x[:, 0] + x[:, 1] - x[:, 2] + 0.01 * rng.normal(size=120)
    if alike:
        x[:, 4:] = x[:, [0, 0, 1, 1]] + 0.001 * rng.normal(size=(120, 4))
    y = rng.normal(size=120)
    for name, weight in weights.items():
        y = y + weight * x[:, NAMES.index(name)]
    groups = {n: ColumnGroup(np.array([k]), WIDTHS) for k, n in enumerate(NAMES)}
    return gram_of(x, y, groups)


def compared(some: Gram, best: Names) -> tuple[Linear, Refit]:
    """All sets one move away from the best fitted, as a search leaves them."""
    exact = Linear(some)
    scores = Scores(some, len(NAMES))
    explore(scores, [best])
    for names in scores.best(20, 12.0):
        exact.fit(scores, names)
    own = exact.fit(scores, best)
    assert own is not None
    return exact, own


def chance(exact: Linear, best: Refit, name: str) -> float:
    scores = {names: refit.score for names, refit in exact.possible.items()}
    return probabilities(scores, best.names, NAMES).of(name)


def test_two_that_do_what_two_others_do_are_not_sure() -> None:
    exact, best = compared(gram({"a": 2.0, "b": 2.0}), frozenset("ab"))
    assert chance(exact, best, "a") > 0.99
    challenge(exact, exact.scores, best)
    assert frozenset("cd") in exact.fitted
    assert 0.2 < chance(exact, best, "a") < 0.8
    assert 0.2 < chance(exact, best, "b") < 0.8


def test_an_effect_that_nothing_imitates_stays_sure_and_costs_few_fits() -> None:
    exact, best = compared(gram({"e": 2.0}), frozenset("e"))
    fitted = len(exact.fitted)
    challenge(exact, exact.scores, best)
    assert len(exact.fitted) <= fitted + 2
    assert chance(exact, best, "e") > 0.99


def test_equals_are_barred_with_the_member_in_whose_place_they_can_stand(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else the best sets without a are those with its equals, and nothing is learnt."""
    monkeypatch.setattr(module, "_NEIGHBOURS", 0)
    exact, best = compared(gram({"a": 2.0, "b": 2.0}, alike=True), frozenset("ab"))
    challenge(exact, exact.scores, best)
    assert frozenset("cd") in exact.fitted


def test_an_equal_may_cost_what_its_further_parameter_does() -> None:
    """The classes that are printed have it so: with one rule, both bar the same."""
    exact = Linear(gram({"a": 2.0}))
    scores = {"a": 0.0, "c": -2.0, "e": -5.0, "f": -5.0}
    for name, score in scores.items():
        names = frozenset(name)
        exact.fitted[names] = Refit(names, NO_FIT, {}, score)
    exact.longer = frozenset("e")
    best = exact.fitted[frozenset("a")]
    assert best is not None
    assert tried_equals(exact, best, "a") == frozenset("ace")


def test_large_sets_are_not_challenged(monkeypatch: pytest.MonkeyPatch) -> None:
    exact, best = compared(gram(dict.fromkeys("abef", 2.0)), frozenset("abef"))
    monkeypatch.setattr(exact, "fit_all", pytest.fail)
    challenge(exact, exact.scores, best)


def test_what_is_barred_is_in_no_set() -> None:
    scores = excluding(Scores(gram({"a": 2.0}), len(NAMES)), frozenset("ac"))
    explore(scores, [frozenset(), frozenset("b")])
    assert not any(names & frozenset("ac") for names in scores.best(50, 1e9))


def test_beside_a_large_set_others_are_fitted_before_its_members_are_sure() -> None:
    """A search may end with a set that was chosen about another one."""
    exact = Linear(gram(dict.fromkeys("abefgh", 2.0)))
    begun = exact.fit(exact.scores, frozenset("abcefgh"))
    assert begun is not None
    scores, best = looked_about(exact, exact.scores, begun)
    assert best.score > begun.score
    assert best.names in (frozenset("abefgh"), frozenset("cdefgh"))
    assert scores.score(best.names) == best.score
    assert frozenset("abdefgh") in exact.fitted  # d does with a and b what c does


def test_beside_a_set_that_nothing_equals_nothing_is_fitted() -> None:
    exact = Linear(gram({"a": 2.0}))
    best = exact.fit(exact.scores, frozenset("a"))
    assert best is not None
    fitted = set(exact.fitted)
    assert looked_about(exact, exact.scores, best)[1] is best
    assert set(exact.fitted) == fitted


def test_who_stands_in_a_members_place_is_fitted_whatever_larger_sets_there_are() -> None:
    """A cable behind the exit point was sure where a frame that yields explained as well."""
    exact = Linear(gram({"a": 2.0, "b": 2.0}, alike=True))
    best = exact.fit(exact.scores, frozenset("ab"))
    assert best is not None
    _scores, best = looked_about(exact, exact.scores, best)
    assert {frozenset("be"), frozenset("bf"), frozenset("ag"), frozenset("ah")} <= {*exact.fitted}
    found = probabilities({n: r.score for n, r in exact.possible.items()}, best.names, NAMES)
    assert set(next(c for c in found.members if "a" in c)) == set("aef")
    assert found.effect["a"] < 0.7 and found.of("a") > 0.99


@pytest.mark.parametrize("lost, again", [(30.0, True), (3.0, False)])
def test_a_part_of_the_best_set_begins_at_its_values_if_far_more_is_promised(
    monkeypatch: pytest.MonkeyPatch, lost: float, again: bool
) -> None:
    """Creep was fitted from a time that it does not have, and a tilt of gravity made up for it."""
    exact, begun = Linear(gram({"a": 2.0})), list[list[str]]()
    both: Any = Terms([SimpleNamespace(name="a"), SimpleNamespace(name="b")])  # type: ignore[list-item]
    joint: Any = SimpleNamespace(terms=both)
    part, whole = frozenset("a"), frozenset("ab")
    promised = exact.scores.score(part)
    found = Refit(part, NO_FIT, {}, promised)
    exact.fitted[whole] = Refit(whole, joint, {}, exact.scores.score(whole))
    exact.fitted[part] = Refit(part, NO_FIT, {}, promised - lost)

    def take(_scores: Scores, *starts: Terms) -> None:
        for start in starts:
            begun.append([term.name for term in start])
            exact.fitted[part] = found

    monkeypatch.setattr(exact, "take", take)
    monkeypatch.setattr(refits, "containing", lambda _exact, _best: [])
    _scores, best = looked_about(exact, exact.scores, exact.possible[whole])
    assert begun == ([["a"]] if again else [])
    assert (best is found) is again


def test_what_contains_a_member_and_joins_late_is_fitted_too() -> None:
    """Of friction the cable behind the exit point was told, and of both friction never."""
    exact = Linear(gram({"a": 2.0}))
    rubs = layout_of(effect_named("exit_friction"), load_robot(model_path("demobot_cogiro")))
    exact.catalogue = Catalogue(Terms(), Terms([Term(rubs, rubs.null)]))
    scores = {"a": 0.0, "winch_side_length": -2.0, "b": -9.0}
    for name, score in scores.items():
        exact.fitted[frozenset({name})] = Refit(frozenset({name}), NO_FIT, {}, score)
    exact.fitted[frozenset({"b", "winch_side_length"})] = Refit(
        frozenset({"b", "winch_side_length"}), NO_FIT, {}, -0.5
    )
    best = exact.fitted[frozenset("a")]
    assert best is not None
    assert containing(exact, best) == [frozenset({"exit_friction"})]
    exact.plain = SimpleNamespace(terms=SimpleNamespace(names=("winch_side_length",)))
    assert containing(exact, best) == []


def test_looking_about_fits_what_contains_a_member(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = Linear(gram({"a": 2.0}))
    best = exact.fit(exact.scores, frozenset("a"))
    assert best is not None
    monkeypatch.setattr(refits, "containing", lambda _exact, _best: [frozenset("g")])
    looked_about(exact, exact.scores, best)
    assert frozenset("g") in exact.fitted


def fitted_to(*values: float) -> Any:
    """A joint fit of a and b with these values; a plausible size of each moves one reading by 1."""
    terms: Any = SimpleNamespace(own=lambda name: np.array([name == "a", name == "b"]))
    return SimpleNamespace(
        terms=terms, jacobian=np.eye(3)[:, :2], z=np.array(values), whitened=lambda _c, v: v
    )


def test_a_member_that_moves_nothing_is_known_by_its_values() -> None:
    setting: Any = SimpleNamespace(chain=None)
    best = Refit(frozenset("ab"), fitted_to(30.0, 0.1), {}, 0.0)
    assert does_nothing(setting, best, "b") and not does_nothing(setting, best, "a")


def test_what_is_left_without_such_a_member_starts_where_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The set without it had ended in a hollow, so that any third effect seemed to be needed."""
    exact = Linear(gram({"a": 2.0}))
    joint: Any = SimpleNamespace(terms=SimpleNamespace(only=frozenset))
    best = Refit(frozenset("ae"), joint, {}, 0.0)
    exact.fitted |= {best.names: best, frozenset("a"): Refit(frozenset("a"), NO_FIT, {}, -30.0)}
    taken: list[Names] = []

    def take(_scores: Scores, *starts: Names) -> None:
        for start in starts:
            taken.append(start)
            exact.fitted[start] = Refit(start, NO_FIT, {}, 2.0)

    monkeypatch.setattr(exact, "take", take)
    monkeypatch.setattr(
        refits, "does_nothing", lambda _setting, found, name: found is best and name == "e"
    )
    assert refits._thinned(exact, exact.scores, best).names == frozenset("a")
    assert taken == [frozenset("a")]


@pytest.mark.parametrize("size", [6, 8, 9])
def test_sets_of_up_to_eight_are_fitted_without_each_member(
    monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """A cable behind the winches held six together, where four explained more by other values."""
    exact, letters = Linear(gram({"a": 2.0})), "abcdefghi"[:size]
    monkeypatch.setattr(refits, "does_nothing", lambda _setting, _found, _name: False)
    best = Refit(frozenset(letters), NO_FIT, {}, 0.0)
    exact.fitted[best.names] = best
    for k in range(len(letters)):
        less = best.names - {letters[k]}
        exact.fitted[less] = Refit(less, NO_FIT, {}, 18.0 if k == 2 else -30.0)
    monkeypatch.setattr(exact, "fit", lambda _scores, names: exact.fitted.get(names))
    found = refits._thinned(exact, exact.scores, best).names
    assert found == (best.names - {"c"} if size <= 8 else best.names)


def test_sets_two_exchanges_away_are_fitted_if_one_is_only_possible_after_the_other() -> None:
    """A frame that yields and another target did what exit points and the winch's side did."""
    linear = {"ab": 0.0, "cb": -0.5, "ad": -1.0, "eb": -15.0, "ed": -1.1, "cd": -1.5, "ef": -9.0}
    table = {frozenset(names): score for names, score in linear.items()}

    def neighbours(names: Names) -> dict[Names, float]:
        return {other: score for other, score in table.items() if len(other - names) == 1}

    fitted = {names: SimpleNamespace(names=names, score=table[names]) for names in table}
    for names in (frozenset("ed"), frozenset("cd"), frozenset("ef")):
        del fitted[names]
    exact: Any = SimpleNamespace(possible=fitted, fitted=fitted, size=lambda _name: 1)
    scores: Any = SimpleNamespace(score=table.__getitem__, neighbours=neighbours)
    # not what only has members of sets that explain as well: c, or d, in place of a, or b
    assert _beside_equals(exact, scores, fitted[frozenset("ab")]) == [frozenset("ed")]
    fitted[frozenset("ed")] = SimpleNamespace(names=frozenset("ed"), score=-1.1)
    assert frozenset("ed") not in _beside_equals(exact, scores, fitted[frozenset("ab")])
