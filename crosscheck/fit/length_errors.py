"""Errors of commanded lengths, found beside the model (errors in variables).

Where commanded lengths are noisy, the errors they most likely had are found row by row, by
damped Gauss-Newton, and the noise is propagated there: cables that go slack at the commanded
lengths may well have been taut at the true ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from seecr.effects.base import Effect
from seecr.experiment import Prediction
from seecr.pose import Array

# Rounds of finding the likeliest errors: afresh, and from a state nearby.
_ROUNDS, _ROUNDS_NEAR = 8, 3


def with_length_errors(
    problem: Problem, effects: Sequence[Effect], errors: Array | None, near: Prediction | None
) -> Rows:
    """The rows with the likeliest errors of their lengths, and the noise about them.

    Args:
        problem: readings and noise, that of lengths included.
        effects: of the model.
        errors: (n, m) [m] to start from, or None.
        near: a prediction to start from, or None: then more rounds are made.
    """
    spread = problem.sigma.length_m or 1.0
    if errors is None:
        errors = np.zeros((problem.data.n_rows, problem.data.n_cables))
    here = Rows.predicted(problem, effects, errors, near)
    share = np.ones(len(errors))  # of the full step, a row
    together = True
    for _ in range(_ROUNDS if near is None else _ROUNDS_NEAR):
        step = here.better_errors(problem, spread) - here.length_errors
        size = np.max(np.abs(step), axis=1, initial=0.0)
        moving = problem.use & (share * size > 1e-2 * spread)
        if not moving.any():
            break
        moved = here.length_errors + (share * moving)[:, None] * step
        trial = Rows.predicted(problem, effects, moved, here.prediction)
        better = moving & (trial.cost(problem, spread) <= here.cost(problem, spread))
        share = np.where(better, np.minimum(2.0 * share, 1.0), np.where(moving, 0.3 * share, share))
        together = bool((better == moving).all())
        here = trial if together else here.with_rows(trial, better)
    if not together:
        here = Rows.predicted(problem, effects, here.length_errors, here.prediction)
    return here


@dataclass(eq=False)
class Rows:
    """Rows with given errors of their lengths, and what the readings say of them."""

    length_errors: Array
    prediction: Prediction
    solved: NDArray[np.bool_]
    raw: Array
    rate: Array  # (n, 6 + m, m) derivative of what was read by the lengths
    factor: Array

    @classmethod
    def predicted(
        cls, problem: Problem, effects: Sequence[Effect], errors: Array, start: Prediction | None
    ) -> Rows:
        at = problem.experiment.with_length_errors(errors).predict(effects, start)
        rate = problem.by_length(at)
        raw = problem.residuals(at.readings)
        return cls(errors, at, at.solved, raw, rate, problem.noise_about(rate))

    def with_rows(self, other: Rows, rows: NDArray[np.bool_]) -> Rows:
        """The same with some rows of another; the prediction is only near that."""

        def mixed(mine: Array, theirs: Array) -> Array:
            return np.where(rows.reshape(-1, *[1] * (mine.ndim - 1)), theirs, mine)

        return Rows(
            length_errors=mixed(self.length_errors, other.length_errors),
            prediction=other.prediction,
            solved=np.where(rows, other.solved, self.solved),
            raw=mixed(self.raw, other.raw),
            rate=mixed(self.rate, other.rate),
            factor=mixed(self.factor, other.factor),
        )

    def cost(self, problem: Problem, spread: float) -> Array:
        """(n,) sum of squares of readings and length errors, in units of their noise."""
        filled = np.where(problem.measured & np.isfinite(self.raw), self.raw, 0.0)
        cost = ((filled / problem.reading_sigma) ** 2).sum(axis=1)
        cost = cost + ((self.length_errors / spread) ** 2).sum(axis=1)
        return np.where(self.solved, cost, np.inf)

    def linear_raw(self) -> Array:
        """Residuals as they would be at the commanded lengths, to first order."""
        return self.raw + (self.rate @ self.length_errors[..., None])[..., 0]

    def better_errors(self, problem: Problem, spread: float) -> Array:
        """Errors of the lengths (n, m) that the readings make likeliest, to first order."""
        weighed = _precision_times(problem, self.factor, self.linear_raw())
        return spread**2 * (np.swapaxes(self.rate, 1, 2) @ weighed[..., None])[..., 0]


def _precision_times(problem: Problem, factor: Array, raw: Array) -> Array:
    """Sigma^-1 raw, (n, 6 + m), 0 where nothing was read."""
    filled = np.where(problem.measured, raw, 0.0)[..., None]
    half = np.linalg.solve(factor, filled)
    return np.linalg.solve(np.swapaxes(factor, 1, 2), half)[..., 0]
