"""A noise model: its size relative to the stated one, and its autocorrelation along runs.

Each channel of readings is an AR(1) process along each run. Two readings that are ``gap`` steps
apart have the correlation rho^gap, where a step is the usual time between rows (or one row if times
are not known). Whitening divides by the size and subtracts what the reading before predicts:

    v_k = (u_k - phi u_before)/sqrt(1 - phi^2),  u = sqrt(weight) r/scale,  phi = rho^gap
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.least_squares.problem import KINDS, Problem, kinds_read
from seecr.pose import Array

# Gap of readings that are so far apart that they are not correlated.
_LONG = 1e3


@dataclass(frozen=True, eq=False)
class Chain:
    """The order in which the counted readings (N,) follow one another.

    Attributes:
        kind: (N,) number of each reading's kind in :data:`KINDS`.
        row: (N,) its row.
        before: (N,) number of the reading before it in its run and channel; -1 for the first.
        gap: (N,) steps since that reading.
    """

    kind: NDArray[np.int64]
    row: NDArray[np.int64]
    before: NDArray[np.int64]
    gap: Array


@dataclass(frozen=True, eq=False)
class Colour:
    """Size and autocorrelation of the noise.

    Attributes:
        scale: (3,) standard deviation of each kind over the stated one.
        rho: (3,) correlation of successive readings of a run.
    """

    scale: Array
    rho: Array

    def by_kind(self, problem: Problem) -> tuple[dict[str, float], dict[str, float]]:
        """Scale and rho, by the name of each kind of reading in the data."""
        kinds = {KINDS.index(kind): kind.name for kind in kinds_read(problem)}
        return (
            {name: float(self.scale[k]) for k, name in kinds.items()},
            {name: float(self.rho[k]) for k, name in kinds.items()},
        )

    def hotter(self, factor: float) -> Colour:
        """The same noise with standard deviations larger by a factor."""
        return replace(self, scale=self.scale * factor)


WHITE = Colour(np.ones(len(KINDS)), np.zeros(len(KINDS)))


def chain_of(problem: Problem) -> Chain:
    """The order of a problem's counted readings."""
    row, column = problem.row_of, problem.column_of
    kind = np.array([_kind_of(c) for c in range(problem.measured.shape[1])])[column]
    run = problem.data.run_index[row]
    order = np.lexsort((row, column, run))
    follows = (run[order][1:] == run[order][:-1]) & (column[order][1:] == column[order][:-1])
    before = np.full(len(row), -1, dtype=np.int64)
    before[order[1:][follows]] = order[:-1][follows]
    return Chain(kind, row, before, _gaps(problem, row, before))


def _kind_of(column: int) -> int:
    return next(
        k for k, kind in enumerate(KINDS) if column in range(*kind.columns.indices(column + 1))
    )


def _gaps(problem: Problem, row: NDArray[np.int64], before: NDArray[np.int64]) -> Array:
    """(N,) steps between readings, by time if it is known, else by rows."""
    clock = problem.data.t_s
    if clock is None:
        clock = np.arange(problem.data.n_rows, dtype=float)
    # rows that did not come from a file need not follow in time
    since = np.where(before < 0, np.nan, np.abs(clock[row] - clock[row[before]]))
    # rows with the same time are taken to be one usual step apart
    usual = float(np.median(since[since > 0.0])) if (since > 0.0).any() else 1.0
    return np.nan_to_num(np.where(since == 0.0, usual, since) / usual, nan=_LONG)


def foretold(chain: Chain, colour: Colour) -> Array:
    """(N,) phi: correlation of each reading's noise with that of the reading before."""
    rho = colour.rho[chain.kind]
    return np.where(chain.before < 0, 0.0, rho ** np.minimum(chain.gap, _LONG))


def whitened(chain: Chain, colour: Colour, weight: Array, values: Array) -> Array:
    """Whiten residuals (N,) or derivatives (N, p).

    Args:
        chain: the order of the readings.
        colour: the noise.
        weight: (N,) 1, or less for a reading that counts as noisier than the others.
        values: residuals or derivatives, in units of the stated noise.
    """
    return apart_from_before(chain, colour, scaled(chain, colour, weight, values))


def scaled(chain: Chain, colour: Colour, weight: Array, values: Array) -> Array:
    """The first step of whitening: (N,) or (N, p) in units of the noise's size."""
    size = np.sqrt(weight) / colour.scale[chain.kind]
    return np.asarray(values * _along(values, size))


def apart_from_before(chain: Chain, colour: Colour, unit: Array) -> Array:
    """The second step: each scaled reading less what the one before predicts, at unit size."""
    phi = foretold(chain, colour)
    if not phi.any():
        return unit
    left = unit - _along(unit, phi) * unit[np.maximum(chain.before, 0)]
    return np.asarray(left / _along(unit, np.sqrt(1.0 - phi**2)))


def _along(values: Array, factor: Array) -> Array:
    """Factors (N,) as they multiply values (N,) or (N, p)."""
    return factor if values.ndim == 1 else factor[:, None]


def log_det(chain: Chain, colour: Colour, weight: Array) -> float:
    """Log determinant of the noise's covariance relative to that of the stated noise."""
    phi = foretold(chain, colour)
    sizes = 2.0 * np.log(colour.scale[chain.kind]) - np.log(weight)
    return float(np.sum(sizes) + np.sum(np.log1p(-(phi**2))))
