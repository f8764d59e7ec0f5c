"""The order of cables in which measured tensions balance the load, if they do so in one alone.

All orders in which a few columns are exchanged are compared. Each may have a scale, so that load
cells and masses that are off by one factor do not count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from crosscheck.preparation.suspect_data.pulls import Pulls
from seecr.pose import Array

# Another order leaves so many times less of the load unbalanced than that of the file, and than all
# orders that exchange no more columns.
_BETTER, _ALONE = 4.0, 2.0
# Least number of rows; most orders that are compared, and most columns that are exchanged.
_LEAST_ROWS, _MOST_ORDERS, _MOST = 8, 2_000, 4


@dataclass(frozen=True, eq=False)
class Reordered:
    """Columns that are of other cables.

    Attributes:
        cables: the cable that each exchanged column is of, both counted from 0.
        here, there: what is unbalanced [N] as the columns stand, and if they are exchanged; rms.
    """

    cables: dict[int, int]
    here: float
    there: float


def reordered(pulls: Pulls, rows: NDArray[np.bool_]) -> Reordered | None:
    """The exchange of a few columns of tensions that alone balances the load; None without one.

    Args:
        pulls: measured and predicted tensions. rows: (n,) those to look at.
    """
    rows = rows & pulls.whole
    m = pulls.problem.robot.n_cables
    if rows.sum() < _LEAST_ROWS or m < 2:
        return None
    left = _Unbalanced.of(pulls, rows)
    own = np.arange(m)
    here = left.by(own[None])[0]
    tried = np.zeros(0)
    found: Reordered | None = None
    for orders in _orders(m):
        sizes = left.by(orders)
        tried = np.concatenate([tried, sizes])
        best = int(np.argmin(sizes))
        there = max(float(sizes[best]), left.noise)
        # exchanging more columns must pay, once fewer explain most
        most = here / _BETTER if found is None else found.there / _ALONE
        if there > most:
            continue
        if (tried < _ALONE * there).sum() > 1:
            return None
        moved = np.flatnonzero(orders[best] != own)
        cables = {int(i): int(orders[best, i]) for i in moved}
        found = Reordered(cables, float(here), there)
    return found


def _orders(m: int) -> Iterator[NDArray[np.intp]]:
    """Orders (k, m) of cables with two columns exchanged, then with three, and so on."""
    for moved in range(2, min(_MOST, m) + 1):
        rows = []
        for some in combinations(range(m), moved):
            for other in permutations(some):
                if all(i != j for i, j in zip(some, other, strict=True)):
                    order = np.arange(m)
                    order[list(some)] = other
                    rows.append(order)
            if len(rows) > _MOST_ORDERS:
                return
        yield np.array(rows)


@dataclass(frozen=True, eq=False)
class _Unbalanced:
    """What tensions leave unbalanced in any order of cables, by sums over all rows.

    Attributes:
        gram: (m, m, m, m) products of column i at cable j with column k at cable l [N^2].
        along: (m, m) products of column i at cable j with the load. load: its own square.
        rows: number of rows. noise: the part of noise [N].
    """

    gram: Array
    along: Array
    load: float
    rows: int
    noise: float

    @classmethod
    def of(cls, pulls: Pulls, rows: NDArray[np.bool_]) -> _Unbalanced:
        """The sums over some rows (n,), in which all cables were read."""
        matrix, read = pulls.matrix[rows], pulls.measured[rows]
        force = pulls.held(pulls.expected)[rows]
        # each column of tensions at each cable
        m = read.shape[1]
        at = np.einsum("ndj,ni->ijnd", matrix, read).reshape(m * m, -1)
        gram = (at @ at.T).reshape(m, m, m, m)
        along = (at @ force.ravel()).reshape(m, m)
        load, count = float((force**2).sum()), int(rows.sum())
        scale = float(np.linalg.norm(pulls.expected[rows]) / np.linalg.norm(read))
        sigma = scale * (pulls.problem.sigma.tension_N or 0.0)
        noise = sigma * float(np.sqrt((matrix**2).sum() / count))
        return cls(gram, along, load, count, max(noise, 1e-12))

    def by(self, orders: NDArray[np.intp]) -> Array:
        """Rms (k,) [N] of what is unbalanced in orders (k, m) of cables."""
        columns = np.arange(orders.shape[1])
        along = self.along[columns, orders].sum(axis=1)
        i, j = columns[None, :, None], orders[:, :, None]
        other, there = columns[None, None, :], orders[:, None, :]
        square = self.gram[i, j, other, there].sum(axis=(1, 2))
        left = self.load - np.maximum(along, 0.0) ** 2 / np.maximum(square, 1e-300)
        return np.asarray(np.sqrt(np.maximum(left, 0.0) / self.rows))
