"""A test for effects that are not in the catalogue, by a smooth field over the workspace.

Each channel of readings gets its own cubic in the position, with one prior width for all
coefficients. The field is compared with no field by evidence, with all effects integrated out and
the noise re-estimated. A higher evidence means that something smooth remains that no effect of the
catalogue explains. The field is never part of a fit, because it would explain what effects explain.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from crosscheck.calibration.colour import Colour
from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.linearised import unwhitened
from crosscheck.calibration.restricted import estimate, log_evidence
from crosscheck.fit.problem import Problem
from crosscheck.fit.smooth import field_columns
from seecr.pose import Array

FIELD_WIDTHS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
# Prior standard deviation of ln(true sigma/stated sigma) if the noise was stated.
_STATED = 0.35
# From these ln odds on, something unknown is taken to be there.
UNKNOWN = 5.0


def field_of(problem: Problem, place: Array, smooth: float = 1.0) -> Array:
    """(N, k) columns of the field in units of the noise: a cubic for each channel.

    Args:
        smooth: each degree is so many times as large as the one before.
    """
    return field_columns(problem, place, problem.measured.shape[1], smooth)


def log_odds(setting: Setting, joint: JointFit, stated: bool = True) -> float:
    """ln evidence with a field minus that without, all effects integrated out.

    Args:
        setting, joint: the joint fit.
        stated: whether the size of the noise was stated.
    """
    about, problem = unwhitened(joint), setting.problem
    field = field_of(problem, joint.state.prediction.pose[:, :3])
    free = about.width > 0.0
    x = np.concatenate([about.x[:, free], field], axis=1)

    def score(width: float, colour: Colour) -> float:
        widths = np.concatenate([about.width[free], np.full(field.shape[1], width)])
        total = log_evidence(setting.chain, colour, joint.weight, x, about.y, widths)
        off = np.log(colour.scale[np.unique(setting.chain.kind)])
        return total - (0.5 * float(np.sum((off / _STATED) ** 2)) if stated else 0.0)

    without = score(1e-9, joint.colour)
    tried = [score(width, joint.colour) for width in FIELD_WIDTHS]
    widths = np.full(x.shape[1], FIELD_WIDTHS[int(np.argmax(tried))])
    widths[: int(free.sum())] = about.width[free]
    better = estimate(setting.chain, joint.colour, joint.weight, x, about.y, widths)
    found = [max(score(w, better), t) for w, t in zip(FIELD_WIDTHS, tried, strict=True)]
    return float(special.logsumexp(found) - np.log(len(found)) - without)
