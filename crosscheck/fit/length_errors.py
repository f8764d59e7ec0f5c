"""Most likely errors of noisy commanded lengths, row by row (errors in variables).

For each row the sum of squares of readings and of length errors, in units of their noise, is least
at the most likely errors. Gauss-Newton finds them in a step or two, except where a cable is about
to go slack: there the readings have a kink, and straight lines lead from either side to beyond it.
Both sides are known from the taut one: a slack cable moves the platform as a taut one would that is
always lengthened to zero tension. So steps that would slacken a cable lead to the best errors with
it slack, or to the best ones on the kink. The other way round no line leads anywhere, because the
length of a slack cable changes no reading. So a search from scratch is repeated from where the
slack cables are just taut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import TENSION, Problem, noise_factors
from seecr.compiled.columns import REST, STRAIN
from seecr.effects.base import Effect
from seecr.pose import Array
from seecr.prediction.experiment import Prediction, mixed

# Rounds of the search from scratch and from a nearby state, and the least step, in units of noise.
_ROUNDS, _ROUNDS_NEAR, _STEP = 8, 3, 1e-2
# How often rows are searched again from where their slack cables are taut, and by how much [m].
_TAUTENED, _JUST = 3, 1e-6
# Errors on a kink are sought on its taut side, so far from it in units of the standard deviation
# that the readings leave to the tension.
_TAUT_BY = 1e-2


def with_length_errors(
    problem: Problem, effects: Sequence[Effect], errors: Array | None, near: Prediction | None
) -> Rows:
    """The rows with the most likely errors of their lengths, and the noise about these.

    From ``errors`` (n, m) [m] if there are any, and a prediction near them; without one, more
    rounds are made.
    """
    if errors is None:
        errors = np.zeros((problem.data.n_rows, problem.data.n_cables))
    found = _searched(problem, effects, errors, near, patient=near is None)
    if near is not None or found.prediction.has_history:
        return found
    for _ in range(_TAUTENED):
        # the readings do not change with a slack cable's length, so no step makes it taut
        taut = found.tautened()
        start = Rows.predicted(problem, effects, taut, found.prediction).prediction
        other = _searched(problem, effects, taut, start, patient=True)
        better = problem.use & (other.cost(problem) < found.cost(problem) - _STEP)
        if not better.any():
            break
        found = found.with_rows(other, better)
    return found


def _searched(
    problem: Problem,
    effects: Sequence[Effect],
    errors: Array,
    near: Prediction | None,
    *,
    patient: bool,
) -> Rows:
    """The rows at the least cost that a search from these errors (n, m) finds.

    If it is not patient, it has few rounds and ends with the first row that is not solved.
    """
    here = Rows.predicted(problem, effects, errors, near)
    base = here.lines  # where the straight lines of each row's next step are from
    away = np.zeros(len(errors), dtype=bool)  # rows where that is another place than here
    share = np.ones(len(errors))  # length of each row's step, as a fraction of the full one
    together = True
    for _ in range(_ROUNDS if patient else _ROUNDS_NEAR):
        step = base.likeliest(problem) - here.lines.errors
        size = np.max(np.abs(step) / problem.length_sigma, axis=1, initial=0.0)
        moving = problem.use & (share * size > _STEP)
        if not moving.any():
            break
        moved = here.lines.errors + (share * moving)[:, None] * step
        trial = Rows.predicted(problem, effects, moved, here.prediction)
        better = moving & (trial.cost(problem) <= here.cost(problem))
        # a cable that went taut shows both sides of the kink from there
        away = moving & ~better & ~away & trial.solved & trial.lines.is_tauter(here.lines)
        shorter = np.where(moving & ~away, 0.3 * share, share)
        share = np.where(better, np.minimum(2.0 * share, 1.0), shorter)
        together = bool((better == moving).all())
        here = trial if together else here.with_rows(trial, better)
        base = here.lines.with_rows(trial.lines, away) if away.any() else here.lines
        if not patient and not here.solved[problem.use].all():
            break  # without a row the model has no chi2, wherever the others are
    if not together and here.prediction.has_history:
        here = Rows.predicted(problem, effects, here.lines.errors, here.prediction)
    return here


@dataclass(frozen=True, eq=False)
class Lines:
    """Residuals of rows as straight lines in the errors of their lengths, about some errors.

    Attributes:
        errors: (n, m) [m]. raw: (n, 6 + m) residuals there.
        rate: (n, 6 + m, m) derivative of what is read by the lengths.
        pull: (n, m) [N] tensions there.
        factor: (n, 6 + m, 6 + m) Cholesky factors of the noise of readings and lengths together.
    """

    errors: Array
    raw: Array
    rate: Array
    pull: Array
    factor: Array

    def with_rows(self, other: Lines, rows: NDArray[np.bool_]) -> Lines:
        """The same with some rows (n,) of another."""
        return Lines(
            *(
                mixed(rows, getattr(self, name), getattr(other, name))
                for name in ("errors", "raw", "rate", "pull", "factor")
            )
        )

    def is_tauter(self, other: Lines) -> NDArray[np.bool_]:
        """(n,) whether a cable pulls here and not in the other, and none the other way round."""
        mine, its = self.pull > 0.0, other.pull > 0.0
        return np.asarray((mine & ~its).any(axis=1) & ~(its & ~mine).any(axis=1))

    def at_commands(self) -> Array:
        """Residuals (n, 6 + m) at the commanded lengths."""
        return self.raw + (self.rate @ self.errors[..., None])[..., 0]

    def likeliest(self, problem: Problem) -> Array:
        """Most likely errors of the lengths (n, m) given the readings."""
        read = np.where(problem.measured, self.at_commands(), 0.0)
        best = Likely.given(read, self.rate, self.factor, problem.length_sigma, problem.measured)
        kinks = self._first_kinks(best.errors)
        if len(kinks.rows) == 0:
            return best.errors
        out = best.errors.copy()
        out[kinks.rows] = kinks.likeliest(problem, best)
        return out

    def _first_kinks(self, errors: Array) -> Kinks:
        """The first cables that go slack on the way to other errors (n, m), at most one per row."""
        slopes = self.rate[:, TENSION]
        change = (slopes @ (errors - self.errors)[..., None])[..., 0]
        own = np.diagonal(slopes, axis1=1, axis2=2)
        slackens = (self.pull > 0.0) & (self.pull + change < 0.0) & (own < 0.0)
        part = np.where(slackens, self.pull / np.where(slackens, -change, 1.0), np.inf)
        rows = np.flatnonzero(slackens.any(axis=1))
        cables = np.argmin(part[rows], axis=1)
        slope = slopes[rows, cables]
        at_none = self.pull[rows, cables] - (slope * self.errors[rows]).sum(axis=1)
        return Kinks(rows, cables, slope, at_none)


@dataclass(frozen=True, eq=False)
class Likely:
    """Most likely errors of rows' lengths for readings that are straight lines in them.

    Attributes:
        errors: (n, m) [m].
        read: (n, 6 + m) residuals at no errors. rate: (n, 6 + m, m); both 0 where nothing was read.
        white_rate: (n, 6 + m, m) the rate in units of the noise of readings and lengths.
        spread: (n, 1) [m] standard deviation of the lengths before the readings are known.
    """

    errors: Array
    read: Array
    rate: Array
    white_rate: Array
    spread: Array

    @classmethod
    def given(
        cls, read: Array, rate: Array, factor: Array, spread: Array, measured: NDArray[np.bool_]
    ) -> Likely:
        """The same from residuals, rates and the Cholesky factors of their noise."""
        rate = np.where(measured[..., None], rate, 0.0)
        white = np.linalg.solve(factor, np.concatenate([read[..., None], rate], axis=2))
        along = np.swapaxes(white[..., 1:], 1, 2) @ white[..., :1]
        return cls(spread**2 * along[..., 0], read, rate, white[..., 1:], spread)

    def covariance_times(self, rows: NDArray[np.intp], vectors: Array) -> Array:
        """Covariance of the errors of some rows, given the readings, times vectors (k, m)."""
        white, spread = self.white_rate[rows], self.spread[rows]
        seen = np.swapaxes(white, 1, 2) @ (white @ (spread**2 * vectors)[..., None])
        return np.asarray(spread**2 * (vectors - seen[..., 0]))


@dataclass(frozen=True, eq=False)
class Kinks:
    """Rows whose most likely errors would slacken a cable that is taut, one in each row.

    Attributes:
        rows, cables: (k,) their indices.
        slope: (k, m) [N/m] derivative of the cable's tension by the lengths.
        at_none: (k,) [N] its tension at no errors, along that slope.
    """

    rows: NDArray[np.intp]
    cables: NDArray[np.intp]
    slope: Array
    at_none: Array

    def pull(self, errors: Array) -> Array:
        """Tension (k,) of the cables at errors (k, m) of their rows' lengths."""
        return np.asarray(self.at_none + (self.slope * errors).sum(axis=1))

    def likeliest(self, problem: Problem, taut: Likely) -> Array:
        """Most likely errors (k, m): slack, or on the kink; ``taut`` if the cable could push."""
        slack = self._slack(problem, taut)
        is_slack = self.pull(slack) <= 0.0
        return np.where(is_slack[:, None], slack, self._on_kink(taut))

    def _slack(self, problem: Problem, taut: Likely) -> Array:
        """Most likely errors if the cable stays without tension, whatever its length."""
        k = np.arange(len(self.rows))
        spread, measured = taut.spread[self.rows], problem.measured[self.rows]
        rate = taut.rate[self.rows]
        by_cable = rate[k, :, self.cables] / self.slope[k, self.cables][:, None]
        read = taut.read[self.rows] + by_cable * self.at_none[:, None]
        rate = rate - by_cable[..., None] * self.slope[:, None, :]
        own = np.where(measured, problem.reading_sigma[self.rows], 1.0)
        factor = noise_factors(own, rate * spread[:, None])
        return Likely.given(read, rate, factor, spread, measured).errors

    def _on_kink(self, taut: Likely) -> Array:
        """Most likely errors at which the cable is just taut."""
        errors = taut.errors[self.rows]
        along = taut.covariance_times(self.rows, self.slope)
        variance = np.maximum((self.slope * along).sum(axis=1), 1e-300)
        beyond = self.pull(errors) - _TAUT_BY * np.sqrt(variance)
        return np.asarray(errors - along * (beyond / variance)[:, None])


