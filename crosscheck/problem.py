"""Measurements as a weighted least-squares problem: residuals, their noise, their rows.

A residual is measured less predicted: position [m], orientation as the rotation vector from the
predicted to the measured one [rad] (or the differences of those angles that were read), tension
[N]. The noise of a row is that of its readings plus that of the commanded lengths, which reaches
the readings through the robot's own sensitivity:

    Sigma = diag(sigma^2) + (dy/dl0) sigma_length^2 (dy/dl0)^T

Residuals are whitened by its Cholesky factor, so that noise alone has unit variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements import Measurements
from crosscheck.sigma import Sigma
from seecr.effects.base import Effect, Readings
from seecr.experiment import Experiment, Prediction
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)
from seecr.robot import Robot
from seecr.sensitivity import Term, effects_of, length_sensitivities, sensitivities
from seecr.setup import Commands

# Rounds of finding the likeliest errors of commanded lengths.
_LENGTH_ROUNDS = 8
# A row is far off beyond this mean square of its whitened residuals; only where few rows are
# (this part of all), it may be that they rest in another equilibrium.
_FAR_OFF, _FEW_ROWS = 25.0, 0.25
# Columns of a residual row: position, orientation, then tensions.
POSITION, ORIENTATION, TENSION = slice(0, 3), slice(3, 6), slice(6, None)
KINDS = ("position", "orientation", "tension")


def commands_of(robot: Robot, data: Measurements) -> Commands:
    """The commands of measurements, as the statics takes them."""
    poses = data.command_pose
    if poses is None:
        poses = np.tile(robot.reference_pose, (data.n_rows, 1))
    return Commands(
        pose=np.asarray(poses, float),
        lengths=data.command_lengths,
        run=data.run_index,
        time=data.t_s,
        temperature=data.temperature_C,
    )


@dataclass(eq=False)
class Problem:
    """Readings of a robot, with their noise.

    Attributes:
        robot, data: what was measured.
        sigma: noise of each kind of reading; every kind that was read has a number.
        use: (n,) bool rows that count; others were left out, see ``left_out``.
        left_out: sentences that name the rows left out and why.
    """

    robot: Robot
    data: Measurements
    sigma: Sigma
    use: NDArray[np.bool_]
    left_out: tuple[str, ...] = ()
    experiment: Experiment = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.experiment = Experiment(self.robot, commands_of(self.robot, self.data))

    def without(self, rows: NDArray[np.bool_], why: str) -> Problem:
        """The same problem with some rows left out, sharing what is already computed."""
        return self._like(use=self.use & ~rows, left_out=(*self.left_out, why))

    def only(self, rows: NDArray[np.bool_]) -> Problem:
        """The same problem on some of its rows."""
        return self._like(use=self.use & rows)

    def with_sigma(self, sigma: Sigma) -> Problem:
        """The same problem with other noise."""
        return self._like(sigma=sigma)

    def _like(self, **changes: object) -> Problem:
        other = replace(self, **changes)  # type: ignore[arg-type]
        other.experiment = self.experiment
        return other

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """(n, 6 + m) which readings there are."""
        data = self.data
        if data.quat_wxyz is not None:
            whole = np.asarray(np.isfinite(data.quat_wxyz).all(axis=1))
            turned = np.repeat(whole[:, None], 3, axis=1)
        else:
            turned = np.asarray(np.isfinite(data.angles_rad))
        return np.concatenate(
            [np.isfinite(data.position), turned, np.isfinite(data.tensions)], axis=1
        )

    @property
    def counted(self) -> NDArray[np.bool_]:
        """(n, 6 + m) readings that count."""
        return self.measured & self.use[:, None]

    @cached_property
    def row_of(self) -> NDArray[np.int64]:
        """Row of each counted residual, in the order of whitened vectors."""
        return np.nonzero(self.counted)[0]

    @cached_property
    def column_of(self) -> NDArray[np.int64]:
        """Column of each counted residual."""
        return np.nonzero(self.counted)[1]

    @property
    def n_readings(self) -> int:
        """Number of counted readings."""
        return int(self.counted.sum())

    @property
    def uses_angles(self) -> bool:
        """Whether the orientation was read as some angles only."""
        return self.data.quat_wxyz is None

    def residuals(self, readings: Readings) -> Array:
        """Measured less predicted, (n, 6 + m), NaN where nothing was read."""
        data = self.data
        if data.quat_wxyz is not None:
            turn = quat_multiply(data.quat_wxyz, quat_conjugate(readings.quat_wxyz))
            turned = np.full((data.n_rows, 3), np.nan)
            known = np.isfinite(turn).all(axis=1)
            turned[known] = rotvec_from_quat(turn[known])
        else:
            turned = data.angles_rad - rxyz_from_quat(readings.quat_wxyz)
            turned = (turned + np.pi) % (2 * np.pi) - np.pi
        return np.concatenate(
            [data.position - readings.position, turned, data.tensions - readings.tensions],
            axis=1,
        )

    def as_read(self, change: Array, readings: Readings) -> Array:
        """Derivatives (n, 6 + m, p) by rotation vector turned into those of what was read."""
        if not self.uses_angles:
            return change
        change = change.copy()
        change[:, ORIENTATION] = np.einsum(
            "nij,njp->nip", angle_rates(readings.quat_wxyz), change[:, ORIENTATION]
        )
        return change

    @property
    def reading_sigma(self) -> Array:
        """(6 + m,) noise of each reading."""
        return np.concatenate(
            [
                np.full(3, self.sigma.position_m or 1.0),
                np.full(3, self.sigma.orientation_rad or 1.0),
                np.full(self.data.n_cables, self.sigma.tension_N or 1.0),
            ]
        )

    def noise(self, at: Prediction) -> Array:
        """Cholesky factors of each row's noise, (n, 6 + m, 6 + m); 1 where nothing was read."""
        n, width = self.measured.shape
        sigma = self.reading_sigma
        covariance = np.zeros((n, width, width))
        if self.sigma.length_m:
            rate = self.as_read(length_sensitivities(at), at.readings)
            covariance = np.einsum("nik,njk->nij", rate, rate) * self.sigma.length_m**2
        covariance[:, np.arange(width), np.arange(width)] += sigma**2
        blank = ~self.measured
        covariance = np.where(blank[:, :, None] | blank[:, None, :], 0.0, covariance)
        index = np.arange(width)
        covariance[:, index, index] += np.where(blank, 1.0, 0.0)
        return np.asarray(np.linalg.cholesky(covariance), float)

    def whiten(self, factor: Array, values: Array) -> Array:
        """Counted residuals (N,) or derivatives (N, p), in units of their noise."""
        single = values.ndim == 2
        table = values[..., None] if single else values
        table = np.where(self.measured[..., None], table, 0.0)
        white: Array = in_units_of(factor, table, bool(self.sigma.length_m))[self.counted]
        return white[:, 0] if single else white


