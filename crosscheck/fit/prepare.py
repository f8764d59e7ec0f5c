"""Measurements made ready: rows without an answer and outliers left out, noise filled in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.doubts import doubts
from crosscheck.fit.fitness import refusal_of
from crosscheck.fit.freed import freed
from crosscheck.fit.held_out import blocks_note
from crosscheck.fit.parts import groups_of, laid_out
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.fit.state import State
from crosscheck.fit.unstated import estimate_sigma
from crosscheck.measurements.data import Measurements
from seecr.description.robot import Robot
from seecr.effects import Terms, catalogue
from seecr.prediction.experiment import Prediction

Progress = Callable[[str, float], None]
"""Called with what is being done and the part of it that is done, 0 to 1."""

# Rows that stick out by this many robust deviations, alone, are outliers.
_OUTLIER = 6.0
_MOST_OUTLIERS = 0.05


@dataclass(frozen=True, eq=False)
class Prepared:
    """Measurements made ready.

    Attributes:
        problem: without the rows that have no equilibrium, with all noise filled in.
        terms: effects of the model, with those that the data leave free.
        notes: what was assumed, estimated or left out.
        blocks_note: how cross-validation would cut the data, where that is to be said.
        refusal: why nothing can be said of these data; None where something can.
        fitted: how many values were fitted to the data first, as these leave them free.
    """

    problem: Problem
    terms: Terms
    notes: tuple[str, ...]
    blocks_note: str
    refusal: Refusal | None
    fitted: int = 0

    @property
    def all_notes(self) -> tuple[str, ...]:
        """The notes for whoever cross-validates."""
        return (*self.notes, self.blocks_note) if self.blocks_note else self.notes


def prepare(
    robot: Robot, data: Measurements, terms: Terms, considered: frozenset[str] | None = None
) -> Prepared:
    """Leave out the rows that have no equilibrium, estimate noise that nobody stated.

    Args:
        robot, data: what was measured.
        terms: effects of the model as it stands.
        considered: names of the effects that may be missing; all of the catalogue without.
    """
    considered = frozenset(catalogue()) if considered is None else considered
    every = np.ones(data.n_rows, dtype=bool)
    problem = Problem(robot, data, data.sigma, every, considered=considered)
    if not problem.measured.any():
        return Prepared(
            problem, terms, tuple(data.notes), "", Refusal(Unfit.NO_READINGS, data.n_rows)
        )
    laid = laid_out(data, terms)
    plain = problem.experiment.predict(laid.terms.effects)
    problem = _solved_rows(problem, plain)
    problem, estimates = estimate_sigma(problem, plain)
    found = freed(problem, laid)
    terms, said = found.terms, (*laid.notes, *found.notes)
    if found.free.any():
        plain = problem.experiment.predict(terms.effects)
        if estimates:  # what was left then was the frame's
            known = replace(problem, sigma=data.sigma)
            problem, estimates = estimate_sigma(known, plain)
    odd = doubts(problem, plain.readings)
    notes = (*data.notes, *odd, *problem.left_out, *estimates, *said)
    problem = problem.with_groups(groups_of(data, terms))
    refusal = refusal_of(problem, plain.pose[:, :3], data.sigma)
    return Prepared(problem, terms, notes, blocks_note(problem), refusal, int(found.free.sum()))


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
    """The rms errors that noise alone would give a perfect model, that of lengths included."""
    raw = np.broadcast_to(problem.reading_sigma, problem.measured.shape).copy()
    if state is not None:
        raw = np.sqrt(np.einsum("nij,nij->ni", state.factor, state.factor))
    return rms_by_kind(problem, raw)


def outlying_rows(problem: Problem, state: State) -> np.ndarray:
    """(n,) rows whose whitened residual is far beyond all others, in few places."""
    power = np.zeros(problem.data.n_rows)
    count = np.zeros(problem.data.n_rows)
    np.add.at(power, problem.row_of, state.white**2)
    np.add.at(count, problem.row_of, 1.0)
    size = np.sqrt(power / np.maximum(count, 1.0))
    used = problem.use & (count > 0)
    middle = float(np.median(size[used]))
    spread = 1.4826 * float(np.median(np.abs(size[used] - middle)))
    limit = middle + _OUTLIER * max(spread, 0.2 * middle, 1e-12)
    rows = used & (size > max(limit, 4.0))
    if rows.sum() > max(_MOST_OUTLIERS * used.sum(), 1):
        return np.zeros_like(rows)
    # a neighbour that sticks out as well makes it structure, not an outlier
    for k in np.flatnonzero(rows):
        near = [j for j in (k - 1, k + 1) if 0 <= j < len(rows) and used[j]]
        if any(size[j] > middle + 0.5 * (size[k] - middle) for j in near):
            rows[k] = False
    return np.asarray(rows)
