"""How large an effect that is not in the catalogue must be for these data to show it.

Smooth fields over the workspace are drawn at random, all of one size in units of the noise. The
part of them that effects can imitate is subtracted; what is left earns evidence, more for larger
fields. The result is the size at which nine in ten fields would be called unknown.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.linear_evidence.worth import gains_along
from crosscheck.calibration.unknown.field import FIELD_WIDTHS, UNKNOWN, field_of
from crosscheck.fit.least_squares.definite import root_beside_one
from crosscheck.fit.least_squares.problem import Rms, rms_by_kind
from crosscheck.fit.noise.whiteness import as_table
from seecr.pose import Array

# Number of fields drawn, the part that has to be seen, and the sizes tried, in units of the noise.
_DRAWN, _SEEN = 100, 0.9
_SIZES = np.geomspace(0.03, 300.0, 81)


def detectable_size(setting: Setting, joint: JointFit, columns: Array, width: Array) -> Rms | None:
    """The rms size, by kind of reading, from which on a smooth unknown effect is seen.

    Args:
        setting, joint: a fit and its noise.
        columns: (N, p) derivatives by z of all effects that may imitate it, in units of the stated
            noise.
        width: (p,) prior standard deviations of z.

    Returns:
        Median rms errors of fields at that size; None if no size that was tried is seen.
    """
    problem = setting.problem
    field = field_of(problem, joint.state.prediction.pose[:, :3])
    random = np.random.default_rng(0)
    drawn = random.standard_normal((field.shape[1], _DRAWN))
    drawn /= np.sqrt(np.mean((field @ drawn) ** 2, axis=0))
    normal = _left(setting, joint, field, columns, width)
    power, axes = np.linalg.eigh(normal)
    power = np.maximum(power, 0.0)
    signal = power[:, None] * (axes.T @ drawn)
    noise = np.sqrt(power)[:, None] * random.standard_normal(signal.shape)
    for size in _SIZES:
        if np.quantile(_log_odds(power, size * signal + noise), 1.0 - _SEEN) > UNKNOWN:
            return _by_kind(setting, size * (field @ drawn))
    return None


def _left(setting: Setting, joint: JointFit, field: Array, columns: Array, width: Array) -> Array:
    """(k, k) normal matrix of the field's coefficients, with all effects integrated out."""
    x, f = (joint.whitened(setting.chain, part) for part in (columns * width, field))
    root = root_beside_one(x)
    cross = linalg.solve_triangular(root, x.T @ f, lower=True, check_finite=False)
    return np.asarray(f.T @ f - cross.T @ cross)


def _log_odds(power: Array, along: Array) -> Array:
    """(draws,) ln evidence with a field minus that without, averaged over the field's width."""
    gains = gains_along(power, along, FIELD_WIDTHS)
    return np.asarray(np.logaddexp.reduce(gains, axis=0) - np.log(len(gains)))


def _by_kind(setting: Setting, white: Array) -> Rms:
    """Median rms by kind of reading of fields (N, draws) in units of the stated noise."""
    problem = setting.problem
    sigma = np.broadcast_to(problem.reading_sigma, problem.measured.shape)
    every = [rms_by_kind(problem, sigma * as_table(problem, one)) for one in white.T]
    return {
        key: None if every[0][key] is None else float(np.median([rms[key] for rms in every]))
        for key in every[0]
    }
