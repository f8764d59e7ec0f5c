"""Readings of long logs, averaged where the robot rests: for trackers that read at 100 Hz.

Consecutive rows of one command are one pose. The uncertainty of their mean follows from their
scatter, by means of parts, since neighbouring readings are correlated. The part of the stated noise
that does not show as scatter within a dwell is kept: averaging does not remove it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements.data import Measurements, Sigma
from seecr.counted import between, counted, plural
from seecr.pose import Array, quat_conjugate, quat_multiply

# Shorter logs are taken row by row; longer ones are averaged if dwells have so many rows on
# average.
_LONG, _LEAST = 1000, 5
# Largest gap between readings of a dwell, and longest time of a mean [s], so that creep at rest
# remains visible.
_NEXT_S, _LONGEST_S = 1.0, 30.0
# Parts into which a dwell is divided for the uncertainty of its mean.
_PARTS = 5
# Scatter of this part of the stated noise counts as all of it, since that is a round number.
_ALL_SEEN = 0.8
# Correlation at a lag: less is chance, more is a drift.
_LEAST_LEFT, _MOST_LEFT = 0.1, 0.95


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Scatter of one kind of reading in all dwells.

    Attributes:
        single: standard deviation of a reading about its dwell's mean.
        alike: how many correlated readings count as one.
    """

    single: float
    alike: float


def averaged_dwells(data: Measurements) -> Measurements:
    """A long log with a row for each dwell; shorter logs unchanged."""
    if data.n_rows <= _LONG:
        return data
    start = np.flatnonzero(_begins(data))
    size = np.diff(np.append(start, data.n_rows))
    if data.n_rows < _LEAST * len(start):
        return data
    rows = [slice(a, a + k) for a, k in zip(start, size, strict=True)]
    mean = replace(
        data.rows(start),
        t_s=_means(data.t_s, rows),
        temperature_C=_means(data.temperature_C, rows),
        position=_table_means(data.position, rows),
        tensions=_table_means(data.tensions, rows),
        angles_rad=_angle_means(data.angles_rad, rows),
        quat_wxyz=None
        if data.quat_wxyz is None
        else np.array([mean_rotation(data.quat_wxyz[some]) for some in rows]),
    )
    ratio, said = _sureness(data, mean, rows, size)
    least, most = int(size.min()), int(size.max())
    in_one = f"{between(least, most, 'd')} {plural(most, 'row')} in one"
    dwells = f"{counted(len(start), 'dwell')}, each averaged: {in_one}"
    note = f"{counted(data.n_rows, 'row')} are {dwells}{said}"
    return replace(mean, sigma_ratio=mean.sigma_ratio * ratio).with_notes([note])


def _begins(data: Measurements) -> NDArray[np.bool_]:
    """(n,) rows that begin a dwell."""
    told = data.command_pose if data.command_lengths is None else data.command_lengths
    assert told is not None
    new = np.ones(data.n_rows, dtype=bool)
    new[1:] = (told[1:] != told[:-1]).any(axis=1)
    new[1:] |= (data.run[1:] != data.run[:-1]) | (data.file[1:] != data.file[:-1])
    if data.loads is not None:
        new |= data.loads.changes
    if data.t_s is not None:
        new[1:] |= np.diff(data.t_s) > _NEXT_S
        first = data.t_s[np.maximum.accumulate(np.where(new, np.arange(data.n_rows), 0))]
        part = np.floor((data.t_s - first) / _LONGEST_S)
        new[1:] |= part[1:] != part[:-1]
    return new


def _means(values: Array | None, rows: list[slice]) -> Array | None:
    return None if values is None else np.array([values[some].mean() for some in rows])


def _table_means(values: Array, rows: list[slice]) -> Array:
    """(k, w) means of what was read; NaN without readings."""
    there = np.isfinite(values)
    starts = [some.start for some in rows]
    total = np.add.reduceat(np.where(there, values, 0.0), starts, axis=0)
    count = np.add.reduceat(there.astype(float), starts, axis=0)
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def _angle_means(angles_rad: Array, rows: list[slice]) -> Array:
    """The same for angles: the mean of two beside a half turn is a half turn, not zero."""
    sine, cosine = (_table_means(of(angles_rad), rows) for of in (np.sin, np.cos))
    return np.asarray(np.arctan2(sine, cosine))


def _between(angle: Array, other: Array) -> Array:
    """Differences of angles, the shorter way round."""
    return np.asarray((angle - other + np.pi) % (2.0 * np.pi) - np.pi)


