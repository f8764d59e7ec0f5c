"""What residuals are associated with: time, tension, direction of travel ... by binned means.

For each quantity the rows fall into a few bins. The share of the residuals' variance that lies
between the bins (corrected for their number) and its F test tell how strong the association is. The
quantities are commanded ones and the model's own, never measured ones: a reading with an error
would be associated with its own residual. Rows near each other have similar residuals if there is
any structure, so that a small p hints at where to look and proves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.comparison.quantities import (
    Abscissa,
    QuantityKind,
    Travel,
    cable_errors,
    channels,
    in_time,
    independent_part,
    of_cables,
    of_rows,
    travel,
)
from crosscheck.fit.problem import Problem
from crosscheck.fit.residual_noise import as_table
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


def associations(problem: Problem, white: Array, prediction: Prediction) -> list[Association]:
    """Associations of the whitened residuals (N,) of a prediction, the strongest first."""
    raw = problem.residuals(prediction.readings)
    way = travel(problem, prediction)
    table = as_table(problem, white)
    tried = [
        _row(quantity, "readings", table, raw, *channels(problem), 1.0)
        for quantity in of_rows(problem, prediction, way)
    ]
    tried += _in_cables(problem, raw, prediction, way)
    found = [row for row in tried if row is not None]
    found += _swinging(problem, table, raw, max((row.share for row in found), default=0.0))
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
    if not np.isfinite(errors).any() or not np.all(noise > 0) or not _vary(errors / noise).any():
        return []  # of one pose all cables have errors; nothing says what these depend on
    part = independent_part(problem, prediction)
    table = (errors / noise).reshape(-1, 1)
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


def _squares(table: Array, index: Any, bins: int, constant: bool) -> tuple[Array, Array, Array]:
    """Sums of squares between and within bins, and number of readings, for each column."""
    finite = np.isfinite(table) & (index >= 0)[:, None]
    values = np.where(finite, table, 0.0)
    counts = finite.sum(axis=0).astype(float)
    mean = np.zeros(table.shape[1]) if constant else values.sum(axis=0) / np.maximum(counts, 1)
    varies = _vary(np.where(finite, table, np.nan)) | constant
    values = np.where(finite & varies, values - mean, 0.0)
    between = np.zeros(table.shape[1])
    for b in range(bins):
        rows = index == b
        number = finite[rows].sum(axis=0)
        between += values[rows].sum(axis=0) ** 2 / np.maximum(number, 1)
    return between, np.maximum((values**2).sum(axis=0) - between, 0.0), counts


def _vary(table: Array) -> NDArray[np.bool_]:
    """(c,) whether columns (n, c) in units of the noise, NaN if not read, vary beyond rounding."""
    read = np.isfinite(table)
    counts = np.maximum(read.sum(axis=0), 1)
    mean = np.where(read, table, 0.0).sum(axis=0) / counts
    spread = np.sqrt((np.where(read, table - mean, 0.0) ** 2).sum(axis=0) / counts)
    rms = np.hypot(mean, spread)
    return np.asarray(spread > np.maximum(_OF_THE_RMS * rms, _OF_THE_NOISE))


def _binned(quantity: Abscissa, some: NDArray[np.bool_]) -> tuple[NDArray[np.int64], list[str]]:
    """Bin of each row, -1 for none, and the labels of the bins."""
    values = quantity.values
    index = np.full(len(values), -1, dtype=np.int64)
    if values.dtype.kind == "U" or quantity.groups:
        names, index[some] = np.unique(values[some], return_inverse=True)
        return index, [quantity.groups[k] if quantity.groups else str(k) for k in names]
    some = some & np.isfinite(values)
    rounded = np.round(values[some], 9)
    levels, place = np.unique(rounded, return_inverse=True)
    if len(levels) <= _BINS:
        index[some] = place
        return index, [labelled(v, v, quantity.unit) for v in levels]
    count = int(min(_BINS, max(2, len(rounded) // _IN_A_BIN)))
    edges = np.unique(np.quantile(rounded, np.linspace(0, 1, count + 1)[1:-1]))
    place = np.searchsorted(edges, rounded, side="right")
    used, place = np.unique(place, return_inverse=True)
    index[some] = place
    inside = [rounded[place == b] for b in range(len(used))]
    return index, [labelled(float(b.min()), float(b.max()), quantity.unit) for b in inside]


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
