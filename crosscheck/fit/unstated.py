"""Noise that nobody stated, from what no model would explain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crosscheck.fit.problem import Problem, Rms, kinds_read
from crosscheck.fit.smooth import monomials
from seecr.pose import Array, rotvec_from_quat
from seecr.prediction.experiment import Prediction

# What is left over the estimated noise, below which the estimate was wrong.
_TOO_LARGE = 0.5
# A third difference takes so many rows.
_ROWS = 4
# A shape that is fitted to residuals takes so many rows.
_EACH = 1.5
# An estimate that is smaller than another by less than this is no better.
_MUCH = 0.7


def estimate_sigma(problem: Problem, at: Prediction) -> tuple[Problem, tuple[str, ...]]:
    """Fill in noise that nobody stated.

    Third differences of residuals along a run hold almost none of a smooth model error but
    all of the noise (times sqrt(20)); the median keeps jumps out. Rows in no order have no
    neighbours along a run: what a cubic of the pose leaves of the residuals is the noise there.
    Where there are too few rows for either, the residuals themselves are taken for it.

    Args:
        problem: the data. at: what the model as it stands says of them.
    """
    sigma, notes, raw = problem.sigma, [], problem.residuals(at.readings)
    shapes = _shapes(problem, at)
    for kind in kinds_read(problem):
        if getattr(sigma, kind.sigma) is not None:
            continue
        mine = raw[:, kind.columns]
        found = {
            "differences between neighbouring rows": _differences(problem, mine),
            "what no smooth function of the pose explains": _beside(problem, mine, shapes),
        }
        sizes = {how: _size(rows) for how, rows in found.items() if rows is not None}
        best = _best(sizes)
        value = _size(mine[problem.use]) if best is None else sizes[best]
        sigma = replace(sigma, **{kind.sigma: value})
        size = f"{kind.factor * value:.2g} {kind.unit}"
        how = f"estimated from {best} as {size}"
        if best is None:
            how = (
                f"no run has the {_ROWS} rows that an estimate takes, so the errors themselves, "
                f"{size}, count as noise; state it with --sigma {kind.sigma.rpartition('_')[0]}=..."
            )
        notes.append(f"{kind.sigma} is not stated: {how}")
    return problem.with_sigma(sigma), tuple(notes)


def _best(sizes: Mapping[str, float]) -> str | None:
    """The smallest; of two that are much the same the first, which assumes less."""
    best = None
    for how, size in sizes.items():
        if best is None or size < _MUCH * sizes[best]:
            best = how
    return best


def overestimated(problem: Problem, left: Rms) -> list[str]:
    """Noise that was estimated, and is larger than all that is left, a sentence each.

    Between rows that are far apart a large model error differs as noise does.

    Args:
        problem: with its noise. left: rms of what is left, by kind.
    """
    out = []
    for kind in kinds_read(problem):
        size, noise = left[kind.key], getattr(problem.sigma, kind.sigma)
        if getattr(problem.data.sigma, kind.sigma) is None and size and size < _TOO_LARGE * noise:
            name, words = kind.sigma.rpartition("_")[0], f"{kind.factor * size:.2g} {kind.unit}"
            out.append(
                f"{kind.sigma} was estimated too large: no more than {words} rms are left; state "
                f"the noise, as with --sigma {name}={words.replace(' ', '')}, and more will show"
            )
    return out


def _differences(problem: Problem, raw: Array) -> Array | None:
    """Third differences of residuals (n, k) along the runs, as noise; None where runs are short.

    Of each channel between rows where it was read.
    """
    index = problem.data.run_index
    parts = [
        channel[np.isfinite(channel)]
        for name in np.unique(index)
        for channel in raw[(index == name) & problem.use].T
    ]
    found = [np.diff(part, n=3) / np.sqrt(20.0) for part in parts if len(part) >= _ROWS]
    return np.concatenate(found) if found else None


def _shapes(problem: Problem, at: Prediction) -> Array | None:
    """(n, k) monomials of the pose, and a step for each load; None where rows are too few."""
    commands, rows = problem.experiment.commands, int(problem.use.sum())
    place = at.pose[:, :3]
    if commands.lengths is None:
        turn = rotvec_from_quat(commands.pose[:, 3:]) * problem.robot.length
        place = np.concatenate([commands.pose[:, :3], turn], axis=1)
    for degree in (3, 2, 1) if rows >= _ROWS else ():
        shapes = monomials(place[problem.use], degree)
        if commands.loads is not None:
            kinds = commands.loads.kinds[problem.use]
            shapes = np.concatenate([shapes, kinds[:, None] == np.unique(kinds)[1:]], axis=1)
        if _enough(rows, shapes):
            out = np.zeros((len(place), shapes.shape[1]))
            out[problem.use] = shapes
            return out
    return None


def _beside(problem: Problem, raw: Array, shapes: Array | None) -> Array | None:
    """What some shapes (n, k) leave of residuals (n, c), as noise; None where rows are too few."""
    if shapes is None:
        return None
    out = np.full(raw.shape, np.nan)
    for c, channel in enumerate(raw.T):
        rows = problem.use & np.isfinite(channel)
        if not _enough(int(rows.sum()), shapes):
            continue
        x, y = shapes[rows], channel[rows]
        rank = np.linalg.matrix_rank(x)
        left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        out[rows, c] = left * np.sqrt(len(y) / (len(y) - rank))
    return out if np.isfinite(out).any() else None


def _enough(rows: int, shapes: Array) -> bool:
    """Whether so many rows leave noise beside shapes (n, k) that are fitted to them."""
    count = int(shapes.shape[1])
    return rows >= max(_EACH * count, count + _ROWS)


def _size(values: Array) -> float:
    """The standard deviation of normal noise of which these are some; outliers do not count."""
    every = np.abs(values[np.isfinite(values)])
    return max(float(np.median(every)) / 0.6745, 1e-12) if len(every) else 1.0
