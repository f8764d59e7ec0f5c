"""Sets of effects that were found elsewhere: the joint fit and the sets begin there too."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration import compared
from crosscheck.calibration.joint_fit import stages
from crosscheck.calibration.joint_fit.joining import layouts
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.joint_fit.stages import from_given
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.search import search_sets
from crosscheck.calibration.sets import exact, refits
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.exact import LOCAL_MINIMUM
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, evaluate
from crosscheck.fit.preparation.prepare import prepare
from crosscheck.given import considered
from seecr.description.mjcf import load_robot
from seecr.effects import Term, Terms

ROBOT = load_robot(COGIRO)
HIDDEN = Terms(
    [
        term(ROBOT, "cable_weight", weight_N_per_m=0.2),
        term(ROBOT, "tracker_scale", factor=1.005),
    ]
)
FEW = ("cable_weight", "tracker_scale", "tracker_frame", "nonlinear_elasticity")


@pytest.fixture(scope="module")
def problem() -> Problem:
    data = measured(ROBOT, list(HIDDEN), points=4, seed=1)
    return prepare(ROBOT, data, Terms(), considered(FEW)).problem


def far_from(terms: Terms) -> Terms:
    """Other values than these."""
    return terms.with_vector(terms.vector + np.array([0.3, 0.02]))


def test_a_joint_fit_begins_where_effects_alone_are_the_better_fit(problem: Problem) -> None:
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    at_once, _later = layouts(problem)
    start = evaluate(problem, Terms(Term(a, a.null) for a in at_once), factor)
    hollow = settle(setting, start, widths_of(start.terms), WHITE, 0)
    better = from_given(setting, hollow, start, HIDDEN)
    assert set(better.terms.names) == {*start.terms.names, *HIDDEN.names}
    assert better.terms["cable_weight"].vector[0] == pytest.approx(0.2, rel=0.05)
    assert np.max(better.colour.scale) < 1.1
    # of other data they are no better than what there is
    assert from_given(setting, better, start, far_from(HIDDEN)) is better


def test_what_joined_from_elsewhere_stays_where_the_fit_begins_again_from_afar(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diagnosis of data with a kink in a cable ended with a KeyError: its set was gone."""
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    first = Terms([term(ROBOT, "tracker_scale", factor=1.0)])
    both = Terms([*first, term(ROBOT, "cable_weight", weight_N_per_m=0.1)])
    joint = settle(setting, evaluate(problem, both, factor), widths_of(both), WHITE, 0)
    poor = replace(joint, colour=WHITE.hotter(100.0))
    # the last, which is from afar, is taken
    order = itertools.count()
    monkeypatch.setattr(stages, "worth", lambda _setting, _joint: next(order))
    monkeypatch.setattr(stages, "with_noise", lambda _setting, one: one)
    added = [term(ROBOT, "nonlinear_elasticity", quadratic=1.0)]
    found = stages._joined(setting, poor, first, added)
    assert {"cable_weight", "nonlinear_elasticity"} <= set(found.terms.names)


@pytest.mark.parametrize(("together", "kept"), [
    (True, {"drum_eccentricity", "hysteresis", "creep"}), (False, {"hysteresis"}),
])  # fmt: skip
def test_what_costs_more_together_joins_one_by_one(
    monkeypatch: pytest.MonkeyPatch, together: bool, kept: set[str]
) -> None:
    """Drums out of round in many numbers had kept out hysteresis, which was there."""
    some = ["drum_eccentricity", "hysteresis", "creep"]
    tried: list[list[str]] = []

    def with_more(_setting: object, fit: Any, _first: object, added: list[str]) -> Any:
        tried.append(added)
        pays = together if len(added) > 1 else added == ["hysteresis"]
        return fit | set(added) if pays else fit

    monkeypatch.setattr(stages, "_with_more", with_more)
    found: Any = stages._joined(None, set(), Terms(), some)  # type: ignore[arg-type]
    assert found == kept
    assert tried == [some, *([] if together else [[name] for name in some])]


class AllFittedError(Exception):
    """All was fitted at once: sets need not be compared."""


