"""Tensions in another unit than their columns state: which one it is, where that is certain."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.fit.least_squares.problem import TENSION, Problem
from crosscheck.preparation.suspect_data.pulls import Pulls
from seecr.pose import Array
from seecr.prediction.experiment import Prediction
from seecr.units import short

# Units of other load cells [N].
_UNITS = {"kgf": 9.80665, "lbf": 4.44822, "grams (gf)": 9.80665e-3}
# Scales of load cells, masses and loads are wrong by less than this factor, whose square is less
# than that between two units: within it must be the middle half of the rows.
_AS_GOOD = 1.4
_LEAST_ROWS = 4
# Tensions that are off by this factor must have another cause than effects.
_OTHER_TENSION = 20.0


def tension_doubts(problem: Problem, at: Prediction) -> list[str]:
    """Sentences that say that tensions are in another unit, or else hardly of this robot.

    Args:
        problem: the data with their noise. at: what the model as it stands predicts.
    """
    named = list(_units(problem, Pulls(problem, at).carried()))
    return named or other_tensions(problem, problem.residuals(at.readings))


def _units(problem: Problem, part: Array) -> Iterator[str]:
    """A sentence for each file whose tensions carry the load in another unit.

    Args:
        problem: the data. part: (n,) part of the load that the measured tensions carry.
    """
    data = problem.data
    for k in np.unique(data.file):
        mine = part[(data.file == k) & np.isfinite(part)]
        unit = unit_of(mine)
        if unit is None:
            continue
        name = f"{data.files[k]}: " if data.files else ""
        yield (
            f"{name}The measured tensions carry {short(float(np.median(mine)))} times the load "
            f"that the model puts on the cables, as if they were in {unit}, of "
            f"{_UNITS[unit]:.6g} N each. They are taken as they stand: are they in {unit}, or is "
            "the platform's mass in the MJCF so far off?"
        )


def unit_of(part: Array) -> str | None:
    """The unit in which tensions carry the load; None if that is newtons, or none that is known.

    Args:
        part: (k,) of the load that they carry as newtons, in each of k rows.
    """
    if len(part) < _LEAST_ROWS:
        return None
    low, high = np.quantile(part, [0.25, 0.75]).tolist()
    for name, newtons in _UNITS.items():
        if low * newtons > 1.0 / _AS_GOOD and high * newtons < _AS_GOOD:
            return name
    return None


def other_tensions(problem: Problem, raw: Array) -> list[str]:
    """That tensions are of another order than the model expects, for whatever reason.

    Args:
        problem: the data. raw: (n, 6 + m) residuals.
    """
    counted = problem.counted[:, TENSION] & np.isfinite(raw[:, TENSION])
    if counted.any(axis=1).sum() < _LEAST_ROWS:
        return []
    read = problem.data.tensions[counted]
    usual = float(np.sqrt(np.mean(read**2)))
    expected = float(np.sqrt(np.mean((read - raw[:, TENSION][counted]) ** 2)))
    if usual <= 0.0 or expected <= 0.0 or 1.0 / _OTHER_TENSION < usual / expected < _OTHER_TENSION:
        return []
    return [
        f"Tensions of {short(usual)} N were measured where the model expects {short(expected)} N "
        "(rms): is it another unit, the file of another robot, or a pretension that the model "
        "lacks?"
    ]
