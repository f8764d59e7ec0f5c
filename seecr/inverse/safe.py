"""How far inside their limits tensions should be, given what is not known of a model."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.compiled.columns import HYSTERESIS
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.prediction.experiment import Prediction
from seecr.prediction.model import Model
from seecr.prediction.uncertainty import spread_of
from seecr.statics.tables import Tables, take
from seecr.tensions.rest_lengths import hold

# Probability that all tensions of a pose stay within limits, if these are as far away as is safe:
# one pose in a hundred may still touch one.
_SAFE = 0.99
# Where no tensions are so far inside, they are as far as the first of these parts that holds.
_PARTS = np.linspace(1.0, 0.1, 10)


def safe_margins(
    robot: Robot, commands: Commands, model: Model, prediction: Prediction
) -> Array | None:
    """Margins (n, k) [N] that keep tensions within limits; None if the model has no covariance.

    They are of the k driven cables, with all falls of their lines.

    Each is so many standard errors of the tension that by Bonferroni's inequality all cables stay
    inside with the probability above, and what hysteresis may add if a pose is reached another way.
    NaN for a row without an answer.
    """
    assert commands.lengths is not None
    lost = np.asarray(np.isnan(commands.lengths).any(axis=1))
    lengths = np.where(lost[:, None], robot.rest_lengths, commands.lengths)
    spread = spread_of(robot, replace(commands, lengths=lengths), model)
    if spread is None:
        return None
    times = NormalDist().inv_cdf(1.0 - (1.0 - _SAFE) / robot.n_driven)
    margins = times * robot.falls * spread.tensions + prediction.tables.cables[..., HYSTERESIS]
    margins = margins[:, robot.driven]
    margins[lost] = np.nan
    return margins


def narrowed(
    tables: Tables, aim: Array, limits: tuple[Array, Array], margins: Array, rows: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Limits (n, k) [N] that are narrower by these margins, or the largest part of them that holds.

    Args:
        tables: of n poses, of the driven cables. aim: (n, k) tensions. limits: (k,) or (n, k).
        margins: (n, k). rows: (n,) which poses can be held.
    """
    low, high = (np.array(np.broadcast_to(one, margins.shape)) for one in limits)
    left = np.flatnonzero(rows & np.isfinite(margins).all(axis=1) & margins.any(axis=1))
    for part in _PARTS:
        least, most = low[left] + part * margins[left], high[left] - part * margins[left]
        wide = (least <= most).all(axis=1)
        tried = np.flatnonzero(wide)
        held = hold(take(tables, left[wide]), aim[left[wide]], least[wide], most[wide]).fine
        fine = tried[held]
        low[left[fine]], high[left[fine]] = least[fine], most[fine]
        left = np.delete(left, fine)
    return low, high
