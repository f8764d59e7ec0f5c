"""Tests whether what a fit takes for noise is not noise.

A fit estimates its noise: the size, the autocorrelation along runs, the weights of outliers. In
that way anything can be taken for noise. It is not noise if it is much larger than stated, or
somewhat larger and autocorrelated; if outliers lie side by side; or if whitened residuals are still
correlated with those nearby. Something unknown is then at work.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.noise.robust import outliers_by_kind
from crosscheck.fit.least_squares.problem import KINDS
from crosscheck.fit.noise.whiteness import nearest_rows, next_rows, whiteness

# White noise may be so many times larger than stated; if it is correlated by more than _ALIKE, only
# _TOGETHER times: people state half of the noise, and trackers are smooth in time, both at once.
_UNDERSTATED, _TOGETHER, _ALIKE = 3.0, 2.3, 0.3
# The size of autocorrelated noise is less well known. It may be so many standard errors larger than
# twice the stated size.
_HALF, _ERRORS = 2.0, 3.0
# Estimates from differences of neighbouring rows are too small if noise is autocorrelated, so that
# larger noise is accepted. What is more correlated than _DRIFT is a drift: its size is hardly known
# from a few runs, so that most_together() would let anything pass.
_ESTIMATED, _DRIFT = 5.0, 0.9
# Outliers are more than noise has if they are more than this part of the rows that a sensor reads,
# and more than chance gives where it throws one row in ten far off.
_MOST, _USUAL = 0.15, 0.1
# p-value of more than chance, of so many outliers and of those that lie side by side.
_CHANCE = 1e-3


def is_not_noise(setting: Setting, joint: JointFit, stated: Collection[str]) -> bool:
    """Whether what a fit takes for noise is not noise.

    Args:
        setting, joint: the fit.
        stated: names of the kinds of reading whose noise was stated; for others it was estimated.
    """
    return (
        too_loud(joint.colour, np.bincount(setting.chain.kind, minlength=len(KINDS)), stated)
        or outliers_cluster(setting, joint)
        or is_correlated(setting, joint)
    )


def too_loud(colour: Colour, readings: NDArray[np.int64], stated: Collection[str]) -> bool:
    """Whether the noise of some kind of reading is too large for what was stated or estimated.

    Args:
        colour: the noise as fitted. readings: (3,) number of readings of each kind.
        stated: names of the kinds whose noise was stated.
    """
    for k in np.flatnonzero(readings):
        scale, rho = float(colour.scale[k]), float(colour.rho[k])
        if KINDS[k].name not in stated:
            if scale > _ESTIMATED or rho > _DRIFT:
                return True
        elif scale > most_stated(rho, readings[k]):
            return True
    return False


def most_stated(rho: float, readings: int) -> float:
    """How many times the stated size noise may have, with correlation rho."""
    if drifts(rho, readings):
        return _HALF
    return min(_UNDERSTATED, most_together(rho, readings)) if rho > _ALIKE else _UNDERSTATED


def drifts(rho: float, readings: int) -> bool:
    """Whether N readings are more correlated than noise is, by two standard errors."""
    return bool(rho - 2.0 * np.sqrt(max(1.0 - rho**2, 0.0) / readings) > _DRIFT)


def most_together(rho: float, readings: int) -> float:
    """How many times the stated size autocorrelated noise may have, with correlation rho.

    The logarithm of the size of AR(1) noise, estimated together with rho from N readings, has the
    variance (1 + rho^2)/(1 - rho^2)/(2 N).
    """
    error = np.sqrt((1.0 + rho**2) / max(1.0 - rho**2, 1e-9) / (2.0 * readings))
    return max(_TOGETHER, float(_HALF * np.exp(_ERRORS * error)))


def outliers_cluster(setting: Setting, joint: JointFit) -> bool:
    """Whether outliers are too many, or neighbours of each other more often than by chance.

    Each kind of reading is judged by itself: two sensors that fail now and then, each on its own,
    make rows with an outlier about twice as frequent.
    """
    problem, chain = setting.problem, setting.chain
    out = outliers_by_kind(chain, joint.weight, problem.data.n_rows)
    read = np.zeros(out.shape, dtype=bool)
    read[chain.row, chain.kind] = True
    if any(too_many(*both) for both in zip(out.sum(axis=0), read.sum(axis=0), strict=True)):
        return True
    kinds = np.unique(chain.kind)
    any_kind = [np.asarray(out.any(axis=1))] if len(kinds) > 1 else []
    groups = [*(out[:, k] for k in kinds), *any_kind]
    part = [group.sum() / max(int(problem.use.sum()), 1) for group in groups]
    for pairs in (next_rows(problem), nearest_rows(problem)):
        for group, rate in zip(groups, part, strict=True):
            both = int((group[pairs[:, 0]] & group[pairs[:, 1]]).sum()) if len(pairs) else 0
            if both and special.pdtrc(both - 1, len(pairs) * rate**2) < _CHANCE:
                return True
    return False


def too_many(outliers: int, rows: int) -> bool:
    """Whether so many outliers among the rows that a sensor reads are no noise."""
    if outliers <= _MOST * rows:
        return False
    return bool(special.bdtrc(outliers - 1, rows, _USUAL) < _CHANCE)


def is_correlated(setting: Setting, joint: JointFit) -> bool:
    """Whether whitened residuals are still correlated with those nearby."""
    left = joint.whitened(setting.chain, joint.state.white)
    return whiteness(setting.problem, left, 0).structured
