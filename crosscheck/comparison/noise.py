"""Autocorrelated noise, or noise with outliers, that explains what a model leaves.

The error of a tracker is smooth in time. Size and autocorrelation of the noise maximise the
likelihood, and residuals are whitened accordingly. What is left is noise if its size is plausible,
outliers do not lie side by side, neighbours are no longer correlated, and neither a smooth field
over the workspace nor anything that varies in time explains anything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem, kinds_stated
from crosscheck.fit.residual_noise import outlying_rows
from crosscheck.fit.state import State, evaluate
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.evidence import log_gain
from crosscheck.inference.fields import fields_about
from crosscheck.inference.fit import Data, Fit, fit
from crosscheck.inference.noise import Chain, NoisePrior, chain_of, outliers, whitened
from crosscheck.inference.priors import FIELD_WIDTHS, MAY_BE_UNKNOWN, UNKNOWN
from crosscheck.inference.search import Search
from seecr.counted import counted
from seecr.effects import Terms
from seecr.pose import Array
from seecr.prediction.experiment import Prediction

# Rows that are far off whatever effects would explain: outliers of a model that lacks some.
#
# What a model lacks moves readings by many times the noise, and farther where the platform is
# soft, so that a row far off zero need not be an outlier, and two outliers may hide the rest. All
# effects are therefore fitted together with weights against outliers, as a diagnosis does; the fit
# serves for nothing else. Weights of a fit that leaves more than noise follow what it misses, so a
# row also has to be far off all others.

# A fit of more rows takes too long for a comparison; fewer readings do not carry one.
_MOST_ROWS, _LEAST_FOR_OUTLIERS = 400, 60


def rows_far_off(problem: Problem, terms: Terms, plain: Prediction) -> NDArray[np.bool_]:
    """(n,) outliers; none if too many are: they are structure then.

    Of more than 400 rows, and of too few readings, those that are far off the others as they are.
    """
    every = problem.data.n_rows
    none = np.zeros(every, dtype=bool)
    if not problem.n_readings:
        return none
    state = evaluate(problem, terms, problem.noise_under(terms.effects), predicted=plain)
    if not state.valid or not outlying_rows(problem, state, 1.0, every).any():
        return none
    if every > _MOST_ROWS or problem.n_readings < _LEAST_FOR_OUTLIERS:
        return outlying_rows(problem, state)
    data = Data.of(problem, terms)
    whole = Search(data, Catalogue.of(data, terms)).everything.fit
    far = outlying_rows(problem, whole.state, 1.0, every) & outliers(
        data.chain, whole.weight, every
    )
    return outlying_rows(problem, whole.state) if side_by_side(problem, far) else far


def side_by_side(problem: Problem, far: NDArray[np.bool_]) -> bool:
    """Whether rows that are far off follow one another more often than not: they are structure."""
    run = problem.data.run_index
    beside = far[1:] & far[:-1] & (run[1:] == run[:-1])
    return bool(2 * beside.sum() > far.sum() > 1)


# Noise that is larger than assumed by this factor is not the assumed noise.
_LARGER = 1.5
# Fewer readings than this do not show how noise is correlated.
_LEAST_READINGS = 60
# A field has up to a thousand columns, and with tensions takes 0.1 MB for each row. Of more rows
# than these, so many are asked: evenly spaced stretches, several times as long as noise with the
# correlation of a tracker is alike.
_MOST_ASKED, _STRETCH = 3000, 50


@dataclass(frozen=True)
class Coloured:
    """Estimated noise, by kind of reading.

    Attributes:
        scale: its size relative to the assumed one.
        rho: correlation of successive rows of a run.
        outliers: number of outlying rows.
        open: whether this noise, whose size was not stated, is so much larger than neighbouring
            rows differ that something missing, which varies smoothly, looks the same.
    """

    scale: dict[str, float]
    rho: dict[str, float]
    outliers: int
    open: bool = False

    @property
    def words(self) -> str:
        """The noise in a few words."""
        few = f"; {counted(self.outliers, 'outlier')}" if self.outliers else ""
        return f"{self.sizes}{few}"

    @property
    def sizes(self) -> str:
        """The same without the outliers."""
        return ", ".join(
            f"{name} {self.scale[name]:.2f} times the assumed noise"
            + (f", with a correlation of {rho:.2f} from row to row" if rho > 0.05 else "")
            for name, rho in self.rho.items()
        )


def coloured_noise(problem: Problem, state: State, factor: Array) -> Coloured | None:
    """The residuals as autocorrelated noise with outliers; None if they are not noise.

    Of more than 3000 rows, see :func:`note_on_few`.
    """
    if not state.valid or problem.n_readings < _LEAST_READINGS:
        return None
    chain = chain_of(problem)
    if problem.data.n_rows > _MOST_ASKED:
        rows = _few(problem, state.prediction.has_history)
        problem = _part(problem, rows)
        factor = problem.noise_under(state.terms.effects)
        state, chain = evaluate(problem, state.terms, factor), _cut(chain_of(problem), rows)
        if not state.valid:
            return None
    stated = [kind.name for kind in kinds_stated(problem)]
    data = Data(problem, factor, chain)
    left = fit(data, state.of(Terms(term.fixed() for term in state.terms)))
    scale, rho = left.noise.by_kind(problem)
    if any(scale[name] > _LARGER * underestimation(name in stated, rho[name]) for name in scale):
        return None
    if NoisePrior.of(problem).is_unknown(left.noise) > MAY_BE_UNKNOWN:
        return None
    white = left.white
    gains = [(what, _log_odds(left, white, columns)) for what, columns in fields_about(left)]
    kinds = [what for what, _gain in gains]
    odds = [g - np.log(len(set(kinds))) - np.log(kinds.count(what)) for what, g in gains]
    if odds and float(np.logaddexp.reduce(odds)) + UNKNOWN > 0.0:
        return None
    far = outliers(data.chain, left.weight, problem.data.n_rows)
    if side_by_side(problem, far):
        return None
    return Coloured(scale, rho, int(far.sum()), any(size > _LARGER for size in scale.values()))


def note_on_few(problem: Problem) -> list[str]:
    """A note on which rows are asked whether they are noise with autocorrelation, if not all."""
    count = problem.data.n_rows
    if count <= _MOST_ASKED:
        return []
    return [
        f"Whether what is left is noise with correlation from row to row was asked of about "
        f"{_MOST_ASKED} of {counted(count, 'row')}: of stretches of {_STRETCH} rows, evenly "
        "spaced, or where the model has a history of the first rows of each run."
    ]


def _few(problem: Problem, history: bool) -> NDArray[np.intp]:
    """Rows of stretches, evenly spaced; with a history the way to each row has to be there."""
    count = problem.data.n_rows
    if not history:
        begin = np.linspace(0, count - _STRETCH, _MOST_ASKED // _STRETCH).astype(np.intp)
        return np.ravel(begin[:, None] + np.arange(_STRETCH))
    run = problem.data.run_index
    begins = np.append(0, 1 + np.flatnonzero(np.diff(run)))
    size = np.diff(np.append(begins, count))
    place = np.arange(count) - np.repeat(begins, size)
    return np.flatnonzero(place < np.repeat(np.ceil(size * _MOST_ASKED / count), size))


def _part(problem: Problem, rows: NDArray[np.intp]) -> Problem:
    """The problem of some rows alone."""
    groups = None if problem.groups is None else problem.groups[rows]
    data, use = problem.data.rows(rows), problem.use[rows]
    return replace(problem, data=data, use=use, groups=groups, far_off=None)


def _cut(chain: Chain, rows: NDArray[np.intp]) -> Chain:
    """A chain in which no reading foretells one of another stretch of these rows."""
    before = np.maximum(chain.before, 0)
    apart = rows[chain.row] - rows[chain.row[before]] > _STRETCH
    return replace(chain, before=np.where(apart, -1, chain.before))


def _log_odds(left: Fit, white: Array, columns: Array) -> float:
    """ln odds of a field (N, k) beside nothing in what a fit leaves, with equal priors.

    Noise has channels by themselves, and most columns are of one channel alone: the normal
    equations are sums over channels, with hardly more zeros than there must be.
    """
    count, channel = columns.shape[1], left.data.problem.column_of
    normal, gradient = np.zeros((count, count)), np.zeros(count)
    for one in np.unique(channel):
        rows = np.flatnonzero(channel == one)
        own = np.flatnonzero(columns[rows].any(axis=0))
        some = left.data.chain.only(rows), left.noise, left.weight[rows]
        x = whitened(*some, columns[np.ix_(rows, own)])
        normal[np.ix_(own, own)] += x.T @ x
        gradient[own] += x.T @ white[rows]
    return log_gain(normal, gradient, FIELD_WIDTHS)


def underestimation(stated: bool, rho: float) -> float:
    """How many times too small the assumed noise may be, with correlation rho from row to row.

    Stated noise is not. Estimates from third differences, with the weights 1, -3, 3, -1, see only a
    part of what neighbouring rows have in common.
    """
    return 1.0 if stated else float((1.0 - 1.5 * rho + 0.6 * rho**2 - 0.1 * rho**3) ** -0.5)
