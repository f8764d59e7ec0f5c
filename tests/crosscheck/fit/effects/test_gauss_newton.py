"""Steps of a fit: derivatives serve again where they foretold what the last step did."""

from __future__ import annotations

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.fit.effects import gauss_newton
from crosscheck.fit.effects.gauss_newton import Fit, fit
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State
from seecr.commands.path import Path
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.pose import Array
from seecr.statics import batch
from seecr.statics.tables import Tables

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


def test_a_step_is_given_up_where_a_row_that_counts_is_lost_and_the_start_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The start tells which rows have no solution; a step that loses one is dropped anyway."""
    rubs = term(ROBOT, "hysteresis", amplitude_N=0.4, stretch_m=1e-3)
    data = measured(ROBOT, [rubs], points=6, seed=3)
    use = np.arange(data.n_rows) != 1
    problem, asked, walk = Problem(ROBOT, data, SIGMA, use), list[object](), batch.walk

    def spied(tables: Tables, path: Path, limit: int, needed: object) -> batch.Evaluation:
        asked.append(needed)
        return walk(tables, path, limit)

    factor = problem.noise(problem.experiment.predict(()))
    monkeypatch.setattr(batch, "walk", spied)
    fit(problem, Terms([rubs.with_vector(0.5 * rubs.vector)]), factor, iterations=1)
    start, *steps = asked
    assert start is None
    assert steps and all(one is problem.use for one in steps)
