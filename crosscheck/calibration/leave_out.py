"""Errors on runs left out of a joint fit, each refitted by linear algebra.

At the optimum the prediction is linear in the values, so leaving out a block is one solve of
the normal equations without it: exact for a linear model, near enough where a block moves the
values by little. Refitting a hundred parameters for each run in earnest would take minutes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.colour import whitened
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.linearised import Linear, linearised
from crosscheck.fit.held_out import blocks_of
from crosscheck.fit.noise import as_table
from crosscheck.fit.problem import Rms, rms_by_kind
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Blocks of rows predicted by fits that had not seen them.

    Attributes:
        raw: (n, 6 + m) residuals, NaN in rows that do not count.
        rms: by kind of reading.
        chi2: (blocks,) whitened, of the readings in each block; readings: (blocks,) their number.
        values: (blocks, p) parameters fitted without each block.
        surprise: (blocks,) chi2 in units of noise and of what the fit without the block did not
            know of it, a reading: about 1 where the model is right, however far it had to reach.
    """

    raw: Array
    rms: Rms
    chi2: Array
    readings: Array
    values: Array
    surprise: Array


def leave_out(setting: Setting, joint: JointFit) -> LeftOut:
    """Refit without each block (runs, where there are some) and predict it."""
    problem = setting.problem
    blocks = blocks_of(problem)
    linear = linearised(setting, joint)
    fitted = without(linear, np.zeros(len(linear.y), dtype=bool))
    raw = np.full(problem.measured.shape, np.nan)
    chi2, readings, surprise = (np.zeros(len(blocks)) for _ in range(3))
    values = np.zeros((len(blocks), len(joint.z)))
    for b, rows in enumerate(blocks):
        mine = rows[problem.row_of]
        # what was measured independently belongs to no block
        absent = np.concatenate([mine, np.zeros(len(linear.y) - len(mine), dtype=bool)])
        moved = fitted - without(linear, absent)
        values[b] = joint.terms.vector - moved * joint.terms.scale
        raw[rows] = (joint.state.raw + _unwhitened(setting, joint, joint.jacobian @ moved))[rows]
        left = _white(setting, joint, joint.state.white + joint.jacobian @ moved)[mine]
        chi2[b], readings[b] = float(left @ left), len(left)
        surprise[b] = surprise_of(linear, absent, left) / max(len(left), 1)
    return LeftOut(raw, rms_by_kind(problem, raw), chi2, readings, values, surprise)


def without(linear: Linear, rows: NDArray[np.bool_]) -> Array:
    """(p,) values z fitted without some readings: ridge regression by the prior."""
    free = linear.width > 0.0
    kept = linear.x[~rows][:, free]
    normal = kept.T @ kept + np.diag(1.0 / linear.width[free] ** 2)
    z = np.zeros(linear.x.shape[1])
    z[free] = np.linalg.solve(normal, kept.T @ linear.y[~rows])
    return z


def surprise_of(linear: Linear, rows: NDArray[np.bool_], left: Array) -> float:
    """What is left (k,) of some readings, in units of what was to be expected: its chi2.

    The fit without them predicts them with the covariance 1 + x V x^T, V that of its values.
    """
    free = linear.width > 0.0
    kept, own = linear.x[~rows][:, free], linear.x[rows][:, free]
    precision = kept.T @ kept + np.diag(1.0 / linear.width[free] ** 2)
    # (1 + x V x^T)^-1 = 1 - x (V^-1 + x^T x)^-1 x^T (Woodbury)
    part = own.T @ left
    return float(left @ left - part @ np.linalg.solve(precision + own.T @ own, part))


def _white(setting: Setting, joint: JointFit, values: Array) -> Array:
    return whitened(setting.chain, joint.colour, joint.weight, values)


def _unwhitened(setting: Setting, joint: JointFit, change: Array) -> Array:
    """A change (N,) in units of the stated noise as one of the raw residuals (n, 6 + m)."""
    table = np.nan_to_num(as_table(setting.problem, change))
    return np.asarray(np.einsum("nij,nj->ni", joint.state.factor, table))
