"""What residuals are associated with: time, tension, direction of travel ... by binned means.

For each quantity the rows fall into a few bins. The share of the residuals' variance that lies
between the bins (corrected for their number) and its F test tell how strong the association is. The
quantities are commanded ones and the model's own, never measured ones: a reading with an error
would be associated with its own residual. Rows near each other have similar residuals if there is
any structure, so that a small p hints at where to look and proves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.comparison.quantities import (
    Abscissa,
    QuantityKind,
    Travel,
    blocks,
    cable_errors,
    channels,
    in_time,
    independent_part,
    of_cables,
    of_rows,
)
from crosscheck.fit.problem import Problem
from crosscheck.fit.residual_noise import as_table
from crosscheck.fit.state import State
from seecr.counted import between
from seecr.pose import Array
from seecr.prediction.experiment import Prediction

SIGNIFICANT = 0.01
"""An association is significant if its p-value, corrected for all that were tried, is smaller."""

_BINS, _IN_A_BIN = 6, 4
# A period in time counts if it explains more of the variance than anything else by this share.
_CLEARLY = 0.15
# What differs from its mean by less than these parts of its rms, or of the noise, is rounding.
_OF_THE_RMS, _OF_THE_NOISE = 1e-9, 1e-6


@dataclass(frozen=True)
class Bin:
    """Rows with similar values of a quantity.

    Attributes:
        label: the values in words. rows: number of rows.
        mean: mean error of the strongest reading, in SI; None if it was not read.
    """

    label: str
    rows: int
    mean: float | None


@dataclass(frozen=True)
class Association:
    """An association of the residuals with one quantity.

    Attributes:
        kind: the kind of quantity. against: the quantity, in words.
        of: "readings" or "cable lengths".
        share: fraction of the variance that the quantity explains.
        p: p-value, corrected for all quantities tried.
        strongest: the reading with the strongest association. unit: its unit.
        bins: rows with similar values of the quantity.
    """

    kind: QuantityKind
    against: str
    of: str
    share: float
    p: float
    strongest: str
    unit: str
    bins: tuple[Bin, ...]

    @property
    def significant(self) -> bool:
        """Whether chance is an unlikely explanation."""
        return self.p < SIGNIFICANT

    def as_json(self) -> dict[str, Any]:
        """The content in ``comparison.json`` and ``diagnosis.json``."""
        return {key: value for key, value in vars(self).items() if key != "kind"}


def associations(problem: Problem, state: State, white: Array, way: Travel) -> list[Association]:
    """Associations of whitened residuals (N,) of a state, the strongest first."""
    raw, prediction = state.raw, state.prediction
    table = as_table(problem, white)
    tried = [
        _row(quantity, "readings", table, raw, *channels(problem), 1.0)
        for quantity in of_rows(problem, prediction, way)
    ]
    del table  # cables have longer ones
    tried += _in_cables(problem, raw, prediction, way)
    found = [row for row in tried if row is not None]
    least = max((row.share for row in found), default=0.0)
    found += _swinging(problem, as_table(problem, white), raw, least)
    found = [replace(row, p=min(1.0, row.p * len(found))) for row in found]
    return sorted(
        found,
        key=lambda row: (not row.significant, -row.share if row.significant else row.p, row.p),
    )


def _in_cables(
    problem: Problem, raw: Array, prediction: Prediction, way: Travel
) -> list[Association | None]:
    """Errors of cable length against each cable's own length, tension and motion."""
    errors, noise = cable_errors(problem, raw, prediction)
    if not np.isfinite(errors).any() or not np.all(noise > 0):
        return []
    table = np.divide(errors, noise, out=noise)
    if not _spread(table, np.zeros(len(table), dtype=np.int32), 1)[2].any():
        return []  # of one pose all cables have errors; nothing says what these depend on
    table = table.reshape(-1, 1)
    part = independent_part(problem, prediction)
    return [
        _row(q, "cable lengths", table, errors.reshape(-1, 1), ["cable length"], ["m"], part)
        for q in of_cables(problem, prediction, way)
    ]


def _swinging(problem: Problem, table: Array, raw: Array, least: float) -> list[Association]:
    """The association with the phase of a period in time, if it explains clearly more than others.

    Commands that go to and fro make every error that depends on the place periodic too.
    """
    again, tried = in_time(problem, table)
    if again is None:
        return []
    row = _row(again, "readings", table, raw, *channels(problem), 1.0)
    if row is None or row.share < least + _CLEARLY:
        return []
    return [replace(row, p=min(1.0, row.p * tried))]


def _row(
    quantity: Abscissa,
    of: str,
    table: Array,
    raw: Array,
    names: list[str],
    units: list[str],
    part: float,
) -> Association | None:
    """The association with one quantity; None if the quantity or the residuals never change."""
    index, labels = _binned(quantity, np.asarray(np.isfinite(table).any(axis=1)))
    constant = quantity.kind is QuantityKind.EVERYWHERE
    if len(labels) < (1 if constant else 2):
        return None
    between, within, counts = _squares(table, index, len(labels), constant)
    lost = np.maximum(counts - len(labels), 0) * part
    won = np.full(len(counts), len(labels) - (0 if constant else 1)) * (counts > len(labels))
    if lost.sum() <= 0:
        return None
    each = f_test(part * between, won, part * within, lost)
    whole = f_test(
        part * between.sum(keepdims=True), won.sum(keepdims=True),
        part * within.sum(keepdims=True), lost.sum(keepdims=True),
    )[0]  # fmt: skip
    total = between.sum() + within.sum()
    if total <= 0.0:
        return None
    spread = within.sum() / max(lost.sum(), 1e-9)
    share = 1.0 - spread / max(total / (lost.sum() + won.sum()), 1e-300)
    k = int(np.argmax(np.where(counts > len(labels), between, -1.0)))
    tried = int(np.sum(won > 0))
    return Association(
        kind=quantity.kind,
        against=quantity.name,
        of=of,
        share=float(np.clip(share, 0.0, 1.0)),
        p=float(min(1.0, 2.0 * min(whole, tried * float(np.min(each))))),
        strongest=names[k],
        unit=units[k],
        bins=_bins(index, labels, table[:, k], raw[:, k]),
    )


