"""Effects fitted by themselves, where everything together leaves more than noise."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, measured, term

from crosscheck.calibration.joint_fit.joining import layouts
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.joint_fit.single_effects import fitted_alone
from crosscheck.calibration.noise.colour import WHITE, chain_of
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.effects import Terms

pytestmark = pytest.mark.slow
ROBOT = load_robot(COGIRO)


def alone(hidden: Terms) -> tuple[JointFit, list[JointFit]]:
    problem = prepare(ROBOT, measured(ROBOT, hidden, points=6), Terms()).problem
    factor = problem.noise(problem.experiment.predict(()))
    setting = Setting(problem, factor, chain_of(problem), frozen=True)
    plain = settle(setting, evaluate(problem, Terms(), factor), np.zeros(0), WHITE)
    others, later = layouts(problem)
    return plain, fitted_alone(setting, plain, later, others)


def test_the_weight_of_cables_explains_nearly_all_by_itself() -> None:
    hidden = Terms([term(ROBOT, "cable_weight", weight_N_per_m=0.2)])
    plain, found = alone(hidden)
    best = found[0]
    assert best.terms.names == ("cable_weight",)
    assert best.state.chi2 < 0.01 * plain.state.chi2
    assert best.terms.vector[0] == pytest.approx(0.2, rel=0.02)


def test_one_that_joins_at_once_may_begin_too_and_only_the_best_does() -> None:
    hidden = Terms([term(ROBOT, "pulley_radius", radius_m=0.01)])
    plain, found = alone(hidden)
    assert [one.terms.names for one in found] == [("pulley_radius",)]
    assert found[0].state.chi2 < 0.01 * plain.state.chi2


def test_what_explains_less_than_half_is_not_taken_up() -> None:
    _plain, found = alone(Terms())
    assert found == []