@pytest.mark.slow
def test_the_best_of_what_was_found_elsewhere_is_tried(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[Terms] = []

    def spied(_setting: Setting, joint: JointFit, _start: State, given: Terms) -> JointFit:
        tried.append(given)
        return joint

    taken_as_given: list[bool] = []

    def back(setting: Setting, joint: JointFit) -> JointFit:
        taken_as_given.append(setting.frozen)
        return joint

    def stop(*_args: object) -> None:
        raise AllFittedError

    monkeypatch.setattr(stages, "from_given", spied)
    monkeypatch.setattr(stages, "with_rows_back", back)
    monkeypatch.setattr(compared, "compare_sets", stop)
    for given in ([HIDDEN.without("cable_weight"), HIDDEN], []):
        with pytest.raises(AllFittedError):
            search_sets(problem, SIGMA, given=given)
    assert tried == [HIDDEN]
    # what was found elsewhere may have a history, and a walk for each parameter takes minutes
    assert len(taken_as_given) >= 2 and all(taken_as_given)


@pytest.mark.slow
def test_sets_that_were_found_elsewhere_are_compared_from_their_values(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They end where they begin here: a fit from nothing may end in a hollow."""
    monkeypatch.setattr(exact, "_STEPS", 0)
    monkeypatch.setattr(
        exact, "_linear_terms", lambda catalogue, _scores, names, _part: nulls(catalogue, names)
    )
    one = frozenset(HIDDEN.names)
    without, with_ = (search_sets(problem, SIGMA, given=g).found.refit(one) for g in ([], [HIDDEN]))
    assert without is not None and with_ is not None
    assert with_.joint.terms["cable_weight"].vector[0] == pytest.approx(0.2, rel=0.05)
    assert with_.score > without.score + 100.0


def nulls(catalogue: Catalogue, names: Names) -> Terms:
    return Terms(catalogue.start(name) for name in sorted(names))


@pytest.mark.slow
def test_a_challenger_that_explains_more_is_the_best_set_and_challenged_in_turn(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    challenged: list[Names] = []

    def challenger(sets: exact.Exact, _scores: Scores, best: exact.Refit) -> None:
        challenged.append(best.names)
        winner = frozenset({"tracker_frame", "nonlinear_elasticity"})
        sets.fitted[winner] = replace(best, names=winner, score=best.score + 5.0)

    monkeypatch.setattr(refits, "challenge", challenger)
    # the winner has the fit of another set, so that its members cannot be looked up in it
    monkeypatch.setattr(refits, "_is_idle", lambda _exact, _scores, _best, _name: False)
    found = search_sets(problem, SIGMA).found
    first, *others = challenged
    assert first >= set(HIDDEN.names)
    assert others == [{"tracker_frame", "nonlinear_elasticity"}] * len(others) != []
    assert found.best.names == {"tracker_frame", "nonlinear_elasticity"}


@pytest.mark.slow
def test_about_a_given_set_with_a_shape_others_are_looked_for_at_that_shape(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At another one it does nothing, and what imitates it is found beside it."""
    # which would find it here, but not where it is in the best set at the wrong shape
    monkeypatch.setattr(refits, "swapped", lambda _exact, _scores, best: best)
    random = np.random.default_rng(4)
    every = [f"{kind}_{i}_m" for i in range(1, 9) for kind in ("sine", "cosine")]
    small = {name: 6e-5 * random.normal() for name in every}
    uneven = term(ROBOT, "drum_eccentricity", drum_radius_m=0.03, **small)
    hidden = [uneven, term(ROBOT, "tracker_scale", factor=1.002)]
    data = measured(ROBOT, hidden, points=12, seed=2)
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    names = ("drum_gain", "tracker_scale", "gravity_tilt", "cable_length_offset")
    there = Terms(term(ROBOT, name) for name in names)
    joint = settle(setting, evaluate(problem, there, factor), widths_of(there), WHITE)
    plain = evaluate(problem, Terms(), factor)
    catalogue = Catalogue(there, Terms([term(ROBOT, "drum_eccentricity", drum_radius_m=0.004)]))
    found = refits.compare_sets(setting, joint, catalogue, plain, given=[Terms([uneven])])
    assert found.best.names == {"drum_eccentricity", "tracker_scale"}
    radius = found.best.joint.terms["drum_eccentricity"].vector[-1]
    assert radius == pytest.approx(0.03, rel=0.06)
    # the set that is found in the end is the plainest that explains as well
    monkeypatch.setattr(refits, "plainer", lambda exact, _best: exact.possible[frozenset()])
    last = refits.compare_sets(setting, joint, catalogue, plain, given=[Terms([uneven])])
    assert last.best.names == frozenset()


@pytest.mark.parametrize(("last", "there", "about"), [
    ({"drum_eccentricity"}, 0.0, False),
    ({"drum_eccentricity"}, 20.0, True),
    ({"drum_eccentricity", "creep"}, 0.0, True),
])  # fmt: skip
def test_about_a_part_of_the_best_set_nothing_is_sought_unless_its_values_explain_more(
    monkeypatch: pytest.MonkeyPatch, last: set[str], there: float, about: bool
) -> None:
    """Beside a kink in a cable, two minutes went to a set whose members had all been found."""
    both = frozenset({"drum_eccentricity", "anchor_point_error"})
    best, now = fitted(both, "best", 0.0), fitted(both, "now", there)
    given = fitted(frozenset(last), "given", -600.0)
    begun: list[Terms] = []
    sought: list[object] = []

    def explored(_exact: object, scores: object, _most: int) -> Any:
        sought.append(scores)
        return now if last <= both else best

    monkeypatch.setattr(refits, "_best_explored", explored)
    monkeypatch.setattr(refits, "_leads_on", lambda _exact, _near, _begin, _best: True)
    nearby: Any = SimpleNamespace(
        catalogue=SimpleNamespace(later=SimpleNamespace(names=("drum_eccentricity", "creep"))),
        fitted={both: now},
        fit=lambda _scores, names: given if names == given.names else None,
        take=lambda _scores, start: begun.append(start),
        report=lambda _text: None,
        scores_about=lambda joint, own_shapes: joint,
    )
    linear: Any = SimpleNamespace(
        always=frozenset(), score=lambda names: -1e5 if names == given.names else 0.0
    )
    found = refits.about_given(nearby, linear, best, [given.names])
    assert sought == ([given.joint] if about else [])
    if not last <= both:
        assert found == (linear, best) and not begun
        return
    # what explains more from there is the best set from now on, with scores about it
    assert found == ((now.joint if about else linear), now)
    own = {member.name: member.origin for member in begun.pop()}
    assert own == {"drum_eccentricity": "given", "anchor_point_error": "best"}


@pytest.mark.parametrize(("score", "more"), [(-0.5 * LOCAL_MINIMUM, True), (-176.8, False)])
def test_about_a_given_set_one_is_fitted_before_all_others(
    monkeypatch: pytest.MonkeyPatch, score: float, more: bool
) -> None:
    """A quarter of a diagnosis went to sets that explained less by hundreds, all for one reason."""
    best = fitted(frozenset({"anchor_point_error"}), "best", 0.0)
    given = fitted(frozenset({"drum_eccentricity"}), "given", -4325.0)
    company = fitted(frozenset({"drum_eccentricity", "drum_gain"}), "near", score)
    fits = {one.names: one for one in (given, company)}
    near: Any = SimpleNamespace(always=frozenset(), best=lambda _count, _within: [company.names])
    linear: Any = SimpleNamespace(
        always=frozenset(), score=lambda names: -1e5 if names == given.names else 0.0
    )
    nearby: Any = SimpleNamespace(
        catalogue=SimpleNamespace(later=SimpleNamespace(names=("drum_eccentricity",))),
        fit=lambda _scores, names: fits[names],
        scores_about=lambda _joint, own_shapes: near,
    )
    begun: list[Names] = []
    monkeypatch.setattr(refits, "explore", lambda scores, some: begun.extend(some))
    asked: list[object] = []

    def explored(_exact: object, scores: object, _most: int) -> Any:
        asked.append(scores)
        return best

    monkeypatch.setattr(refits, "_best_explored", explored)
    assert refits.about_given(nearby, linear, best, [given.names]) == (linear, best)
    assert begun == [frozenset(), given.names]
    assert asked == ([near] if more else [])


def fitted(names: Names, origin: str, score: float) -> Any:
    """A fit whose values say where they are from."""
    some = [SimpleNamespace(name=name, origin=origin) for name in sorted(names)]
    return SimpleNamespace(names=names, score=score, joint=SimpleNamespace(terms=some))