def in_units_of(factor: Array, table: Array, correlated: bool) -> Array:
    """Residuals or derivatives (n, k, p) in units of their noise, by its Cholesky factors."""
    if correlated:
        return np.asarray(np.linalg.solve(factor, table), float)
    return table / np.diagonal(factor, axis1=1, axis2=2)[..., None]


def angle_rates(quat_wxyz: Array) -> Array:
    """d(rx, ry, rz)/d(rotation vector in the base frame), (n, 3, 3)."""
    step = 1e-6
    rates = np.zeros((len(quat_wxyz), 3, 3))
    for k in range(3):
        turn = np.zeros(3)
        turn[k] = step
        ahead = rxyz_from_quat(quat_multiply(quat_from_rotvec(turn), quat_wxyz))
        behind = rxyz_from_quat(quat_multiply(quat_from_rotvec(-turn), quat_wxyz))
        rates[..., k] = (ahead - behind) / (2 * step)
    return rates


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
    return _with_length_errors(problem, terms, experiment.length_errors, start)


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


def _with_length_errors(
    problem: Problem, terms: Sequence[Term], errors: Array | None, start: Prediction | None
) -> State:
    """The likeliest errors of the commanded lengths, row by row, and the noise about them."""
    effects, spread = effects_of(terms), problem.sigma.length_m or 1.0
    if errors is None:
        errors = np.zeros((problem.data.n_rows, problem.data.n_cables))
    here = _At(problem, effects, errors, spread, start)
    share = np.ones(len(errors))  # of the full step, a row
    for _ in range(_LENGTH_ROUNDS):
        step = here.better_errors() - here.errors
        size = np.max(np.abs(step), axis=1, initial=0.0)
        moving = problem.use & (share * size > 1e-2 * spread)
        if not moving.any():
            break
        trial = _At(
            problem, effects, here.errors + (share * moving)[:, None] * step, spread,
            here.prediction,
        )  # fmt: skip
        better = moving & (trial.cost <= here.cost)
        share = np.where(better, np.minimum(2.0 * share, 1.0), np.where(moving, 0.3 * share, share))
        if better.all() or (better == moving).all():
            here = trial
        elif better.any():
            mixed = np.where(better[:, None], trial.errors, here.errors)
            here = _At(problem, effects, mixed, spread, here.prediction)
    return _compared(
        problem, terms, here.prediction, here.linear_raw(), here.factor, here.experiment
    )


class _At:
    """A prediction with given errors of the lengths, and what the readings say of them."""

    def __init__(
        self,
        problem: Problem,
        effects: Sequence[Effect],
        errors: Array,
        spread: float,
        start: Prediction | None,
    ) -> None:
        self.problem, self.errors, self.spread = problem, errors, spread
        self.experiment = problem.experiment.with_length_errors(errors)
        self.prediction = self.experiment.predict(effects, start)
        self.raw = problem.residuals(self.prediction.readings)
        filled = np.where(problem.measured & np.isfinite(self.raw), self.raw, 0.0)
        cost = ((filled / problem.reading_sigma) ** 2).sum(axis=1)
        cost = cost + ((errors / spread) ** 2).sum(axis=1)
        self.cost = np.where(self.prediction.solved, cost, np.inf)

    @cached_property
    def rate(self) -> Array:
        return self.problem.as_read(
            length_sensitivities(self.prediction), self.prediction.readings
        )

    @cached_property
    def factor(self) -> Array:
        return self.problem.noise(self.prediction)

    def linear_raw(self) -> Array:
        """Residuals as they would be at the commanded lengths, to first order."""
        return self.raw + np.einsum("nkm,nm->nk", self.rate, self.errors)

    def better_errors(self) -> Array:
        weighed = _precision_times(self.problem, self.factor, self.linear_raw())
        return self.spread**2 * np.einsum("nkm,nk->nm", self.rate, weighed)


def _precision_times(problem: Problem, factor: Array, raw: Array) -> Array:
    """Sigma^-1 raw, (n, 6 + m), 0 where nothing was read."""
    filled = np.where(problem.measured, raw, 0.0)[..., None]
    half = np.linalg.solve(factor, filled)
    return np.linalg.solve(np.swapaxes(factor, 1, 2), half)[..., 0]


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
    factor: Array,
    columns: Sequence[int] = (),
    frozen: bool = False,
) -> Array:
    """Whitened derivative of the prediction by the terms' parameters, (N, p)."""
    rates = sensitivities(state.experiment, state.terms, state.prediction, columns, frozen)
    return problem.whiten(state.factor, problem.as_read(rates, state.prediction.readings))
