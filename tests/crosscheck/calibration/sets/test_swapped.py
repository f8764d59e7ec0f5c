"""Effects with a shape that the linear model has at another: they are fitted from their own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration.joint_fit.joining import Promising
from crosscheck.calibration.joint_fit.joint import Setting, cost, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.sets import refits
from crosscheck.calibration.sets.catalogue import Catalogue, gram_about
from crosscheck.calibration.sets.exact import Exact, Refit, scored
from crosscheck.calibration.sets.linear_search import Scores
from crosscheck.calibration.sets.refits import swapped
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import evaluate
from seecr.commands.data import Commands
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.prediction.experiment import Experiment

ROBOT = load_robot(COGIRO)
EXPANSION = 2e-4


def warmed() -> Problem:
    """A hall that warms up by ten degrees through the day."""
    data = measured(ROBOT, points=6)
    warmth = 20.0 + 10.0 * np.arange(data.n_rows) / data.n_rows
    rows = Commands(data.command_pose, run=data.run_index, time=data.t_s, temperature=warmth)
    hidden = term(ROBOT, "thermal_expansion", expansion_1_per_K=EXPANSION, zero_temperature_C=20.0)
    experiment = Experiment(ROBOT, rows)
    ahead, plain = experiment.predict([hidden.effect()]), experiment.predict()
    data = replace(
        data,
        temperature_C=warmth,
        position=data.position + ahead.readings.position - plain.readings.position,
    )
    return Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))


def test_a_swapped_effect_begins_at_the_shape_that_promises_most() -> None:
    problem = warmed()
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    creep = Terms([term(ROBOT, "creep", amount=0.05, time_s=1000.0)])
    # so far from every temperature it does what an offset does, and the sets hold it at nothing
    absurd = term(ROBOT, "thermal_expansion", zero_temperature_C=500.0)
    plain = evaluate(problem, Terms(), factor)
    joint = settle(setting, evaluate(problem, creep, factor), widths_of(creep), WHITE)
    fixed = replace(setting, weight=joint.weight)
    catalogue = Catalogue(Terms(), Terms([absurd, *creep]))
    exact = Exact(fixed, joint, catalogue, plain, lambda _text: None)
    scores = Scores(gram_about(fixed, joint, catalogue), 2, frozenset())
    start = exact.fit(scores, frozenset({"creep"}))
    assert start is not None
    best = swapped(exact, scores, start)
    assert best.names == {"thermal_expansion"}
    assert best.joint.terms["thermal_expansion"].vector == pytest.approx([EXPANSION, 20.0], rel=0.1)
    assert best.score > start.score + 90.0


def test_an_effect_that_the_linear_model_does_not_see_is_fitted() -> None:
    """It has no width there: hysteresis of cables that do not move, where the fit stands."""
    problem = warmed()
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    start = Terms([term(ROBOT, "thermal_expansion", expansion_1_per_K=1e-4)])
    plain = evaluate(problem, Terms(), factor)
    joint = settle(setting, evaluate(problem, start, factor), widths_of(start), WHITE, 0)
    exact = Exact(
        replace(setting, weight=joint.weight), joint, Catalogue(Terms(), start), plain, print
    )
    seen = gram_about(setting, joint, exact.catalogue)
    unseen = Scores(replace(seen, groups={}), 1, frozenset())
    exact.take(unseen, start)
    exact_too = replace(exact, fitted={})
    exact_too.take(Scores(seen, 1, frozenset()), start)
    names = frozenset(start.names)
    assert exact.possible[names].score == pytest.approx(exact_too.possible[names].score, abs=0.1)


def test_what_no_robot_can_have_does_not_take_the_place_of_what_one_can(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However well a platform of less than no mass explains the data."""
    problem = warmed()
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    heavy = Terms([term(ROBOT, "platform_mass", added_kg=0.5)])
    light = heavy.with_vector(np.array([-0.99 * ROBOT.mass]))
    plain = evaluate(problem, Terms(), factor)
    joint = settle(setting, evaluate(problem, heavy, factor), widths_of(heavy), WHITE)
    exact = Exact(setting, joint, Catalogue(Terms(), heavy), plain, lambda _text: None)
    scores = Scores(gram_about(setting, joint, exact.catalogue), 1, frozenset())
    names = frozenset(heavy.names)
    kept = exact.fit(scores, names)
    assert kept is not None
    impossible = replace(kept.joint, state=replace(kept.joint.state, terms=light))
    better = replace(kept, joint=impossible, score=kept.score + 10.0)
    monkeypatch.setattr(exact, "_from", lambda *_given: better)
    exact.take(scores, heavy)
    assert exact.possible == {names: kept}
    # and the other way about: what one can have takes the place, though it explains less
    exact.fitted[names] = better
    monkeypatch.setattr(exact, "_from", lambda *_given: kept)
    exact.take(scores, heavy)
    assert exact.possible == {names: kept}


