"""Noise as it is: its size beside the stated one, and how it goes together along a run.

Each channel of readings is AR(1) along each run. Between two readings ``gap`` steps apart the
correlation is rho^gap, where a step is the usual time between rows (or one row, where there is no
time). Whitening divides by the size and takes off what the reading before foretells:

    v_k = (u_k - phi u_before)/sqrt(1 - phi^2),  u = sqrt(weight) r/scale,  phi = rho^gap
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import KINDS, Problem, kinds_read
from seecr.pose import Array

# Readings far apart in time: nothing of the one before is left.
_LONG = 1e3


@dataclass(frozen=True, eq=False)
class Chain:
    """How the counted readings (N,) follow one another.

    Attributes:
        kind: (N,) number of each reading's kind in :data:`KINDS`.
        row: (N,) its row.
        before: (N,) the reading before it in its run and channel; -1 for the first.
        gap: (N,) steps since then.
    """

    kind: NDArray[np.int64]
    row: NDArray[np.int64]
    before: NDArray[np.int64]
    gap: Array


@dataclass(frozen=True, eq=False)
class Colour:
    """What noise is, beside what was stated.

    Attributes:
        scale: (3,) standard deviation of each kind in units of the stated one.
        rho: (3,) correlation of a reading with the next of its run.
    """

    scale: Array
    rho: Array

    def by_kind(self, problem: Problem) -> tuple[dict[str, float], dict[str, float]]:
        """Scale and rho by the name of each kind of reading that the data hold."""
        kinds = {KINDS.index(kind): kind.name for kind in kinds_read(problem)}
        return (
            {name: float(self.scale[k]) for k, name in kinds.items()},
            {name: float(self.rho[k]) for k, name in kinds.items()},
        )

    def hotter(self, factor: float) -> Colour:
        """The same with larger deviations."""
        return replace(self, scale=self.scale * factor)


WHITE = Colour(np.ones(len(KINDS)), np.zeros(len(KINDS)))


def chain_of(problem: Problem) -> Chain:
    """The chains of a problem's counted readings."""
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
    """Steps between readings: by time where there is one, else by rows."""
    clock = problem.data.t_s
    if clock is None:
        clock = np.arange(problem.data.n_rows, dtype=float)
    # rows that did not come from a file need not follow in time
    since = np.where(before < 0, np.nan, np.abs(clock[row] - clock[row[before]]))
    # a clock that stood still tells nothing: rows of one moment follow as any others do
    usual = float(np.median(since[since > 0.0])) if (since > 0.0).any() else 1.0
    return np.nan_to_num(np.where(since == 0.0, usual, since) / usual, nan=_LONG)


def foretold(chain: Chain, colour: Colour) -> Array:
    """(N,) phi: what part of the reading before is in each reading's noise."""
    rho = colour.rho[chain.kind]
    return np.where(chain.before < 0, 0.0, rho ** np.minimum(chain.gap, _LONG))


def whitened(chain: Chain, colour: Colour, weight: Array, values: Array) -> Array:
    """Residuals (N,) or derivatives (N, p) in units of stated noise, made white.

    Args:
        chain: how readings follow.
        colour: the noise.
        weight: (N,) 1, or less where a reading is taken to be noisier than the others.
        values: in units of the stated noise.
    """
    wide = (slice(None),) + (None,) * (values.ndim - 1)
    unit = values * (np.sqrt(weight) / colour.scale[chain.kind])[wide]
    phi = foretold(chain, colour)
    if not phi.any():
        return np.asarray(unit)
    left = unit - phi[wide] * unit[np.maximum(chain.before, 0)]
    return np.asarray(left / np.sqrt(1.0 - phi**2)[wide])


def log_det(chain: Chain, colour: Colour, weight: Array) -> float:
    """Log determinant of the noise's covariance, that of the stated noise left out."""
    phi = foretold(chain, colour)
    sizes = 2.0 * np.log(colour.scale[chain.kind]) - np.log(weight)
    return float(np.sum(sizes) + np.sum(np.log1p(-(phi**2))))