@dataclass(eq=False)
class Rows:
    """Rows with given errors of their lengths, and their residuals about these."""

    prediction: Prediction
    solved: NDArray[np.bool_]
    lines: Lines

    @classmethod
    def predicted(
        cls, problem: Problem, effects: Sequence[Effect], errors: Array, start: Prediction | None
    ) -> Rows:
        at = problem.experiment.with_length_errors(errors).predict(effects, start)
        rate = problem.by_length(at)
        pull = np.where(at.slack, 0.0, at.readings.tensions)
        raw = problem.residuals(at.readings)
        return cls(at, at.solved, Lines(errors, raw, rate, pull, problem.noise_about(rate)))

    def with_rows(self, other: Rows, rows: NDArray[np.bool_]) -> Rows:
        """These rows, some replaced by another's; with history, the prediction is approximate."""
        there = other.prediction
        return Rows(
            prediction=there if there.has_history else self.prediction.with_rows(there, rows),
            solved=np.where(rows, other.solved, self.solved),
            lines=self.lines.with_rows(other.lines, rows),
        )

    def tautened(self) -> Array:
        """Errors (n, m) of the lengths at which the slack cables would be just taut."""
        at = self.prediction
        slack_by = -at.found.states[..., STRAIN] * at.tables.cables[..., REST]
        return self.lines.errors - np.where(at.slack, np.maximum(slack_by, 0.0) + _JUST, 0.0)

    def cost(self, problem: Problem) -> Array:
        """(n,) sum of squares of readings and length errors, in units of their noise."""
        at = self.lines
        filled = np.where(problem.measured & np.isfinite(at.raw), at.raw, 0.0)
        cost = ((filled / problem.reading_sigma) ** 2).sum(axis=1)
        cost = cost + ((at.errors / problem.length_sigma) ** 2).sum(axis=1)
        return np.where(self.solved, cost, np.inf)
