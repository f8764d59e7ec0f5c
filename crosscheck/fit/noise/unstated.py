"""Estimates noise that was not stated, from what no smooth model could explain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from crosscheck.fit.least_squares.problem import Problem, Rms, kinds_read, kinds_stated
from crosscheck.fit.noise.smooth import monomials
from seecr.pose import Array, rotvec_from_quat
from seecr.prediction.experiment import Prediction
from seecr.units import short

# An estimate was wrong if the rms of the remainder is less than this part of it.
_TOO_LARGE = 0.5
# A third difference takes so many rows.
_ROWS = 4
# Least number of rows for each shape that is fitted to residuals.
_EACH = 1.5
# A later estimate replaces an earlier one only if it is less than this part of it.
_MUCH = 0.7
# Stated noise is odd if it is so many times what the readings show, over at least so many of them.
_FAR_ABOVE, _LEAST = 10.0, 12


def estimate_sigma(problem: Problem, at: Prediction) -> tuple[Problem, tuple[str, ...]]:
    """Fill in noise that was not stated.

    Third differences of residuals along a run contain almost nothing of a smooth model error, but
    all of the noise (times sqrt(20)); the median ignores jumps. If rows are in no order they have
    no neighbours along a run, so a second estimate is what a cubic in the pose (or a quadratic or
    plane, if rows are few) leaves of the residuals. It is taken if it is clearly smaller. With too
    few rows for either, the residuals themselves count as noise.

    Args:
        problem: the data. at: the prediction of the model as it stands.
    """
    sigma, notes, raw = problem.sigma, [], problem.residuals(at.readings)
    shapes = _shapes(problem, at)
    for kind in kinds_read(problem):
        if getattr(sigma, kind.sigma) is not None:
            continue
        mine = raw[:, kind.columns]
        found = {
            "differences between neighbouring rows": _differences(problem, mine),
            "the part that no smooth function of the pose explains": _beside(problem, mine, shapes),
        }
        sizes = {how: _size(rows) for how, rows in found.items() if rows is not None}
        best = _best(sizes)
        value = _size(mine[problem.use]) if best is None else sizes[best]
        sigma = replace(sigma, **{kind.sigma: value})
        size = f"{kind.factor * value:.2g} {kind.unit}"
        how = f"estimated from {best} as {size}"
        if best is None:
            how = (
                f"no run has the {_ROWS} rows that an estimate needs, so the errors themselves, "
                f"{size}, are taken as noise; state it with --sigma "
                f"{kind.sigma.rpartition('_')[0]}=..."
            )
        notes.append(f"{kind.sigma} is not stated: {how}")
    return problem.with_sigma(sigma), tuple(notes)


def errors_are_noise(problem: Problem, at: Prediction) -> bool:
    """Whether too few rows left nothing but the errors themselves to count as noise of a kind.

    Args:
        problem: the data. at: the prediction of the model as it stands.
    """
    raw, shapes = problem.residuals(at.readings), _shapes(problem, at)
    open_ = [k for k in kinds_read(problem) if getattr(problem.data.sigma, k.sigma) is None]
    return any(
        _differences(problem, raw[:, kind.columns]) is None
        and _beside(problem, raw[:, kind.columns], shapes) is None
        for kind in open_
    )


def _best(sizes: Mapping[str, float]) -> str | None:
    """The smallest; of two similar ones the first, which assumes less."""
    best = None
    for how, size in sizes.items():
        if best is None or size < _MUCH * sizes[best]:
            best = how
    return best


def overestimated(problem: Problem, left: Rms) -> list[str]:
    """A sentence for each noise that was estimated too large: the remainder is much smaller.

    Between rows that are far apart, a large model error differs as noise does.

    Args:
        problem: the data with their noise. left: rms of the residuals, by kind.
    """
    out = []
    for kind in kinds_read(problem):
        size, noise = left[kind.key], getattr(problem.sigma, kind.sigma)
        if getattr(problem.data.sigma, kind.sigma) is None and size and size < _TOO_LARGE * noise:
            name, words = kind.sigma.rpartition("_")[0], f"{kind.factor * size:.2g} {kind.unit}"
            out.append(
                f"{kind.sigma} was estimated too large: the residuals are only {words} rms; state "
                f"the noise, as with --sigma {name}={words.replace(' ', '')}, and smaller effects "
                "become visible"
            )
    return out


def oversized(problem: Problem, at: Prediction) -> list[str]:
    """A sentence for each stated noise that the readings contradict, as of a wrong unit.

    Differences between neighbouring rows contain all noise that is not common to them, so that
    noise far above them was hardly meant. Their mean square is used, which every jump enlarges.

    Args:
        problem: the data with their noise. at: the prediction of the model as it stands.
    """
    raw, out = problem.residuals(at.readings), []
    for kind in kinds_stated(problem):
        noise = problem.reading_sigma[:, kind.columns]
        found = _differences(problem, raw[:, kind.columns] / noise)
        if found is None or len(found) < _LEAST:
            continue
        part = float(np.sqrt(np.mean(found**2)))
        if part * _FAR_ABOVE < 1.0:
            stated = kind.factor * float(np.median(noise[problem.use]))
            out.append(
                f"{kind.sigma} is stated as {short(stated)} {kind.unit}, but neighbouring rows "
                f"differ as if it were {short(part * stated)} {kind.unit}: is it in another unit? "
                "Effects below the stated noise stay invisible"
            )
    return out


def _differences(problem: Problem, raw: Array) -> Array | None:
    """Third differences of residuals (n, k) along runs, scaled to noise; None if runs are short.

    Differences of each channel are between the rows where it was read.
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
    """(n, k) monomials of the pose, and a step for each load; None if there are too few rows."""
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
    """What shapes (n, k) leave of residuals (n, c), scaled to noise; None if rows are too few."""
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
    """Whether so many rows leave enough noise beside shapes (n, k) that are fitted to them."""
    count = int(shapes.shape[1])
    return rows >= max(_EACH * count, count + _ROWS)


def _size(values: Array) -> float:
    """Robust standard deviation of normal noise, by the median of its absolute values."""
    every = np.abs(values[np.isfinite(values)])
    return max(float(np.median(every)) / 0.6745, 1e-12) if len(every) else 1.0
