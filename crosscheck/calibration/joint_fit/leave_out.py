"""Errors of the joint fit on held-out runs, each predicted by a fit that has not seen it.

Without a block, the values move on from the joint fit by steps with its derivatives. If the block
had held back values that now go so far that the prediction is no longer linear, steps with new
derivatives follow. The reported errors are those of the model, not of its linearisation. Whether
they are worse than the fit expects is judged by the linearised model, whose errors are known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.joint import JointFit, Setting, moved_on, settle
from crosscheck.calibration.joint_fit.linearised import Linear, linearised
from crosscheck.fit.effects.held_out import HeldOut, blocks_of, folds_of
from crosscheck.fit.least_squares.problem import rms_by_kind
from crosscheck.fit.least_squares.state import State
from seecr.pose import Array
from seecr.processes import Shared, shared_out

# Steps of a refit without a block: with the derivatives of the joint fit, and with its own.
_STEPS, _EARNEST = 6, 4
# A block of fewer rows may be an outlier as a whole.
_ROWS = 3
# A prediction is nonlinear if it differs from its linearisation by this part of the noise.
_BENT = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftOut(HeldOut):
    """Held-out blocks of rows, predicted by fits that had not seen them; ``raw`` is NaN elsewhere.

    Attributes:
        surprise: (blocks,) chi2 per reading of linearised predictions, in units of noise plus the
            uncertainty of the fit without the block: about 1 if the model is right, however far
            it extrapolates. Blocks of a row or two are judged together, see :func:`surprises`.
    """

    surprise: Array


def leave_out(setting: Setting, joint: JointFit) -> LeftOut:
    """Refit without each fold of blocks (runs, if there are enough of them) and predict it."""
    problem = setting.problem
    blocks = blocks_of(problem)
    linear = linearised(setting, joint)
    fitted = values_without(linear, np.zeros(len(linear.y), dtype=bool))
    raw = np.full(problem.measured.shape, np.nan)
    chi2, readings, power = (np.zeros(len(blocks)) for _ in range(3))
    values = np.zeros((len(blocks), len(joint.z)))
    folds = folds_of(len(blocks))
    held_out = [np.any([blocks[b] for b in fold], axis=0) for fold in folds]

    def fitted_without(rows: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Values, residuals and whitened residuals of the fit without some rows."""
        state = _without(setting, joint, rows[problem.row_of])
        return state.terms.vector, state.raw, state.white

    fits = shared_out(fitted_without, held_out, Shared)
    for fold, rows, (vector, raw_there, white) in zip(folds, held_out, fits, strict=True):
        values[fold], raw[rows] = vector, raw_there[rows]
        absent = _padded(rows[problem.row_of], len(linear.y))
        left = joint.whitened(setting.chain, white)
        straight = joint.state.white + joint.jacobian @ (fitted - values_without(linear, absent))
        expected = joint.whitened(setting.chain, straight)
        for b in fold:
            own = blocks[b][problem.row_of]
            chi2[b], readings[b] = float(left[own] @ left[own]), int(own.sum())
            power[b] = surprise_of(linear, absent, _padded(own, len(absent)), expected[own])
    rms = rms_by_kind(problem, raw)
    surprise = surprises(power, readings, np.array([int(rows.sum()) for rows in blocks]))
    return LeftOut(raw, chi2, readings, values, rms, valid=True, surprise=surprise)


def surprises(power: Array, readings: Array, rows: NDArray[np.int_]) -> Array:
    """(blocks,) chi2 per reading of each block, and of short ones that of all of them together.

    Where every pose is a run of its own, one row in ten that is far off is no surprise; nor is the
    one row of a run that was broken off.

    Args:
        power: (blocks,) chi2 of held-out readings. readings: (blocks,) how many these are.
        rows: (blocks,) in how many rows.
    """
    each = power / np.maximum(readings, 1.0)
    short = rows < _ROWS
    if not short.any():
        return each
    together = power[short].sum() / max(readings[short].sum(), 1.0)
    return np.where(short, together if rows[short].sum() >= _ROWS else 0.0, each)


def _without(setting: Setting, joint: JointFit, absent: NDArray[np.bool_]) -> State:
    """The model fitted without some readings (N,)."""
    chain, weight = setting.chain, np.where(absent, 0.0, joint.weight)
    # the readings after them have no predecessor any more
    first = (chain.before >= 0) & absent[chain.before]
    chain = replace(chain, before=np.where(first, -1, chain.before))
    cut = replace(setting, chain=chain, weight=weight)
    state = moved_on(cut, joint, weight, _STEPS)
    straight = joint.state.white - joint.jacobian @ (state.terms.sizes - joint.z)
    bend = joint.whitened(setting.chain, state.white - straight)[absent]
    if len(bend) and np.sqrt(np.mean(bend**2)) > _BENT:
        state = settle(cut, state, joint.width, joint.colour, _EARNEST).state
    return state


def values_without(linear: Linear, rows: NDArray[np.bool_]) -> Array:
    """(p,) values z of the linear model without some readings: ridge regression with the prior."""
    free = linear.width > 0.0
    kept = linear.x[~rows][:, free]
    normal = kept.T @ kept + np.diag(1.0 / linear.width[free] ** 2)
    z = np.zeros(linear.x.shape[1])
    z[free] = np.linalg.solve(normal, kept.T @ linear.y[~rows])
    return z


def surprise_of(
    linear: Linear, absent: NDArray[np.bool_], rows: NDArray[np.bool_], left: Array
) -> float:
    """chi2 of residuals (k,) of held-out readings, in units of what the fit expects of them.

    A fit predicts them with the covariance 1 + x V x^T, with V that of its values.

    Args:
        linear: the linear model.
        absent: readings that the fit has not seen.
        rows: the k of them that are judged.
        left: (k,) their residuals.
    """
    free = linear.width > 0.0
    kept, own = linear.x[~absent][:, free], linear.x[rows][:, free]
    precision = kept.T @ kept + np.diag(1.0 / linear.width[free] ** 2)
    # (1 + x V x^T)^-1 = 1 - x (V^-1 + x^T x)^-1 x^T (Woodbury)
    part = own.T @ left
    return float(left @ left - part @ np.linalg.solve(precision + own.T @ own, part))


def _padded(readings: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """Readings (N,) among the rows of the linear model; independent measurements are no reading."""
    return np.concatenate([readings, np.zeros(length - len(readings), dtype=bool)])
