"""What a fit leaves and takes for noise, and noise is not.

A fit finds the noise as it goes: its size, its correlation along runs, rows that hardly count.
Anything can be taken for noise so. What is much larger than stated, or larger and goes together;
rows that stick out side by side; residuals that agree with those nearby though whitened along
the runs: those are effects that nobody knows.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from crosscheck.calibration.colour import Colour
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.robust import outliers
from crosscheck.fit.noise import nearest_rows, next_rows, whiteness
from crosscheck.fit.problem import KINDS

# White noise may be so many times larger than stated; what goes together by more than this, less:
# people state half of what it is, and trackers are smooth in time, both at once.
_UNDERSTATED, _TOGETHER, _ALIKE = 3.0, 2.3, 0.3
# The size of what goes together is known less well, and half stated it may be so many standard
# errors larger than twice the stated one.
_HALF, _ERRORS = 2.0, 3.0
# Where noise was estimated from differences of neighbours: what goes together is larger.
_ESTIMATED, _DRIFT = 5.0, 0.9
# More rows than this part never are outliers; chance that independent ones lie so side by side.
_MOST, _CHANCE = 0.15, 1e-3


def is_strange(setting: Setting, joint: JointFit, stated: Collection[str]) -> bool:
    """Whether what a fit takes for noise is none.

    Args:
        setting, joint: the fit.
        stated: names of the kinds of reading whose noise was stated; of others it was estimated.
    """
    return (
        too_large(joint.colour, np.bincount(setting.chain.kind, minlength=len(KINDS)), stated)
        or side_by_side(setting, joint)
        or goes_together(setting, joint)
    )


def too_large(colour: Colour, readings: NDArray[np.int64], stated: Collection[str]) -> bool:
    """Whether the noise of some kind of reading is larger than what was said of it allows.

    Args:
        colour: the noise as fitted. readings: (3,) how many there are of each kind.
        stated: names of the kinds whose noise was stated.
    """
    for k in np.flatnonzero(readings):
        scale, rho = float(colour.scale[k]), float(colour.rho[k])
        if KINDS[k].name not in stated:
            if scale > _ESTIMATED or rho > _DRIFT:
                return True
        elif scale > _UNDERSTATED or (rho > _ALIKE and scale > most_together(rho, readings[k])):
            return True
    return False


def most_together(rho: float, readings: int) -> float:
    """How many times the stated size noise may have that goes together by rho along its run.

    The logarithm of the size of AR(1) noise, from N readings with rho estimated beside it, has the
    variance (1 + rho^2)/(1 - rho^2)/(2 N).
    """
    error = np.sqrt((1.0 + rho**2) / max(1.0 - rho**2, 1e-9) / (2.0 * readings))
    return max(_TOGETHER, float(_HALF * np.exp(_ERRORS * error)))


def side_by_side(setting: Setting, joint: JointFit) -> bool:
    """Whether rows that stick out are many, or more of them neighbours than chance allows."""
    problem = setting.problem
    out = outliers(setting.chain, joint.weight, problem.data.n_rows)
    used = int(problem.use.sum())
    part = out.sum() / max(used, 1)
    if part > _MOST:
        return True
    for pairs in (next_rows(problem), nearest_rows(problem)):
        both = int((out[pairs[:, 0]] & out[pairs[:, 1]]).sum()) if len(pairs) else 0
        if both and stats.poisson.sf(both - 1, len(pairs) * part**2) < _CHANCE:
            return True
    return False


def goes_together(setting: Setting, joint: JointFit) -> bool:
    """Whether residuals that were made white still agree with those nearby."""
    left = joint.whitened(setting.chain, joint.state.white)
    return whiteness(setting.problem, left, 0).structured