def f_test(between: Array, won: Array, within: Array, lost: Array) -> Array:
    """p-values (k,) of sums of squares between and within bins with these degrees of freedom."""
    good = (won > 0) & (lost > 0)
    safe = np.where(good, lost, 1.0)
    with np.errstate(over="ignore"):  # rows that are identical have no variance within
        f = (between / np.maximum(won, 1)) / np.maximum(within / safe, 1e-300)
    return np.where(good, special.fdtrc(np.maximum(won, 1), safe, f), 1.0)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Readings of a table (n, c) by bins (k, c): how many, their sums, and all squares (c,)."""

    count: Array
    total: Array
    squares: Array


def _sums(table: Array, index: Any, bins: int, shift: Array) -> _Sums:
    """Of readings less a shift (c,), where they are finite and in a bin (n,), not -1.

    They are taken some thousands at a time: as whole tables they would need the most memory of a
    comparison.
    """
    count, total = np.zeros((2, bins, table.shape[1]))
    squares = np.zeros(table.shape[1])
    for at in blocks(len(table)):
        values = table[at] - shift
        # bin -1 becomes the first one, which is left out
        read, place = np.isfinite(values), index[at] + 1
        for c, column in enumerate(np.where(read, values, 0.0).T):
            total[:, c] += np.bincount(place, column, bins + 1)[1:]
            count[:, c] += np.bincount(place, read[:, c], bins + 1)[1:]
            squares[c] += np.sum(column[place > 0] ** 2)
    return _Sums(count, total, squares)


def _squares(table: Array, index: Any, bins: int, constant: bool) -> tuple[Array, Array, Array]:
    """Sums of squares between and within bins, and number of readings, for each column."""
    counts, mean, varies = _spread(table, index, bins)
    sums = _sums(table, index, bins, np.zeros_like(mean) if constant else mean)
    between = np.sum(sums.total**2 / np.maximum(sums.count, 1), axis=0)
    within = np.maximum(sums.squares - between, 0.0)
    counted = varies | constant
    return np.where(counted, between, 0.0), np.where(counted, within, 0.0), counts


def _spread(table: Array, index: Any, bins: int) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Number and mean of readings in bins, (c,) each, and whether they vary beyond rounding.

    The table (n, c) is in units of the noise, NaN if not read.
    """
    first = _sums(table, index, bins, np.zeros(table.shape[1]))
    counts = first.count.sum(axis=0)
    mean = first.total.sum(axis=0) / np.maximum(counts, 1)
    spread = np.sqrt(_sums(table, index, bins, mean).squares / np.maximum(counts, 1))
    rms = np.hypot(mean, spread)
    return counts, mean, spread > np.maximum(_OF_THE_RMS * rms, _OF_THE_NOISE)


def _binned(quantity: Abscissa, some: NDArray[np.bool_]) -> tuple[NDArray[np.int32], list[str]]:
    """Bin of each row, -1 for none, and the labels of the bins."""
    values = quantity.values
    index = np.full(len(values), -1, dtype=np.int32)
    if quantity.groups:
        there = np.bincount(values[some], minlength=len(quantity.groups)) > 0
        index[some] = (np.cumsum(there) - 1)[values[some]]
        return index, [name for name, any_ in zip(quantity.groups, there, strict=True) if any_]
    if values.dtype.kind == "U":
        names, index[some] = np.unique(values[some], return_inverse=True)
        return index, [str(k) for k in names]
    some = some & np.isfinite(values)
    rising = values[some]
    np.round(rising, 9, out=rising)
    rising.sort()
    if len(rising) == 0:
        return index, []
    steps = rising[1:] != rising[:-1]
    if np.count_nonzero(steps) < _BINS:
        edges = rising[1:][steps]
    else:
        count = int(min(_BINS, max(2, len(rising) // _IN_A_BIN)))
        below, part = np.divmod(np.linspace(0, len(rising) - 1, count + 1)[1:-1], 1.0)
        low, high = (rising[below.astype(int) + k] for k in (0, 1))
        edges = np.unique(low + part * (high - low))
    cuts = [0, *np.searchsorted(rising, edges).tolist(), len(rising)]
    filled = np.diff(cuts) > 0
    number = np.cumsum(filled) - 1
    for at in blocks(len(values)):
        place = np.searchsorted(edges, np.round(values[at], 9), side="right")
        index[at] = np.where(some[at], number[place], -1)
    ends = [(rising[low], rising[high - 1]) for low, high in pairwise(cuts) if high > low]
    return index, [labelled(float(low), float(high), quantity.unit) for low, high in ends]


def labelled(low: float, high: float, unit: str) -> str:
    """A bin of numbers in words."""
    return f"{between(low, high)} {unit}".strip()


def _bins(index: Any, labels: list[str], white: Array, raw: Array) -> tuple[Bin, ...]:
    out = []
    for b, label in enumerate(labels):
        rows = (index == b) & np.isfinite(white) & np.isfinite(raw)
        mean = float(raw[rows].mean()) if rows.any() else None
        out.append(Bin(label, int(rows.sum()), mean))
    return tuple(out)
