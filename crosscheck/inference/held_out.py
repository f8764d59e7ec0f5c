"""Errors on test runs, each predicted by a fit that has not seen it.

Only these tell whether a model is right: the error on the rows of a fit always falls. A fit without
a block of rows goes on from the fit of all rows, with its noise and its weights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.inference.fit import Fit, without_rows
from seecr.counted import counted
from seecr.pose import Array

# Data with fewer runs than this are cut into blocks of time instead, of which there are so many.
_LEAST_RUNS, _BLOCKS = 3, 5
# Most fits without something: if there are more blocks, several are held out together. Nine tenths
# of the rows remain for each fit, so that more fits would take longer and say the same.
_FOLDS = 10


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Cross-validation of a model.

    Attributes:
        raw: (n, 6 + m) residuals, each row predicted by a model that was not fitted to its block.
        chi2: (blocks,) sum of squares of each held-out block, in units of the stated noise.
        readings: (blocks,) number of readings in each. rms: errors of the held-out rows, by kind.
        valid: whether every block could be predicted.
    """

    raw: Array
    chi2: Array
    readings: Array
    rms: Rms
    valid: bool


def hold_out(fit: Fit) -> HeldOut:
    """Fit without each fold of blocks, and predict it. A model without effects is not fitted."""
    problem = fit.data.problem
    blocks = blocks_of(problem)
    raw, table = fit.state.raw.copy(), np.nan_to_num(fit.state.table)
    valid = fit.valid
    if fit.free.any():
        for k in range(min(_FOLDS, len(blocks))):
            absent = np.any(blocks[k::_FOLDS], axis=0)
            state = without_rows(fit, absent[problem.row_of])
            raw[absent], table[absent] = state.raw[absent], np.nan_to_num(state.table)[absent]
            valid = valid and state.valid
    counted_table = np.where(problem.counted, table, 0.0)
    chi2 = np.array([float((counted_table[rows] ** 2).sum()) for rows in blocks])
    readings = np.array([float(problem.counted[rows].sum()) for rows in blocks])
    return HeldOut(raw, chi2, readings, rms_by_kind(problem, raw), valid)


def improves(without: HeldOut, with_effect: HeldOut) -> tuple[float, float]:
    """Mean fall of chi2 over the held-out blocks, and its standard error."""
    delta = without.chi2 - with_effect.chi2
    error = float(np.std(delta, ddof=1) / np.sqrt(len(delta))) if len(delta) > 1 else np.inf
    return float(delta.mean()), error


def pays(without: HeldOut, with_effect: HeldOut) -> bool:
    """Whether an effect lowers chi2 of held-out blocks, by half a standard error of the mean."""
    mean, error = improves(without, with_effect)
    return with_effect.valid and mean > 0.0 and mean >= 0.5 * error


def rms_by_block(problem: Problem, held: HeldOut, key: str) -> Array:
    """(blocks,) rms error of each held-out block in SI; NaN where nothing was read."""
    every = [rms_by_kind(problem.only(rows), held.raw)[key] for rows in blocks_of(problem)]
    return np.array([np.nan if value is None else value for value in every])


# --- blocks ---------------------------------------------------------------------------------------


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
    if len(runs := _runs(problem)) >= _LEAST_RUNS:
        return [(run == k) & problem.use for k in runs]
    rows = np.flatnonzero(problem.use)
    index = np.arange(len(run))
    return [np.isin(index, part) for part in np.array_split(rows, _count(problem))]


def blocks_note(problem: Problem) -> list[str]:
    """A note that the blocks held out are not whole runs, if they are not."""
    if problem.groups is not None:
        return [
            "cross-validation leaves out a part of each file or run, because each has values of "
            "its own"
        ]
    runs = len(_runs(problem))
    if runs >= _LEAST_RUNS:
        return []
    word = "a single run" if runs == 1 else f"only {counted(runs, 'run')}"
    blocks = counted(_count(problem), "block")
    return [f"{word}: cross-validation leaves out {blocks} of time instead of runs"]


def _runs(problem: Problem) -> NDArray[np.int64]:
    return np.unique(problem.data.run_index[problem.use])


def _count(problem: Problem) -> int:
    return min(_BLOCKS, max(2, int(problem.use.sum()) // 2))


def by_part(fit: Fit, groups: NDArray[np.int64] | None) -> Fit:
    """A fit whose effects have other values in each file or run, with blocks that respect that."""
    problem = fit.data.problem.with_groups(groups)
    return replace(fit, data=replace(fit.data, problem=problem))
