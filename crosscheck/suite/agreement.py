"""The differences between SEECR and MuJoCo at each pose, and the allowed differences."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crosscheck.suite.gap import gap
from seecr.pose import Array

if TYPE_CHECKING:
    from crosscheck.settle.settler import SettlingBatch
    from crosscheck.suite.thresholds import Thresholds
    from seecr.statics.solution import Solution

QUANTITIES = (
    "settled_position_m",
    "settled_orientation_rad",
    "position_m",
    "orientation_rad",
    "tension_N",
)
"""Quantities with thresholds; ``settled_`` is MuJoCo after plain settling, the others after the
polish.
"""


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences between MuJoCo and SEECR at n poses; NaN if one of them has no answer.

    Attributes:
        settled_position_m: (n,) [m] distance after plain settling.
        settled_orientation_rad: (n,) [rad] angle between them after plain settling.
        position_m: (n,) [m] distance after the polish.
        orientation_rad: (n,) [rad] angle after the polish.
        cable_tension_N: (n, m) [N] absolute difference of each cable's tension after the polish.
        slack_same: (n,) whether both find the same cables slack. A cable that is slack for one and
            taut for the other, by less than the allowed difference of tension, counts as the same.
    """

    settled_position_m: Array
    settled_orientation_rad: Array
    position_m: Array
    orientation_rad: Array
    cable_tension_N: Array
    slack_same: NDArray[np.bool_]

    @property
    def tension_N(self) -> Array:
        """Largest difference of a tension at each pose, (n,) [N]."""
        return np.asarray(self.cable_tension_N.max(axis=1))


@dataclass(frozen=True, eq=False)
class Allowance:
    """Largest differences that count as agreement at each of n poses.

    They are the thresholds, unless a robot is so nearly singular that the residual forces move it
    farther. Then the residual over the smallest eigenvalue of the stiffness is allowed.

    Attributes:
        settled_position_m, settled_orientation_rad, position_m, orientation_rad, tension_N:
            (n,) as in :class:`Differences`.
        widened: (n,) whether any of them is wider than its threshold.
    """

    settled_position_m: Array
    settled_orientation_rad: Array
    position_m: Array
    orientation_rad: Array
    tension_N: Array
    widened: NDArray[np.bool_]


def allowances(thresholds: Thresholds, solution: Solution, settling: SettlingBatch) -> Allowance:
    """Thresholds, or residual over smallest eigenvalue where that is larger."""
    load = solution.tables.scale
    softest = np.fmin(solution.smallest_eigenvalue, settling.smallest_eigenvalue)
    # Below rounding there is no stiffness to divide by: the thresholds hold as they are.
    firm = softest > settling.neutral
    per_newton = np.divide(1.0, softest, out=np.zeros_like(softest), where=firm)
    length = solution.robot.length
    rough = load * _known(solution.residual + settling.settled_residual) * per_newton
    fine = load * _known(solution.residual + settling.residual) * per_newton
    slack = {
        "settled_position_m": rough,
        "settled_orientation_rad": rough / length,
        "position_m": fine,
        "orientation_rad": fine / length,
        # A soft direction is soft because tensions hardly change along it.
        "tension_N": np.zeros_like(fine),
    }
    base = _by_quantity(thresholds)
    wide = {name: np.maximum(base[name], slack[name]) for name in QUANTITIES}
    widened = np.any([slack[name] > base[name] for name in QUANTITIES], axis=0)
    return Allowance(**wide, widened=widened)


def differences_of(
    solution: Solution, settling: SettlingBatch, tension_allowed: Array
) -> Differences:
    """Differences between MuJoCo's and SEECR's answers.

    Args:
        solution: n poses.
        settling: the same n poses.
        tension_allowed: (n,) [N] below this a taut cable may be slack for the other.
    """
    settled_m, settled_rad = gap(settling.settled_pose, solution.pose)
    position_m, orientation_rad = gap(settling.pose, solution.pose)
    tension = np.abs(settling.tensions - solution.tensions)
    larger = np.fmax(settling.tensions, solution.tensions)
    same = (settling.slack == solution.slack) | (larger <= tension_allowed[:, None])
    return Differences(
        settled_position_m=settled_m,
        settled_orientation_rad=settled_rad,
        position_m=position_m,
        orientation_rad=orientation_rad,
        cable_tension_N=tension,
        slack_same=same.all(axis=1),
    )


def ratios(difference: Differences, allowance: Allowance) -> Array:
    """Each difference over its allowance, (n, 5) in the order of ``QUANTITIES``."""
    parts = [getattr(difference, name) / getattr(allowance, name) for name in QUANTITIES]
    return np.stack(parts, axis=1)


def within(difference: Differences, allowance: Allowance) -> NDArray[np.bool_]:
    """Whether all differences are allowed and the same cables are slack, (n,)."""
    close = np.all(ratios(difference, allowance) <= 1.0, axis=1)  # False where NaN
    return np.asarray(close & difference.slack_same)


def _by_quantity(thresholds: Thresholds) -> dict[str, float]:
    settled = {f"settled_{f.name}": f.name for f in fields(thresholds.settled)}
    values = {name: getattr(thresholds.settled, key) for name, key in settled.items()}
    polished = {f.name: getattr(thresholds.polished, f.name) for f in fields(thresholds.polished)}
    return {**values, **polished}


def _known(residual: Array) -> Array:
    """Residuals, with zero where there is no answer: NaN and infinity widen no threshold."""
    return np.where(np.isfinite(residual), residual, 0.0)
