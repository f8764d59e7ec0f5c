"""Cross-validation: errors on held-out runs, which alone tell whether a model is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.effects.gauss_newton import Fit, fit
from crosscheck.fit.least_squares.problem import Problem, rms_by_kind
from seecr.counted import counted
from seecr.pose import Array
from seecr.processes import Shared, shared_out

# Data with fewer runs than this are cut into blocks of time instead.
_LEAST_RUNS = 3
# Most blocks of time.
_BLOCKS = 5
# Most fits without something: if there are more blocks, several are held out together. Nine tenths
# of the rows remain for each fit, so that more fits would take longer and say the same.
_FOLDS = 10
# A fall of chi2 on held-out blocks is significant from this many standard errors on.
_SIGNIFICANT = 2.0
# Most Gauss-Newton steps of a refit without one fold, starting from the fit to all blocks.
_ITERATIONS = 6


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Cross-validation of a model.

    Attributes:
        raw: (n, 6 + m) residuals, each row predicted by a model that was not fitted to its block.
        chi2: (blocks,) chi2 of each held-out block.
        readings: (blocks,) number of readings in each.
        values: (blocks, p) parameters fitted without each block; the same for all of one fold.
        rms: errors of the held-out rows, by kind.
        valid: whether every fold could be fitted and predicted.
    """

    raw: Array
    chi2: Array
    readings: Array
    values: Array
    rms: dict[str, float | None]
    valid: bool


def blocks_of(problem: Problem) -> list[NDArray[np.bool_]]:
    """Rows (n,) of each block to hold out: runs, or blocks of time if there are too few runs.

    If effects have separate values for each file or run, each block is a part of every one of
    them: without any reading of a file or run, nothing would determine its values.
    """
    if problem.groups is not None:
        groups = [problem.groups == k for k in np.unique(problem.groups[problem.use])]
        every = [blocks_of(problem.with_groups(None).only(rows)) for rows in groups]
        none = np.zeros_like(problem.use)
        return [np.any(blocks, axis=0) for blocks in zip_longest(*every, fillvalue=none)]
    run = problem.data.run_index
    if _enough_runs(problem):
        return [(run == k) & problem.use for k in _runs(problem)]
    rows = np.flatnonzero(problem.use)
    index = np.arange(len(run))
    return [np.isin(index, part) for part in np.array_split(rows, _count(problem))]


def folds_of(blocks: int) -> list[range]:
    """The numbers of the blocks that are held out together, for each fit without them."""
    return [range(k, blocks, _FOLDS) for k in range(min(_FOLDS, blocks))]


def blocks_note(problem: Problem) -> str:
    """A note that the blocks held out are not whole runs; "" if they are."""
    if problem.groups is not None:
        return (
            "cross-validation leaves out a part of each file or run, because each has values of "
            "its own"
        )
    if _enough_runs(problem):
        return ""
    runs = len(_runs(problem))
    word = "a single run" if runs == 1 else f"only {counted(runs, 'run')}"
    blocks = counted(_count(problem), "block")
    return f"{word}: cross-validation leaves out {blocks} of time instead of runs"


def _runs(problem: Problem) -> NDArray[np.int64]:
    return np.unique(problem.data.run_index[problem.use])


def _enough_runs(problem: Problem) -> bool:
    return len(_runs(problem)) >= _LEAST_RUNS


def _count(problem: Problem) -> int:
    """Number of blocks of time."""
    return min(_BLOCKS, max(2, int(problem.use.sum()) // 2))


def hold_out(problem: Problem, best: Fit, factor: Array, fit: Callable[..., Fit] = fit) -> HeldOut:
    """Refit the model without each fold, starting from the full fit, and predict its blocks.

    Args:
        problem: the data.
        best: the model fitted to all of them.
        factor: noise factors.
        fit: :func:`crosscheck.fit.effects.gauss_newton.fit`, or a function that can replace it.
    """
    blocks = blocks_of(problem)
    raw = np.full(problem.measured.shape, np.nan)
    chi2, readings = np.zeros(len(blocks)), np.zeros(len(blocks))
    values = np.zeros((len(blocks), len(best.terms)))
    valid = best.valid

    def without(fold: range) -> tuple[Array, Array, list[Array], bool]:
        """The held-out rows' residuals, the values, the blocks' whitened ones, whether solved."""
        out = np.any([blocks[b] for b in fold], axis=0)
        rest = fit(
            problem.only(~out), best.terms, factor, best.state,
            iterations=_ITERATIONS, quick=True,
        )  # fmt: skip
        white = [rest.state.table[blocks[b][:, None] & problem.counted] for b in fold]
        solved = rest.valid and bool(np.all(rest.state.prediction.solved[out]))
        return rest.state.raw[out], rest.terms.vector, white, solved

    folds = folds_of(len(blocks))
    for fold, found in zip(folds, shared_out(without, folds, Shared), strict=True):
        out = np.any([blocks[b] for b in fold], axis=0)
        raw[out], values[fold], white, solved = found
        valid = valid and solved
        for b, one in zip(fold, white, strict=True):
            chi2[b], readings[b] = float(one @ one), len(one)
    return HeldOut(raw, chi2, readings, values, rms_by_kind(problem, raw), valid)


def improves(without: HeldOut, with_effect: HeldOut) -> tuple[float, float]:
    """Mean fall of chi2 over the held-out blocks, and its standard error."""
    delta = without.chi2 - with_effect.chi2
    error = float(np.std(delta, ddof=1) / np.sqrt(len(delta))) if len(delta) > 1 else np.inf
    return float(delta.mean()), error


def pays(without: HeldOut, with_effect: HeldOut) -> bool:
    """Whether an effect lowers chi2 of held-out blocks, by half a standard error of the mean."""
    mean, error = improves(without, with_effect)
    return with_effect.valid and mean > 0.0 and mean >= 0.5 * error


def significantly_improves(without: HeldOut, with_effect: HeldOut) -> bool:
    """Whether held-out blocks are predicted better by more than their scatter.

    This holds if the mean fall of chi2 exceeds two standard errors, or if chi2 falls in each of at
    least five blocks. A block that falls much more than the others makes the size of the mean
    uncertain, not its sign.
    """
    mean, error = improves(without, with_effect)
    delta = without.chi2 - with_effect.chi2
    every = len(delta) >= _BLOCKS and bool(np.all(delta > 0.0))
    return with_effect.valid and (mean > _SIGNIFICANT * error or every)


def unfitted(problem: Problem, base: Fit) -> HeldOut:
    """Errors of the model as it stands: it was fitted to no row, so all rows count as held out."""
    blocks = blocks_of(problem)
    table = np.zeros(problem.measured.shape)
    table[problem.row_of, problem.column_of] = base.state.white
    chi2 = np.array([float((table[rows] ** 2).sum()) for rows in blocks])
    readings = np.array([float(problem.counted[rows].sum()) for rows in blocks])
    values = np.tile(base.terms.vector, (len(blocks), 1))
    return HeldOut(
        base.state.raw, chi2, readings, values, rms_by_kind(problem, base.state.raw), base.valid
    )
