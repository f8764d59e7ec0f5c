"""Probabilities of effects and of classes of equals, as a diagnosis says them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import made_diagnoses
import numpy as np
import pytest
from made_data import COGIRO, measured, term

from crosscheck.calibration.joint_fit.all_effects import JointErrors
from crosscheck.calibration.judgement.probability import probabilities
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, gram_of
from crosscheck.calibration.sets.linear_search import Scores, explore
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis import nearby
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.nearby import _better_without, _impossible, _refitted, chances_near
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.stepwise import by_steps
from crosscheck.fit.effects.candidates import null_fit
from crosscheck.fit.least_squares.problem import Rms
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.fit.reasons import Reason, Why, probability_words
from crosscheck.given import considered
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

RMS: Rms = {"position_rms_m": 1e-3, "orientation_rms_rad": None, "tension_rms_N": None}


def chances_of(found: Diagnosis) -> Chances:
    assert found.chances is not None
    return found.chances


def test_what_is_found_is_probable_and_nothing_else_is() -> None:
    chances = chances_of(made_diagnoses.pulleys())
    assert chances.of("pulley_radius") > 0.99
    assert made_diagnoses.pulleys().missing[0].probability == chances.of("pulley_radius")
    others = [p for name, p in chances.effect.items() if name != "pulley_radius"]
    assert max(others) < 0.3


def test_where_nothing_is_missing_nothing_is_probable() -> None:
    assert max(chances_of(made_diagnoses.nothing()).effect.values()) < 0.3


def test_the_json_names_each_effect_once_with_its_class() -> None:
    document = made_diagnoses.pulleys().as_json()
    names = [row["effect"] for row in document["catalogue"]]
    assert len(names) == len(set(names)) > 10
    for row in document["catalogue"]:
        assert row["effect"] in document["classes"][row["class"]]["members"]
    assert document["missing"][0]["probability"] > 0.99
    assert "calibrated" not in document  # the steps ended with noise


@pytest.mark.slow
def test_where_something_is_unknown_the_joint_fit_is_told() -> None:
    document = made_diagnoses.unknown().as_json()
    assert document["calibrated"]["before"] == document["before"]
    assert set(document["calibrated"]["held_out"]) == set(document["before"])


def test_a_class_has_the_probability_of_all_its_members() -> None:
    together = JointErrors(RMS, RMS, RMS, {"position": 1.0}, {"position": 0.0})
    chances = Chances(
        {"a": 0.5, "b": 0.45, "c": 0.1}, ((("a", "b"), 0.95), (("c",), 0.1)), -3.0, together
    )
    assert chances.of("b") == 0.95
    assert chances.of("nobody") == 0.0
    assert chances.as_json()["unknown"] == {"log_odds": -3.0, "shown_from": None}
    assert chances.looks_like == ""
    seen = replace(chances, varies=(Varying.LAG, Varying.SESSION))
    assert seen.looks_like == f" It looks like {Varying.LAG} or {Varying.SESSION}."
    there = seen.as_json()["unknown"]
    assert (there["seen_in"], there["or_in"]) == (Varying.LAG, [Varying.SESSION])


@pytest.mark.parametrize(("p", "words"), [(0.999, "> 99 %"), (0.001, "< 1 %"), (0.5, "50 %")])
def test_probabilities_in_words(p: float, words: str) -> None:
    assert probability_words(p) == words


def test_sets_that_were_fitted_count_with_their_own_evidence() -> None:
    """The last model is a and b; c was tried in b's place, by two ways, and d in vain."""
    last = frozenset("ab")
    scores: Any = SimpleNamespace(
        score=lambda names: 40.0 if names == last else -1e9,
        log_prior=lambda names: -3.0 * len(names),
    )
    fits = {"c": 8.0, "worse c": 7.0, "d": 99.0, "again": 50.0}
    tried = {
        (frozenset("a"), "c"): fit_of(fits["c"]),
        (frozenset("c"), "a"): fit_of(fits["worse c"]),
        (frozenset("a"), "d"): fit_of(fits["d"], valid=False),
        (frozenset("a"), "b"): fit_of(fits["again"]),
    }
    found: Any = SimpleNamespace(
        last=SimpleNamespace(evidence=SimpleNamespace(log=10.0)),
        fits=tried,
        trials=SimpleNamespace(evidence=lambda fit: SimpleNamespace(log=fit.log)),
    )
    # the last model's 40 is of evidence 10 and of two effects: two less evidence is two less
    assert _refitted(found, scores, last) == {frozenset("ac"): pytest.approx(38.0)}


def fit_of(log: float, valid: bool = True) -> Any:
    return SimpleNamespace(log=log, valid=valid)


def test_what_no_robot_can_have_wherever_it_was_fitted_is_out_of_the_question() -> None:
    def tried(**why: Why | None) -> SimpleNamespace:
        rows = [
            SimpleNamespace(
                layout=SimpleNamespace(name=name), why_not=None if no is None else Reason(no)
            )
            for name, no in why.items()
        ]
        return SimpleNamespace(
            candidates=rows, fit=SimpleNamespace(terms=SimpleNamespace(names=("mass",)))
        )

    no = Why.IMPOSSIBLE
    steps = [tried(law=no, tilt=no, creep=Why.UNSEEN, mass=no), tried(law=no, tilt=None)]
    found: Any = SimpleNamespace(steps=steps, last=steps[-1])
    # a tilt is possible beside the mass, and the mass is in the model
    assert _impossible(found) == {"law"}


def test_what_two_do_together_one_of_many_parameters_is_not_sure_of() -> None:
    """A heavier platform off its centre was once a force and moment, for certain."""
    rng = np.random.default_rng(5)
    two, rest = rng.normal(size=(200, 2)), rng.normal(size=(200, 4))
    near = two + 1e-3 * rng.normal(size=(200, 2))
    columns = {"mass": two[:, :1], "centre": two[:, 1:], "wrench": np.hstack([near, rest])}
    ends = np.cumsum([0, 1, 1, 6])
    groups = {
        name: ColumnGroup(np.arange(*ends[k : k + 2]), np.array([0.1, 0.3, 1.0, 3.0, 10.0]))
        for k, name in enumerate(columns)
    }
    read = two @ [2.0, 2.0] + rng.normal(size=200)
    scores = Scores(gram_of(np.hstack(list(columns.values())), read, groups), 25)
    found = frozenset({"wrench"})
    explore(scores, [frozenset(), found])
    assert probabilities(scores.every, found, list(columns)).of("wrench") > 0.97
    every = scores.every | _better_without(scores, found, found)
    assert frozenset({"mass", "centre"}) in every
    assert probabilities(every, found, list(columns)).of("wrench") < 0.1
    # and what explains less than the members do is no doubt about them
    assert _better_without(scores, frozenset({"mass", "centre"}), {"mass"}) == {}


@pytest.mark.slow
def test_effects_out_of_the_question_have_no_part_in_the_probabilities(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = load_robot(COGIRO)
    data = measured(robot, [term(robot, "stiffness", factor=1.4)], points=6)
    few = considered(["stiffness", "platform_mass", "gravity_tilt", "tracker_frame"])
    problem = prepare(robot, data, Terms(), few).problem
    factor = problem.noise(problem.experiment.predict(()))
    base = null_fit(problem, Terms(), factor, refit=False)
    found, _notes = by_steps(problem, base, factor, lambda _text, _part: None)
    assert chances_near(found, {}).of("platform_mass") > 0.01
    monkeypatch.setattr(nearby, "_impossible", lambda _found: frozenset({"platform_mass"}))
    assert chances_near(found, {}).of("platform_mass") == 0.0
