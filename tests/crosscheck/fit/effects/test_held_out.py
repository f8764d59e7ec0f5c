"""Cross-validation of linear residuals of known rank."""

from __future__ import annotations

import numpy as np
import pytest
from linear_toy import toy, toy_problem

from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.effects.held_out import (
    blocks_note,
    blocks_of,
    hold_out,
    improves,
    pays,
    significantly_improves,
    unfitted,
)
from crosscheck.fit.least_squares.problem import Problem
from seecr.effects import Terms

NAMES = ("drum_gain", "tracker_scale", "centre_of_mass")


def test_each_run_is_predicted_by_a_fit_to_the_others() -> None:
    made = toy({"drum_gain": 0.5}, NAMES)
    problem, best = made.problem, made.fit(made.problem, made.terms("drum_gain"))
    held = hold_out(problem, best, np.zeros(0), made.fit)
    x, y = made.columns["drum_gain"], made.table
    counted = problem.measured
    for b, rows in enumerate(blocks_of(problem)):
        a, c = x[~rows][counted[~rows]], y[~rows][counted[~rows]]
        z = np.linalg.solve(a.T @ a + np.eye(8) / PRIOR_SIZES**2, a.T @ c)
        left = (y[rows] - x[rows] @ z)[counted[rows]]
        assert held.chi2[b] == pytest.approx(left @ left)
        assert held.readings[b] == len(left)
        layout = made.layout("drum_gain")
        assert held.values[b] == pytest.approx(layout.null + z * layout.scale)
    assert held.valid


def test_of_many_runs_every_tenth_is_held_out_in_the_same_fit() -> None:
    made = toy({"drum_gain": 0.5}, NAMES, runs=23, rows=4)
    fits: list[int] = []

    def counting(problem: Problem, terms: Terms, *_: object, **__: object) -> Fit:
        fits.append(int(problem.use.sum()))
        return made.fit(problem, terms)

    best = made.fit(made.problem, made.terms("drum_gain"))
    held = hold_out(made.problem, best, np.zeros(0), counting)
    assert fits == [80] * 3 + [84] * 7  # of 92 rows, three runs or two are out
    x, y, counted = made.columns["drum_gain"], made.table, made.problem.measured
    blocks = blocks_of(made.problem)
    assert len(blocks) == len(held.chi2) == 23
    for b, rows in enumerate(blocks):
        out = np.any(blocks[b % 10 :: 10], axis=0)
        a, c = x[~out][counted[~out]], y[~out][counted[~out]]
        z = np.linalg.solve(a.T @ a + np.eye(8) / PRIOR_SIZES**2, a.T @ c)
        left = (y[rows] - x[rows] @ z)[counted[rows]]
        assert held.chi2[b] == pytest.approx(left @ left)
        assert held.readings[b] == len(left)


@pytest.mark.slow
def test_what_runs_left_out_leave_grows_with_the_rank() -> None:
    """Of N readings in k runs, rank p: chi2 about N + p k/(k - 1), where in sample it is N - p."""
    found = []
    for seed in range(30):
        made = toy({"drum_gain": 0.5}, NAMES, seed=seed)
        best = made.fit(made.problem, made.terms("drum_gain"))
        held = hold_out(made.problem, best, np.zeros(0), made.fit)
        found.append((best.chi2, held.chi2.sum()))
    n = made.problem.n_readings
    inside, outside = np.mean(found, axis=0)
    error = np.sqrt(2.0 * n / 30)
    assert inside == pytest.approx(n - 8, abs=3 * error)
    assert outside == pytest.approx(n + 8 * 6 / 5, abs=3 * error)
    assert outside - inside == pytest.approx(8 * (1 + 6 / 5), abs=3.0)


def test_what_is_there_pays_and_what_is_not_does_not() -> None:
    made = toy({"drum_gain": 0.5}, NAMES)
    plain = unfitted(made.problem, made.base)
    held = {
        name: hold_out(
            made.problem, made.fit(made.problem, made.terms(name)), np.zeros(0), made.fit
        )
        for name in NAMES
    }
    assert pays(plain, held["drum_gain"]) and significantly_improves(plain, held["drum_gain"])
    fall, error = improves(plain, held["drum_gain"])
    assert fall > 5 * error > 0
    for name in ("tracker_scale", "centre_of_mass"):
        assert not significantly_improves(plain, held[name])
    assert plain.chi2.sum() == pytest.approx(made.base.chi2)


def test_a_model_that_could_not_be_solved_never_pays() -> None:
    from dataclasses import replace

    made = toy({"drum_gain": 0.5}, NAMES)
    plain = unfitted(made.problem, made.base)
    held = hold_out(
        made.problem, made.fit(made.problem, made.terms("drum_gain")), np.zeros(0), made.fit
    )
    assert not pays(plain, replace(held, valid=False))
    assert not significantly_improves(plain, replace(held, valid=False))


@pytest.mark.parametrize(
    ("runs", "blocks", "note"),
    [(1, 5, "a single run"), (2, 5, "only 2 runs"), (3, 3, "")],
)
def test_few_runs_are_cut_into_blocks_of_time_and_said_so(
    runs: int, blocks: int, note: str
) -> None:
    problem = toy_problem(runs, 10)
    found = blocks_of(problem)
    assert len(found) == blocks
    assert np.all(np.sum(found, axis=0) == 1)
    said = f"{note}: cross-validation leaves out 5 blocks of time instead of runs" if note else ""
    assert blocks_note(problem) == said
