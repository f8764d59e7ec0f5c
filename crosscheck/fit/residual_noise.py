"""What residuals say of the noise: its size if unstated, its whiteness, rows that are far off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import spatial, special

from crosscheck.fit.algebra import monomials
from crosscheck.fit.problem import Problem, Rms, kinds_read, kinds_stated
from crosscheck.fit.state import State
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
    """Whether too few rows left nothing but the errors to count as noise of a kind."""
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
    """A sentence for each noise that was estimated too large: what is left is much smaller.

    Between rows that are far apart, a large model error differs as noise does.
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

    Differences between neighbouring rows contain all noise that is not common to them. Their mean
    square is used, which every jump enlarges.
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
    dof = max(len(white) - parameters, 1)
    chi2 = float(white @ white)
    beside = nearest_rows(problem)  # before the table, which takes as much memory
    table = as_table(problem, white)
    lag, near = (agreement(table, pairs) for pairs in (next_rows(problem), beside))
    p, scale = float(special.chdtrc(dof, chi2)), float(np.sqrt(chi2 / dof))
    return Whiteness(chi2, dof, p, scale, *lag, *near)


def as_table(problem: Problem, white: Array) -> Array:
    """Whitened residuals as a table (n, 6 + m), NaN where no reading counts."""
    table = np.full(problem.measured.shape, np.nan)
    table[problem.counted] = white
    return table


def agreement(table: Array, pairs: NDArray[np.integer]) -> tuple[float, float]:
    """Largest correlation of residual rows in pairs (k, 2), and its size in standard errors.

    Structure in one channel should not drown in the noise of the others, so all channels together
    and each one by itself are tested, and the strongest result counts. The standard errors are
    corrected for the number of tests, see :func:`best_of`. Both are 0 if nothing is positive.
    """
    first, second = pairs.T
    read = np.isfinite(table)
    both = (read[first] & read[second]).sum(axis=0)
    table, both = table[:, both > 0], both[both > 0]
    product = table[first] * table[second]
    groups = [slice(None), *(slice(c, c + 1) for c in range(len(both)) if len(both) > 1)]
    tried = [
        _correlation(table[:, group], product[:, group])
        for group in groups
        if both[group].sum() >= _LEAST_PAIRS
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
    count, near = len(rows), min(4, len(rows))
    others = spatial.cKDTree(place).query(place, k=near)[1].reshape(count, near)
    # others that are not next to a row are not the row itself, either
    apart = np.stack([np.abs(rows[other] - rows) > 1 for other in others.T], axis=1)
    some = np.flatnonzero(apart.any(axis=1))
    beside = others[some, np.argmax(apart[some], axis=1)]
    first, second = np.divmod(
        np.unique(np.minimum(some, beside) * count + np.maximum(some, beside)), count
    )
    return np.stack([rows[first], rows[second]], axis=1)


# A single row is an outlier if it is so many robust standard deviations above the median; if more
# than this part of the rows are, none counts as one, unless more are asked for.
_OUTLIER = 6.0
_MOST_OUTLIERS = 0.05


def outlying_rows(
    problem: Problem, state: State, most: float = _MOST_OUTLIERS, together: int = 1
) -> NDArray[np.bool_]:
    """(n,) isolated outliers: rows whose whitened residuals far exceed all others.

    None if they are more than the part ``most`` of the rows; nor where more neighbours than
    ``together`` stick out, which is structure.
    """
    power = np.nansum(as_table(problem, state.white) ** 2, axis=1)
    count = problem.counted.sum(axis=1)
    size = np.sqrt(power / np.maximum(count, 1))
    used = problem.use & (count > 0)
    middle = float(np.median(size[used]))
    spread = 1.4826 * float(np.median(np.abs(size[used] - middle)))
    limit = middle + _OUTLIER * max(spread, 0.2 * middle, 1e-12)
    rows = used & (size > max(limit, 4.0))
    if rows.sum() > max(most * used.sum(), 1):
        return np.zeros_like(rows)
    for k in np.flatnonzero(rows):
        sticks_out = used & (size > middle + 0.5 * (size[k] - middle))
        rows[k] = _stretch(sticks_out, int(k)) <= together
    return np.asarray(rows)


def _stretch(some: np.ndarray, row: int) -> int:
    """How many neighbours in a row, with this one, are among some rows (n,)."""
    others = np.flatnonzero(~some)
    before = others[others < row].max(initial=-1)
    return int(others[others > row].min(initial=len(some)) - before - 1)
