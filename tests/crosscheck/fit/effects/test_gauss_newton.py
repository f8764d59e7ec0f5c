"""Steps of a fit: derivatives serve again where they foretold what the last step did."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.fit.effects import gauss_newton
from crosscheck.fit.effects.gauss_newton import Fit, fit
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.pose import Array

ROBOT = load_robot(COGIRO)
HIDDEN = [
    term(ROBOT, "platform_mass", added_kg=0.01),
    term(ROBOT, "pulley_radius", radius_m=0.001),
]


def fitted(monkeypatch: pytest.MonkeyPatch, again: int) -> tuple[Fit, int]:
    """A fit that uses derivatives so often again, and how often it derived on its way."""
    data = measured(ROBOT, HIDDEN, points=6, seed=3)
    problem = Problem(ROBOT, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    derived: list[State] = []

    def spied(problem: Problem, state: State, frozen: bool = False) -> Array:
        derived.append(state)
        return derive(problem, state, frozen=frozen)

    derive = gauss_newton.free_derivatives
    with monkeypatch.context() as patch:
        patch.setattr(gauss_newton, "free_derivatives", spied)
        patch.setattr(gauss_newton, "_STALE", again)
        names = Terms([term(ROBOT, one.name) for one in HIDDEN])
        found = fit(problem, names, problem.noise(problem.experiment.predict(())))
    return found, len(derived)


def test_a_nearly_straight_fit_derives_less_often_and_ends_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, times = fitted(monkeypatch, 2)
    each, times_each = fitted(monkeypatch, 0)
    assert found.settled and each.settled
    assert times < times_each
    assert found.chi2 == pytest.approx(each.chi2, abs=2e-3)
    off = (found.terms.vector - each.terms.vector) / each.stderr
    assert np.max(np.abs(off)) < 0.05
