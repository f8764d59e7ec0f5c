"""Measurements made ready: rows without an answer and outliers left out, noise filled in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crosscheck.fit.held_out import blocks_of
from crosscheck.fit.noise import estimate_sigma
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.state import State
from crosscheck.measurements.data import Measurements
from seecr.effects import Terms
from seecr.robot import Robot

Progress = Callable[[str, float], None]
"""Called with what is being done and the part of it that is done, 0 to 1."""

# More rows than this part without an answer, and the data are not fit for a verdict.
_LOST = 0.05
# Rows that stick out by this many robust deviations, alone, are outliers.
_OUTLIER = 6.0
_MOST_OUTLIERS = 0.05


def prepare(robot: Robot, data: Measurements, terms: Terms) -> tuple[Problem, list[str], str]:
    """The problem without rows that have no answer; notes; why there can be no verdict."""
    problem = Problem(robot, data, data.sigma, np.ones(data.n_rows, dtype=bool))
    notes = list(data.notes)
    if not problem.measured.any():
        return problem, notes, "the data hold no readings"
    plain = problem.experiment.predict(terms.effects)
    n = data.n_rows
    for rows, words in (
        (plain.singular, "the platform is free to move there"),
        (~plain.solved & ~plain.singular, "no equilibrium was found there"),
    ):
        if rows.any():
            lines = ", ".join(str(k) for k in data.line[rows][:8])
            more = f" and {int(rows.sum()) - 8} more" if rows.sum() > 8 else ""
            problem = problem.without(rows, f"lines {lines}{more} left out: {words}")
    notes += problem.left_out
    lost = n - int(problem.use.sum())
    why = ""
    if lost > max(_LOST * n, 1) and lost > 1:
        why = f"{lost} of {n} rows have no equilibrium to compare with; see the notes"
    raw = problem.residuals(plain.readings)
    problem, more_notes = estimate_sigma(problem, raw)
    notes += more_notes
    if not why and problem.n_readings < 6:
        why = f"only {problem.n_readings} readings are left"
    if not why and _constant_commands(problem):
        why = "all commands are the same: nothing tells effects apart"
    _blocks, note = blocks_of(problem)
    return problem, [*notes, note] if note else notes, why


def _constant_commands(problem: Problem) -> bool:
    commands = problem.experiment.commands
    table = commands.pose if commands.lengths is None else commands.lengths
    table = table[problem.use]
    return len(table) > 1 and bool(np.all(np.ptp(table, axis=0) == 0))


def noise_floor(problem: Problem, state: State | None = None, scale: float = 1.0) -> Rms:
    """The rms errors that noise alone would give a perfect model, that of lengths included.

    ``scale`` is the noise in units of the stated one.
    """
    raw = np.broadcast_to(problem.reading_sigma, problem.measured.shape).copy()
    if state is not None:
        raw = np.sqrt(np.einsum("nij,nij->ni", state.factor, state.factor))
    return rms_by_kind(problem, scale * raw)


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
