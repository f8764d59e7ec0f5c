"""A model at given values on a problem: predicted, compared, and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.length_errors import with_length_errors
from crosscheck.fit.problem import Problem, in_units_of
from seecr.experiment import Experiment, Prediction
from seecr.pose import Array
from seecr.sensitivity import Term, effects_of, sensitivities

# A row is far off beyond this mean square of its whitened residuals; only where few rows are
# (this part of all), it may be that they rest in another equilibrium.
_FAR_OFF, _FEW_ROWS = 25.0, 0.25


@dataclass(eq=False)
class State:
    """A model at given values on a problem.

    Attributes:
        terms: the effects with their values.
        prediction: of all rows; where commanded lengths are noisy, with their likeliest errors.
        raw: (n, 6 + m) residuals of the commanded lengths in their units, NaN where not read.
        table: (n, 6 + m) the same in units of their noise.
        white: (N,) those that count.
        factor: (n, 6 + m, 6 + m) Cholesky factors of the noise.
        chi2: sum of squares of ``white``; inf where a counted row was not solved.
        log_det: log determinant of the counted rows' noise, less that of the readings alone.
        experiment: with the likeliest length errors.
    """

    terms: tuple[Term, ...]
    prediction: Prediction
    raw: Array
    table: Array
    white: Array
    factor: Array
    chi2: float
    log_det: float
    experiment: Experiment

    @property
    def valid(self) -> bool:
        """Whether every counted row was solved."""
        return bool(np.isfinite(self.chi2))

    def of(self, terms: Sequence[Term]) -> State:
        """The same state seen as that of other terms (some more, at null)."""
        return replace(self, terms=tuple(terms))


def evaluate(
    problem: Problem, terms: Sequence[Term], factor: Array, near: State | None = None
) -> State:
    """Predict with the terms and compare.

    Where commanded lengths are noisy, the errors they most likely had are found row by row
    (Gauss-Newton on errors in variables), and the noise is propagated there: cables that go
    slack at the commanded lengths may well have been taut at the true ones.

    Args:
        problem: readings and noise.
        terms: effects with values.
        factor: :meth:`Problem.noise`; used as it is where commanded lengths are exact.
        near: a state to start from.
    """
    effects = effects_of(terms)
    experiment = problem.experiment if near is None else near.experiment
    start = None if near is None else near.prediction
    if not problem.sigma.length_m:
        prediction = experiment.predict(effects, start)
        raw = problem.residuals(prediction.readings)
        state = _compared(problem, terms, prediction, raw, factor, experiment)
        return _on_measured_branch(problem, state)
    at = with_length_errors(problem, effects, experiment.length_errors, start)
    experiment = experiment.with_length_errors(at.length_errors)
    return _compared(problem, terms, at.prediction, at.linear_raw(), at.factor, experiment)


def _on_measured_branch(problem: Problem, state: State) -> State:
    """Where a few rows are far off, take the equilibrium nearest to the measured pose.

    A platform with slack cables can have several stable equilibria. Which one the robot came to
    rest in is what the reading says; the model has only to have it.
    """
    data, at = problem.data, state.prediction
    if data.quat_wxyz is None or at.has_history or at.setup.laws or problem.robot.joints:
        return state
    size = np.nanmean(np.where(problem.measured, state.table, np.nan) ** 2, axis=1)
    whole = np.isfinite(data.position).all(axis=1) & np.isfinite(data.quat_wxyz).all(axis=1)
    rows = np.flatnonzero(problem.use & whole & ((size > _FAR_OFF) | ~at.solved))
    if len(rows) == 0 or len(rows) > _FEW_ROWS * problem.use.sum():
        return state
    poses = np.concatenate([data.position, data.quat_wxyz], axis=1)[rows]
    effects = effects_of(state.terms)
    other = state.experiment.from_other_starts(effects, at, rows, poses)
    there = _compared(
        problem, state.terms, other, problem.residuals(other.readings), state.factor,
        state.experiment,
    )  # fmt: skip
    better = np.nansum(there.table**2, axis=1) < 0.5 * np.nansum(state.table**2, axis=1)
    better = (better | ~at.solved) & other.solved
    keep = rows[better[rows]]
    if len(keep) == 0:
        return state
    mixed = state.experiment.from_other_starts(effects, at, keep, other.poses[keep])
    return _compared(
        problem, state.terms, mixed, problem.residuals(mixed.readings), state.factor,
        state.experiment,
    )  # fmt: skip


def _compared(
    problem: Problem,
    terms: Sequence[Term],
    prediction: Prediction,
    raw: Array,
    factor: Array,
    experiment: Experiment,
) -> State:
    filled = np.where(problem.measured & np.isfinite(raw), raw, 0.0)
    table = in_units_of(factor, filled[..., None], bool(problem.sigma.length_m))[..., 0]
    white = table[problem.counted]
    valid = bool(np.all(prediction.solved[problem.use])) and bool(np.all(np.isfinite(white)))
    chi2 = float(white @ white) if valid else np.inf
    diagonal = np.log(np.diagonal(factor, axis1=1, axis2=2)) - np.log(problem.reading_sigma)
    log_det = 2.0 * float(diagonal[problem.counted].sum()) if problem.sigma.length_m else 0.0
    return State(
        tuple(terms), prediction, raw, np.where(problem.measured, table, np.nan), white, factor,
        chi2, log_det, experiment,
    )  # fmt: skip


def derivatives(
    problem: Problem,
    state: State,
    columns: Sequence[int] = (),
    frozen: bool = False,
) -> Array:
    """Whitened derivative of the prediction by the terms' parameters, (N, p)."""
    rates = sensitivities(state.experiment, state.terms, state.prediction, columns, frozen)
    return problem.whiten(state.factor, problem.as_read(rates, state.prediction.readings))
