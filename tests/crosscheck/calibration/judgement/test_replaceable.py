"""Whether others together explain as much without an effect that seems sure."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.calibration.judgement.probability import Classes, probabilities
from crosscheck.calibration.judgement.replaceable import Replaced
from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, Gram, gram_of
from crosscheck.calibration.sets.exact import Refit
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.calibration.sets.refits import ComparedSets
from crosscheck.fit.reasons import DiagnosisVerdict

NAMES = "abcdefgh"
WIDTHS = np.array([0.1, 0.3, 1.0, 3.0, 10.0])
NO_FIT: Any = None


def gram(equal: bool = False) -> Gram:
    """What a does with three numbers, b, c and d do together; or b alone, if these are equals."""
    rng = np.random.default_rng(7)
    x = rng.normal(size=(200, 3 + len(NAMES) - 1))
    x[:, 3:6] = x[:, :3] + 0.001 * rng.normal(size=(200, 3))
    groups = {"a": ColumnGroup(np.arange(3), WIDTHS)}
    for k, name in enumerate(NAMES[1:]):
        groups[name] = ColumnGroup(np.array([3 + k]), WIDTHS)
    if equal:
        groups["a"] = ColumnGroup(np.array([0]), WIDTHS)
    z = np.array([3.0, *(2 * [0.0 if equal else 3.0]), 0.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0])
    return gram_of(x, x @ z + rng.normal(size=200), groups)


def compared(some: Gram, best: str) -> ComparedSets:
    scores = Scores(some, len(NAMES))

    def fit(names: Names) -> Refit:
        return Refit(names, NO_FIT, {}, scores.score(names))

    refits = {names: fit(names) for names in (frozenset[str](), frozenset(best))}
    return ComparedSets(refits, refits[frozenset(best)], scores, fit)


def tried(found: ComparedSets, sure: str) -> tuple[Replaced, Classes]:
    def classes() -> Classes:
        scores = {names: refit.score for names, refit in found.refits.items()} | some.scores
        return probabilities(scores, found.best.names, NAMES)

    some = Replaced(found, lambda name: 3 if name == "a" else 1, lambda _refit: True)
    some.try_without(sure, classes())
    return some, classes()


def test_what_others_do_together_with_more_effects_is_not_sure() -> None:
    found = compared(gram(), "aef")
    some, _classes = tried(found, "aef")
    assert some.scores[frozenset("bcdef")] > found.best.score - 12.5
    assert some.replaceable == {"a"}


def test_what_an_equal_does_is_sure_and_the_equal_is_known() -> None:
    found = compared(gram(equal=True), "aef")
    some, classes = tried(found, "aef")
    assert ("a", "b") in classes.members
    assert some.replaceable == set()


def test_what_no_robot_can_have_replaces_nothing() -> None:
    found = compared(gram(), "aef")
    some = Replaced(found, lambda _name: 1, lambda refit: not {"b", "c", "d"} <= refit.names)
    some.try_without("a", probabilities({found.best.names: 0.0}, found.best.names, NAMES))
    assert some.replaceable == set()


def test_an_effect_that_others_can_replace_is_not_sure() -> None:
    said = Judgement(DiagnosisVerdict.MANY_EFFECTS, ("a", "b"), 0.3).replacing(frozenset({"a"}))
    assert (said.sure, said.replaceable) == (("b",), frozenset("a"))
