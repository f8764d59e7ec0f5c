"""What a smooth field could explain as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_data import COGIRO, SIGMA, measured, term

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State, evaluate
from crosscheck.fit.noise.smooth import beyond_smooth, field_columns, monomials
from seecr.description.mjcf import load_robot
from seecr.effects import Terms


def problem_and_state() -> tuple[Problem, State]:
    robot = load_robot(COGIRO)
    data = measured(robot, ())
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    return problem, evaluate(problem, Terms(), factor)


def test_cubics_leave_out_axes_along_which_nothing_moves() -> None:
    random = np.random.default_rng(0)
    place = random.uniform(-3.0, 5.0, (40, 3))
    assert monomials(place).shape == (40, 20) and np.linalg.matrix_rank(monomials(place)) == 20
    place[:, 1] = 0.25
    assert monomials(place).shape == (40, 10) and np.linalg.matrix_rank(monomials(place)) == 10
    assert monomials(place, 1).shape == (40, 3)
    target = place[:, 0] ** 3 - place[:, 0] * place[:, 2]
    left = target - monomials(place) @ np.linalg.lstsq(monomials(place), target, rcond=None)[0]
    assert np.abs(left).max() < 1e-10 * np.abs(target).max()


def test_a_scale_explains_nothing_of_a_lens_that_a_field_does_not() -> None:
    problem, state = problem_and_state()
    span = field_columns(problem, state.prediction.pose[:, :3])
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(len(state.white))
    lens = 20.0 * span @ rng.standard_normal(span.shape[1])
    scale = span[:, 1] * float(lens @ span[:, 1]) / float(span[:, 1] @ span[:, 1])
    before = replace(state, white=noise + lens)
    after = replace(state, white=noise + lens - scale)
    assert not beyond_smooth(problem, before, after, 1.0 / 3.0)


def test_what_no_cubic_imitates_is_beyond_a_field_though_a_lens_is_left() -> None:
    problem, state = problem_and_state()
    span = field_columns(problem, state.prediction.pose[:, :3])
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(len(state.white))
    rough = 3.0 * np.sign(np.sin(17.0 * np.arange(len(noise))))
    lens = 20.0 * span @ rng.standard_normal(span.shape[1])
    before = replace(state, white=noise + lens + rough)
    assert beyond_smooth(problem, before, replace(state, white=noise + lens), 2.0 / 3.0)


def test_a_pulley_is_beyond_a_field() -> None:
    robot = load_robot(COGIRO)
    radius = term(robot, "pulley_radius", radius_m=0.01)
    data = measured(robot, [radius])
    problem = Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))
    factor = problem.noise(problem.experiment.predict())
    before, after = (evaluate(problem, Terms(t), factor) for t in ([], [radius]))
    assert beyond_smooth(problem, before, after, 2.0 / 3.0)
    assert not beyond_smooth(problem, before, before, 2.0 / 3.0)
