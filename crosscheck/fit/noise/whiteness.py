"""Tests whether residuals are white noise: their size, and the correlation of neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import spatial, special

from crosscheck.fit.least_squares.problem import Problem
from seecr.pose import Array, rotvec_from_quat

# Residuals are structured if neighbours are correlated by more than this many standard errors.
STRUCTURED = 4.0
# Residuals with a smaller p-value of chi2 are not noise of the stated size.
POOR_FIT = 1e-3
# Fewer pairs than this say nothing about a correlation.
_LEAST_PAIRS = 8
# Distance, in lengths of the robot, that is put between commands under different loads.
_APART = 1e3
# Beyond so many standard errors 1 - P is lost in doubles, and tail probabilities simply add up.
_TAIL = 5.0


@dataclass(frozen=True)
class Whiteness:
    """Tests of whitened residuals against white noise.

    Attributes:
        chi2: sum of squares. dof: number of readings minus number of parameters.
        p: probability that noise of the stated size has a chi2 at least this large.
        scale: sqrt(chi2/dof), the estimated noise over the stated one.
        lag: correlation of a residual with the next one of its run.
        lag_errors: ``lag`` in standard errors of a single test.
        neighbour: correlation with the residual at the nearest commanded pose.
        neighbour_errors: ``neighbour`` in standard errors of a single test.
    """

    chi2: float
    dof: int
    p: float
    scale: float
    lag: float
    lag_errors: float
    neighbour: float
    neighbour_errors: float

    @property
    def structured(self) -> bool:
        """Whether neighbours are more strongly correlated than noise would be."""
        return max(self.lag_errors, self.neighbour_errors) > STRUCTURED

    @property
    def is_noise(self) -> bool:
        """Whether the residuals are consistent with white noise of the stated size."""
        return self.p > POOR_FIT and not self.structured


def whiteness(problem: Problem, white: Array, parameters: int) -> Whiteness:
    """Test the whitened residuals (N,) of a fit with this many ``parameters``."""
    table = as_table(problem, white)
    dof = max(len(white) - parameters, 1)
    chi2 = float(white @ white)
    lag = agreement(table, next_rows(problem))
    near = agreement(table, nearest_rows(problem))
    return Whiteness(
        chi2=chi2,
        dof=dof,
        p=float(special.chdtrc(dof, chi2)),
        scale=float(np.sqrt(chi2 / dof)),
        lag=lag[0],
        lag_errors=lag[1],
        neighbour=near[0],
        neighbour_errors=near[1],
    )


def as_table(problem: Problem, white: Array) -> Array:
    """Whitened residuals as a table (n, 6 + m), NaN where no reading counts."""
    table = np.full(problem.measured.shape, np.nan)
    table[problem.row_of, problem.column_of] = white
    return table


def agreement(table: Array, pairs: NDArray[np.integer]) -> tuple[float, float]:
    """Largest correlation of residual rows in pairs (k, 2), and its size in standard errors.

    Structure in one channel should not drown in the noise of the others, so all channels together
    and each one by itself are tested, and the strongest result counts. The standard errors are
    corrected for the number of tests, see :func:`best_of`. Both are 0 if nothing is positive.
    """
    product = table[pairs[:, 0]] * table[pairs[:, 1]]
    channels = np.flatnonzero(np.isfinite(product).sum(axis=0))
    groups = [channels, *(np.array([c]) for c in channels if len(channels) > 1)]
    tried = [
        _correlation(table[:, group], product[:, group])
        for group in groups
        if np.isfinite(product[:, group]).sum() >= _LEAST_PAIRS
    ]
    correlation, errors = max(tried, key=lambda found: found[1], default=(0.0, 0.0))
    errors = best_of(errors, len(tried)) if tried else 0.0
    return (correlation, errors) if errors > 0.0 else (0.0, 0.0)


def _correlation(table: Array, product: Array) -> tuple[float, float]:
    """Correlation of pairs from their products (k, c), and its size in standard errors."""
    both = product[np.isfinite(product)]
    power = float(np.nanmean(table**2))
    correlation = float(both.mean() / max(power, 1e-300))
    return correlation, correlation * float(np.sqrt(len(both)))


def best_of(errors: float, tests: int) -> float:
    """The size of a single test that is as improbable as ``errors`` is for the best of ``tests``.

    If P is the probability of a smaller value in one test, it is P^tests for the best (Sidak).
    """
    if errors < _TAIL:
        return float(special.ndtri_exp(tests * special.log_ndtr(errors)))
    return -float(special.ndtri_exp(special.log_ndtr(-errors) + np.log(tests)))


def next_rows(problem: Problem) -> NDArray[np.int64]:
    """Pairs (k, 2) of used rows that follow one another in a run."""
    run, use = problem.data.run_index, problem.use
    rows = np.flatnonzero(use)
    together = run[rows[1:]] == run[rows[:-1]]
    return np.stack([rows[:-1][together], rows[1:][together]], axis=1)


def nearest_rows(problem: Problem) -> NDArray[np.int64]:
    """Pairs (k, 2): each row and the row of the nearest command that is not next to it in time."""
    commands = problem.experiment.commands
    rows = np.flatnonzero(problem.use)
    if len(rows) < _LEAST_PAIRS:
        return np.zeros((0, 2), dtype=int)
    if commands.lengths is not None:
        place = commands.lengths[rows]
    else:
        turn = rotvec_from_quat(commands.pose[rows, 3:]) * problem.robot.length
        place = np.concatenate([commands.pose[rows, :3], turn], axis=1)
    if commands.loads is not None:
        # commands under different loads are not neighbours
        apart = _APART * problem.robot.length * commands.loads.kinds[rows, None]
        place = np.concatenate([place, apart], axis=1)
    tree = spatial.cKDTree(place)
    _distance, index = tree.query(place, k=min(4, len(rows)))
    pairs = set()
    for a, neighbours in enumerate(np.atleast_2d(index)):
        for b in neighbours:
            if b != a and abs(int(rows[b]) - int(rows[a])) > 1:
                pairs.add((min(a, int(b)), max(a, int(b))))
                break
    some = [(rows[a], rows[b]) for a, b in sorted(pairs)]
    return np.array(some, dtype=np.int64).reshape(-1, 2)
