"""Where the fit of a set begins."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.calibration import exact
from crosscheck.calibration.catalogue import Catalogue
from crosscheck.calibration.colour import WHITE, chain_of
from crosscheck.calibration.exact import Exact
from crosscheck.calibration.joint import Setting, settle
from crosscheck.calibration.priors import widths_of
from crosscheck.calibration.sets import Names, Scores
from crosscheck.fit.problem import Problem
from crosscheck.fit.state import evaluate
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
