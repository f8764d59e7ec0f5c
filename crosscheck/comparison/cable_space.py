"""Pose errors converted to errors of cable length, which often show the kind of effect at a glance.

The length error of each cable that would explain a pose error (dt, dw) is
dl_i = -u_i . (dt + dw x R b_i), with u_i from the anchor to the exit point. A constant error hints
at an offset, one proportional to length at a gain, a sine at a drum out of round, and one that
changes sign with the motion at friction or backlash.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.least_squares.problem import ORIENTATION, POSITION, Problem
from seecr.pose import Array, quat_rotate
from seecr.prediction.experiment import Prediction


def cable_errors(problem: Problem, raw: Array, prediction: Prediction) -> tuple[Array, Array]:
    """Errors of cable length and their noise, each (n, m) [m].

    Args:
        problem: the data.
        raw: (n, 6 + m) residuals; rows without a complete pose give NaN.
        prediction: prediction of the model.
    """
    unit, arm = _cables(problem, prediction)
    turned = np.cross(raw[:, None, ORIENTATION], arm)
    errors = -np.sum(unit * (raw[:, None, POSITION] + turned), axis=-1)
    lever = np.linalg.norm(np.cross(arm, unit), axis=-1)
    sigma, ratio = problem.sigma, problem.data.sigma_ratio
    turn = (sigma.orientation_rad or 0.0) * ratio[:, 1:2] * lever
    noise = np.hypot((sigma.position_m or 0.0) * ratio[:, :1], turn)
    if problem.uses_angles:
        # differences of Euler angles are not a rotation vector
        errors = np.full_like(errors, np.nan)
    return np.where(problem.use[:, None], errors, np.nan), noise


def cable_lengths(problem: Problem, prediction: Prediction) -> Array:
    """Straight lengths (n, m) [m] of the cables at the predicted poses."""
    return problem.robot.nominal_lengths(prediction.pose)


def independent_part(problem: Problem, prediction: Prediction) -> float:
    """Fraction of the m errors of cable length whose noise is independent: they share one pose.

    The number of independent errors is m^2/tr(C^2) with the correlations C. That is m if they are
    independent, and the number of groups if they are identical within groups.
    """
    unit, arm = _cables(problem, prediction)
    sigma = problem.sigma
    columns = np.concatenate(
        [
            (sigma.position_m or 0.0) * unit,
            (sigma.orientation_rad or 0.0) * np.cross(arm, unit),
        ],
        axis=-1,
    )
    columns /= np.maximum(np.linalg.norm(columns, axis=-1, keepdims=True), 1e-300)
    m = columns.shape[1]
    together = np.einsum("nik,njk->nij", columns, columns)
    return float(np.mean(m / np.sum(together**2, axis=(1, 2))))


def _cables(problem: Problem, prediction: Prediction) -> tuple[Array, Array]:
    """Unit vectors to the exit points and arms R b_i, (n, m, 3)."""
    robot, pose = problem.robot, prediction.pose
    arm = quat_rotate(pose[:, None, 3:], robot.anchor_points[None])
    reach = robot.exit_points - pose[:, None, :3] - arm
    return reach / np.linalg.norm(reach, axis=-1, keepdims=True), arm