def mean_rotation(quat_wxyz: Array) -> Array:
    """The mean rotation (4,) of others (n, 4); NaN rows do not count (Markley 2007)."""
    from scipy.spatial.transform import Rotation

    seen = quat_wxyz[np.isfinite(quat_wxyz).all(axis=1)]
    if len(seen) == 0:
        return np.full(4, np.nan)
    return np.asarray(Rotation.from_quat(seen, scalar_first=True).mean().as_quat(scalar_first=True))


def mean_error(values: Array) -> float:
    """Standard error of the mean of rows (n, k), per coordinate.

    It follows from the means of a few parts (batch means), so that correlated samples count for
    fewer than they are.
    """
    parts = np.array_split(values, min(_PARTS, len(values)))
    means = np.array([part.mean(axis=0) for part in parts])
    return float(np.sqrt(np.mean(np.var(means, axis=0, ddof=1)) / len(parts)))


def _sureness(
    data: Measurements, mean: Measurements, rows: list[slice], size: NDArray[np.int64]
) -> tuple[Array, str]:
    """(k, 4) noise of the means relative to that of readings, by kind, and a few words on it."""
    row_of = np.repeat(np.arange(len(rows)), size)
    turned = _between(data.angles_rad, mean.angles_rad[row_of])
    if data.quat_wxyz is not None and mean.quat_wxyz is not None:
        away = quat_multiply(data.quat_wxyz, quat_conjugate(mean.quat_wxyz[row_of]))
        turned = 2.0 * away[:, 1:] * np.sign(away[:, :1])
    off = {
        "position_m": data.position - mean.position[row_of],
        "orientation_rad": turned,
        "tension_N": data.tensions - mean.tensions[row_of],
    }
    ratio, said = np.ones((len(rows), len(fields(Sigma)))), []
    for k, kind in enumerate(fields(Sigma)):
        stated = getattr(data.sigma, kind.name)
        scatter = _scatter(off[kind.name], rows) if kind.name in off else None
        if stated is None or scatter is None:
            continue
        sigma = stated * data.sigma_ratio[[some.start for some in rows], k]
        unseen = scatter.single < _ALL_SEEN * sigma
        kept = np.where(unseen, np.maximum(sigma**2 - scatter.single**2, 0.0), 0.0)
        error = kept + scatter.single**2 * np.minimum(scatter.alike / size, 1.0)
        ratio[:, k] = np.sqrt(error) / sigma
        said.append(f"{kind.name.split('_')[0]}s {np.median(ratio[:, k]):.2g}")
    words = f"; the noise of a mean, over that stated for one reading: {', '.join(said)}"
    return ratio, words if said else ""


def _scatter(off: Array, rows: list[slice]) -> _Scatter | None:
    """Scatter of readings of one kind (n, w) about the means of their dwells; None if unread."""
    columns = np.isfinite(off).any(axis=0)
    whole = [off[some][:, columns] for some in rows]
    whole = [some[np.isfinite(some).all(axis=1)] for some in whole]
    whole = [some for some in whole if len(some) > _PARTS]
    if not columns.any() or not whole:
        return None
    power = sum(float(np.sum(some**2)) for some in whole)
    count = sum((len(some) - 1) * some.shape[1] for some in whole)
    single = np.sqrt(power / count)
    if single == 0.0:
        return _Scatter(0.0, 1.0)
    # pooled over dwells: variance of a dwell's mean, in variances of a reading
    parts = np.mean([mean_error(some) ** 2 * len(some) for some in whole]) / single**2
    single, alike = _going_on(whole, single)
    return _Scatter(float(single), float(max(parts, alike, 1.0)))


def _going_on(whole: list[Array], single: float) -> tuple[float, float]:
    """The same two numbers for AR(1) noise, from differences at two lags.

    Half their mean square is sigma^2 (1 - rho^lag), whatever the dwells' means are. A dwell that is
    short relative to the correlation time does not show all of the noise.
    """
    lag = max(1, min(len(some) for some in whole) // 8)
    near, far = (_half_square(whole, step) for step in (lag, 2 * lag))
    left = min(far / near - 1.0, _MOST_LEFT) if near > 0.0 else 0.0
    if left < _LEAST_LEFT:
        return single, 1.0
    rho = left ** (1.0 / lag)
    return max(single, float(np.sqrt(near / (1.0 - left)))), (1.0 + rho) / (1.0 - rho)


def _half_square(whole: list[Array], lag: int) -> float:
    """Half the mean square difference of readings at a lag in rows."""
    off = [np.mean((some[lag:] - some[:-lag]) ** 2) for some in whole]
    return 0.5 * float(np.mean(off))
