"""Where the fit of a set begins."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration.joint_fit.joint import Setting, settle
from crosscheck.calibration.linear_evidence.priors import widths_of
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.calibration.sets import exact
from crosscheck.calibration.sets.catalogue import Catalogue
from crosscheck.calibration.sets.exact import Exact
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import evaluate
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

ROBOT = load_robot(COGIRO)
SCALE = frozenset({"tracker_scale"})


@pytest.mark.parametrize(("times", "taken"), [(1.0, 1.0), (1.9, 1.0), (3.0, 0.5), (40.0, 0.125)])
def test_a_fit_begins_where_the_set_explains_more_than_nothing_does(
    monkeypatch: pytest.MonkeyPatch, times: float, taken: float
) -> None:
    """With values of a linear model from afar, a fit of eleven effects took ten seconds to fail."""
    data = measured(ROBOT, [term(ROBOT, "tracker_scale", factor=1.005)], points=3, seed=1)
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    plain = evaluate(problem, Terms(), factor)
    null = Terms([term(ROBOT, "tracker_scale")])
    joint = settle(setting, plain.of(null), widths_of(null), WHITE, 0)
    tried: list[float] = []

    def linear(_catalogue: Catalogue, _scores: Scores, _names: Names, part: float) -> Terms:
        tried.append(part)
        return Terms([term(ROBOT, "tracker_scale", factor=1.0 + 0.005 * times * part)])

    monkeypatch.setattr(exact, "_linear_terms", linear)
    some = Exact(setting, joint, Catalogue(null, Terms()), plain, lambda _text: None)
    begun: list[float] = []
    fit = some._settled

    def settled(*args: object) -> exact.Refit:
        begun.append(args[2].terms.vector[0])  # type: ignore[attr-defined]
        return fit(*args)  # type: ignore[arg-type]

    object.__setattr__(some, "_settled", settled)
    found = some.fit(some.scores_about(joint), SCALE)
    assert begun[0] == pytest.approx(1.0 + 0.005 * times * taken)
    assert tried == [1.0 / 2**i for i in range(len(tried))] and tried[-1] == taken
    assert found is not None
    assert found.joint.terms.vector[0] == pytest.approx(1.005, abs=2e-5)


def test_part_of_the_way_begins_at_the_model_as_it_stands() -> None:
    """An eighth of a tracker's place in the model was 40,000 times as far off as all of it."""
    scaled = Terms([term(ROBOT, "tracker_scale", factor=1.5)])
    data = measured(ROBOT, [*scaled, term(ROBOT, "platform_mass", added_kg=0.02)], points=3, seed=1)
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(scaled.effects))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    plain = evaluate(problem, scaled, factor)
    both = Terms([*scaled, term(ROBOT, "platform_mass")])
    joint = settle(setting, plain.of(both), widths_of(both), WHITE, 0)
    some = Exact(setting, joint, Catalogue(both, Terms()), plain, lambda _text: None)
    scores, names = some.scores_about(joint), frozenset(both.names)
    none, half, all_ = (
        exact._linear_terms(some.catalogue, scores, names, part) for part in (0.0, 0.5, 1.0)
    )
    assert none["tracker_scale"].vector[0] == 1.5 and none["platform_mass"].vector[0] == 0.0
    assert half.vector == pytest.approx(0.5 * (none.vector + all_.vector), rel=1e-9)
    assert all_["tracker_scale"].vector[0] == pytest.approx(1.5, rel=0.01)


def test_outliers_do_not_decide_where_a_fit_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """What few rows far off leave changes by more than all that the others leave."""
    data = measured(ROBOT, [term(ROBOT, "tracker_scale", factor=1.002)], points=3, seed=1)
    data.position[:4] *= 0.3
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(()))
    null = Terms([term(ROBOT, "tracker_scale")])
    plain = evaluate(problem, Terms(), factor)
    free = Setting(problem, factor, chain_of(problem), frozen=True)
    joint = settle(free, plain.of(null), widths_of(null), WHITE)
    setting = Setting(problem, factor, chain_of(problem), frozen=True, weight=joint.weight)
    near = Terms([term(ROBOT, "tracker_scale", factor=1.001)])
    away = Terms([term(ROBOT, "tracker_scale", factor=0.9)])
    at = {part: near if part == 1.0 else away for part in exact._PARTS}
    monkeypatch.setattr(exact, "_linear_terms", lambda _c, _s, _n, part: at[part])
    some = Exact(setting, joint, Catalogue(null, Terms()), plain, lambda _text: None)
    scores = some.scores_about(joint)
    # with all rows alike, nothing would explain more
    assert evaluate(problem, near, factor).chi2 > plain.chi2
    assert some._linear(scores, SCALE).terms.vector[0] == 1.001
    # and where no part explains more, the fit begins where least is left
    at.update({1.0: away, 0.5: Terms([term(ROBOT, "tracker_scale", factor=0.99)])})
    assert some._linear(scores, SCALE).terms.vector[0] == 0.99
