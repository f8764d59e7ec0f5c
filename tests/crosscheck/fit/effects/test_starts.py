"""Starts from the forces at the measured poses, where cables go slack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.fit.effects import starts
from crosscheck.fit.effects.candidates import (
    Trials,
    candidates_for,
    fit_candidate,
    null_fit,
    screen,
)
from crosscheck.fit.effects.gauss_newton import fit
from crosscheck.fit.effects.starts import equation_start, starts_of
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.measurements.data import Sigma
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import Terms

OFFSETS = (-0.0006, 0.0012, -0.0011, 0.0015, -0.0009, 0.0014, 0.0013, 0.0006)


@pytest.fixture(scope="module")
def case():
    """The tilted DemoBot, whose cables' lengths are off by a millimetre each."""
    robot = load_robot(model_path("demobot_parallel"))
    hidden = term(
        robot, "cable_length_offset", **{f"offset_{i + 1}_m": v for i, v in enumerate(OFFSETS)}
    )
    data = measured(robot, [hidden], points=12, seed=2)
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    return problem, factor, null_fit(problem, Terms(), factor, refit=False)


def layout_named(problem, name):
    return next(c.layout for c in candidates_for(problem) if c.name == name)


def test_it_leads_where_the_derivative_at_null_does_not(case) -> None:
    problem, factor, base = case
    layout = layout_named(problem, "cable_length_offset")
    trials = Trials(problem, factor)
    screened = screen(trials, base, layout)
    assert screened.starts is not None
    derivative, balanced = screened.starts
    reached = []
    for start in (derivative, balanced):
        one = replace(screened, starts=replace(screened.starts, vectors=(start,), balanced=None))
        reached.append(fit_candidate(trials, base, one).fit)
    assert all(found is not None for found in reached)
    noise = len(base.state.white)
    assert reached[1].chi2 < 1.2 * noise
    assert reached[0].chi2 > 10 * noise
    far = (reached[1].terms.vector - OFFSETS) / reached[1].stderr
    assert np.all(np.abs(far) < 4.5)


def test_of_many_shapes_the_chance_is_never_above_one() -> None:
    robot = load_robot(COGIRO)
    exact = Sigma(position_m=1e-12, orientation_rad=1e-12)
    data = measured(robot, [], points=6, sigma=exact)  # nothing is left for any shape to explain
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    base = null_fit(problem, Terms(), factor, refit=False)
    tried = screen(Trials(problem, factor), base, layout_named(problem, "drum_eccentricity"))
    assert tried.starts is not None and tried.starts.shapes > 10
    assert tried.p == 1.0


def test_what_a_weight_does_is_seen_where_its_derivative_says_the_contrary() -> None:
    """The sag of cables goes with the square of their weight, their load with the weight."""
    robot = load_robot(COGIRO)
    hidden = [
        term(robot, "cable_weight", weight_N_per_m=0.2),
        term(robot, "tracker_scale", factor=1.005),
    ]
    data = measured(robot, hidden, points=8, seed=1)
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    base = fit(problem, Terms(hidden[1:]), factor)
    starts = starts_of(problem, base, layout_named(problem, "cable_weight"), factor)
    first, by_derivative = (vector[0] for vector in starts)
    assert by_derivative == 0.0
    assert first == pytest.approx(0.2, rel=0.3)
    assert starts.gain > 0.9 * base.chi2


def test_it_is_silent_on_sensors_and_on_rows_that_depend_on_rows_before(case) -> None:
    problem, factor, base = case
    for name in ("tracker_frame", "tracker_scale"):
        layout = layout_named(problem, name)
        assert equation_start(problem, base.state, layout, layout.start({}), factor) is None
    layout = layout_named(problem, "hysteresis")
    shape = layout.start({"stretch_m": 1e-3})
    shape[0] = layout.scale[0]
    assert equation_start(problem, base.state, layout, shape, factor) is None


@pytest.mark.slow
def test_values_stay_within_their_bounds(case) -> None:
    problem, factor, base = case
    for name in ("cable_stiffness", "drum_gain", "anchor_point_error"):
        layout = layout_named(problem, name)
        found = equation_start(problem, base.state, layout, layout.start({}), factor)
        assert found is not None
        assert np.all((found >= layout.lower) & (found <= layout.upper) & np.isfinite(found))


def test_platforms_on_joints_go_without() -> None:
    """A measured pose is never quite on the joints; the diagnosis does not stumble over it."""
    robot = load_robot(model_path("planar_vertical"))
    data = measured(robot, points=6)
    data.position[:, 1] += 1e-4
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    base = null_fit(problem, Terms(), factor, refit=False)
    layout = layout_named(problem, "cable_length_offset")
    assert equation_start(problem, base.state, layout, layout.start({}), factor) is None


def test_shapes_in_two_threads_are_those_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many rows they are looked at side by side, and are told in the same order."""
    robot = load_robot(COGIRO)
    data = measured(robot, [term(robot, "pulley_radius", radius_m=0.004)], points=3, seed=3)
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict(()))
    base = null_fit(problem, Terms(), factor, refit=False)
    drums = next(c.layout for c in candidates_for(problem) if c.name == "drum_eccentricity")
    found = []
    for rows in (1_000_000, 0):
        monkeypatch.setattr(starts, "_MANY_ROWS", rows)
        found.append(starts_of(problem, base, drums, factor))
    one, two = found
    np.testing.assert_array_equal(one.vectors, two.vectors)
    assert (one.gain, one.directions, one.shapes) == (two.gain, two.directions, two.shapes)
    assert one.shapes > 10.0
