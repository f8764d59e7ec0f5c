"""Prepares measurements: leaves out rows without equilibrium, fills in noise, finds outliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.fit.residual_noise import estimate_sigma, oversized
from crosscheck.fit.state import State
from crosscheck.measurements.data import Measurements
from crosscheck.preparation.fitness import refusal_of
from crosscheck.preparation.freed import freed, groups_of, laid_out
from crosscheck.preparation.suspect import suspicions
from crosscheck.preparation.unread import locked_note, without_unread
from seecr.description.robot import Robot
from seecr.effects import Terms, catalogue
from seecr.equilibrium.strange import strange
from seecr.prediction.experiment import Prediction

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction that is done, 0 to 1."""

Finder = Callable[[Problem, Terms], NDArray[np.bool_]]
"""Called with the data and the model as it stands; returns which rows (n,) are outliers."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Measurements ready for a fit.

    Attributes:
        problem: the data without the rows that have no equilibrium, and with all noise filled in.
        terms: effects of the model, with those that the data leave free.
        notes: what was assumed, estimated or left out.
        refusal: why nothing can be said about these data; None if something can.
        fitted: how many values were fitted in advance because the data leave them free.
        far_off: (n,) outliers, which count in none of the estimates; None if nobody looked for any.
    """

    problem: Problem
    terms: Terms
    notes: tuple[str, ...]
    refusal: Refusal | None
    fitted: int = 0
    far_off: NDArray[np.bool_] | None = None


def prepare(
    robot: Robot,
    data: Measurements,
    terms: Terms,
    considered: frozenset[str] | None = None,
    outliers: Finder | None = None,
) -> Prepared:
    """Leave out rows that have no equilibrium, estimate unstated noise, and fit what is free.

    Args:
        robot, data: what was measured.
        terms: effects of the model as it stands.
        considered: names of the effects that may be missing; by default the whole catalogue.
        outliers: finds outliers, without which noise is estimated; by default nobody looks for any.
    """
    considered = frozenset(catalogue()) if considered is None else considered
    every = np.ones(data.n_rows, dtype=bool)
    problem = Problem(robot, data, data.sigma, every, considered=considered)
    if not problem.measured.any():
        none = Refusal(Unfit.NO_READINGS, data.n_rows)
        return Prepared(problem, terms, (*robot.notes, *data.notes), none)
    laid = laid_out(data, terms)
    plain = problem.experiment.predict(laid.terms.effects)
    problem, unread = without_unread(_solved_rows(problem, plain), plain)
    problem, estimates = estimate_sigma(problem, plain)
    found = freed(problem, laid)
    terms, said = found.terms, (*laid.notes, *found.notes)
    if found.free.any():
        plain = problem.experiment.predict(terms.effects)
        if estimates:  # the first residuals also contained the error of the frame
            problem, estimates = estimate_sigma(problem.with_sigma(data.sigma), plain)
    far_off = None if outliers is None else outliers(problem, terms)
    if far_off is not None and far_off.any() and estimates:
        others, estimates = estimate_sigma(problem.only(~far_off).with_sigma(data.sigma), plain)
        problem = problem.with_sigma(others.sigma)
    asked, odd = suspicions(problem, plain)
    notes = (
        *data.notes, *robot.notes, *strange(robot), *locked_note(problem), *unread, *asked,
        *oversized(problem, plain), *problem.left_out, *estimates, *said,
    )  # fmt: skip
    problem = problem.with_groups(groups_of(data, terms))
    refusal = refusal_of(problem, plain.pose[:, :3], data.sigma) or odd
    return Prepared(problem, terms, notes, refusal, int(found.free.sum()), far_off)


def _solved_rows(problem: Problem, plain: Prediction) -> Problem:
    """The problem without the rows that have no equilibrium."""
    for rows, words in (
        (plain.singular, "the platform is free to move there"),
        (~plain.solved & ~plain.singular, "no equilibrium was found there"),
    ):
        if np.any(rows & problem.use):
            lines = problem.data.lines_of(rows & problem.use)
            problem = problem.without(rows, f"{lines} left out: {words}")
    return problem


def noise_floor(problem: Problem, state: State | None = None) -> Rms:
    """The rms errors of a perfect model, by kind: noise of the readings alone.

    With a state, the noise of the commanded lengths is included, as whitening at that state has it.
    """
    raw = np.broadcast_to(problem.reading_sigma, problem.measured.shape).copy()
    if state is not None:
        raw = np.sqrt(np.einsum("nij,nij->ni", state.factor, state.factor))
    return rms_by_kind(problem, raw)