@pytest.mark.parametrize("better", [True, False])
def test_what_other_widths_promise_is_looked_for_there(
    monkeypatch: pytest.MonkeyPatch, better: bool
) -> None:
    """Once, from where the fit ended; and the fit that explains more is kept."""
    problem = warmed()
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    moved = Terms([term(ROBOT, "tracker_target", shift_x_m=1e-4)])
    plain = evaluate(problem, Terms(), factor)
    joint = settle(setting, evaluate(problem, moved, factor), widths_of(moved), WHITE)
    exact = Exact(setting, joint, Catalogue(moved, Terms()), plain, lambda _text: None)
    scores = Scores(gram_about(setting, joint, exact.catalogue), 1, frozenset())
    name = "tracker_target"
    narrow = Refit(frozenset({name}), joint, {name: 0.01}, -20.0, {name: 3.0})
    wide = replace(narrow, widths={name: 3.0}, score=-10.0 if better else -30.0, wished={name: 9.0})
    fits, asked, known = iter([narrow, wide]), list[float](), list[object]()

    def settled(
        _scores: object, _names: object, _start: object, widths: dict[str, float],
        jacobian: object = None,
    ) -> Refit:  # fmt: skip
        asked.append(widths[name])
        known.append(jacobian)
        return next(fits)

    monkeypatch.setattr(exact, "_settled", settled)
    assert exact.fit(scores, narrow.names) is (wide if better else narrow)
    assert asked[1:] == [3.0] and known[1:] == [joint.jacobian]


def test_what_a_fit_did_not_find_is_no_evidence() -> None:
    """The linear model is the same on the way and at the end; the objective is not."""
    problem = warmed()
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    moved = Terms([term(ROBOT, "tracker_target", shift_x_m=1e-4)])
    plain = evaluate(problem, Terms(), factor)
    joint = settle(setting, evaluate(problem, moved, factor), widths_of(moved), WHITE)
    fixed = replace(setting, weight=joint.weight)
    scores = Scores(gram_about(fixed, joint, Catalogue(moved, Terms())), 1, frozenset())
    off = joint.terms.with_vector(joint.terms.vector + 2e-5)
    early = replace(joint, state=evaluate(problem, off, factor, plain))
    names = frozenset({"tracker_target"})
    # with the best widths: what these promise beyond others is no evidence on the way either
    widths = scored(fixed, joint, names, {"tracker_target": 1.0}, scores).widths
    end, way = (scored(fixed, fit, names, widths, scores).score for fit in (joint, early))
    lost = cost(fixed, WHITE, joint.weight, early.state, joint.width) - cost(
        fixed, WHITE, joint.weight, joint.state, joint.width
    )
    assert lost > 1.0 and end - way == pytest.approx(0.5 * lost, rel=0.05)


class Toy:
    """Sets with the scores of a table; taken are the names of those that are fitted from values."""

    def __init__(self, scores: dict[str, float]) -> None:
        self.setting = SimpleNamespace(problem=None)
        weight, creep = term(ROBOT, "cable_weight"), term(ROBOT, "creep", amount=0.05, time_s=9.0)
        self.catalogue = SimpleNamespace(later=Terms([weight, creep]))
        self.known = {frozenset(names.split()): score for names, score in scores.items()}
        self.taken: list[str] = []
        self.best = "best"

    def fit(self, _scores: object, names: frozenset[str]) -> Any:
        terms = Terms(term(ROBOT, name) for name in sorted(names))
        joint = SimpleNamespace(terms=terms, names=names)
        return SimpleNamespace(names=names, score=self.known[names], joint=joint)

    def take(self, _scores: object, *starts: Terms) -> None:
        self.taken.extend(" + ".join(sorted(start.names)) for start in starts)


def test_heavy_cables_are_tried_in_place_of_all_members_but_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three effects did what a weight does; beside two of them a fit of it ended at none."""
    toy: Any = Toy(
        {
            "drum_gain external_wrench stiffness": -380.0,
            "drum_gain external_wrench": -390.0, "drum_gain stiffness": -500.0,
            "external_wrench stiffness": -420.0,
            "external_wrench": -560.0, "drum_gain": -700.0, "stiffness": -600.0,
        }
    )  # fmt: skip
    asked: dict[tuple[str, ...], list[str]] = {}

    def promising(_setting: object, joint: Any, absent: list[Any]) -> list[Promising]:
        asked[tuple(sorted(joint.names))] = [layout.name for layout in absent]
        gain = {("external_wrench",): 188.0, ("drum_gain",): 311.0}.get(tuple(joint.names), -1.0)
        return [Promising(term(ROBOT, "cable_weight"), gain, 0.0)]

    monkeypatch.setattr(refits, "promising_beside", promising)
    monkeypatch.setattr(refits, "has_history", lambda _problem, layout: layout.name == "creep")
    scores: Any = SimpleNamespace(always=frozenset())
    best: Any = toy.fit(None, frozenset({"drum_gain", "external_wrench", "stiffness"}))
    assert swapped(toy, scores, best) == "best"
    assert toy.taken == ["cable_weight + external_wrench"]  # 172 were enough, 312 would have been
    assert {len(names): some for names, some in asked.items()} == {
        2: ["cable_weight", "creep"],
        1: ["cable_weight"],
    }
    # of two members, all but one are one
    asked.clear()
    swapped(toy, scores, toy.fit(None, frozenset({"drum_gain", "stiffness"})))
    assert len(asked) == 2
