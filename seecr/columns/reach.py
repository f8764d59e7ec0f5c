"""Commands that are so far outside the robot that their unit must be another."""

from __future__ import annotations

import numpy as np

from seecr.columns.known import POSITION, Columns
from seecr.pose import Array
from seecr.robot import ABSURD, Robot

__all__ = ["ABSURD", "away_from", "check_reach"]


def away_from(robot: Robot, poses: Array | None, lengths: Array | None) -> Array:
    """How far (n, k) [m] commands are from the reference position; lengths (n, m) as they are."""
    if lengths is not None:
        return lengths
    assert poses is not None
    return np.abs(poses[:, :3] - robot.reference_pose[:3])


def check_reach(columns: Columns, robot: Robot, poses: Array | None, lengths: Array | None) -> None:
    """Refuse commands far outside the robot.

    Raises:
        InputFileError: with line and column of the first.
    """
    if lengths is not None:
        quantities = [f"length_{i + 1}" for i in range(robot.n_cables)]
    else:
        quantities = [f"cmd_{axis}" for axis in POSITION]
    for quantity, away in zip(quantities, away_from(robot, poses, lengths).T, strict=True):
        if quantity in columns.known:
            _refuse_far(columns, quantity, away, robot.reach)


def _refuse_far(columns: Columns, quantity: str, away: Array, reach: float) -> None:
    unit, given = columns.known[quantity].unit.suffix, columns.numbers(quantity)
    columns.refuse(
        away > ABSURD * reach,
        quantity,
        lambda row: (
            f"far outside the robot: expected numbers of the size of its frame, {reach:.3g} m "
            f"across, got {given[row]:.4g} {unit}; are these really {unit}? Name the column by its "
            f"unit, such as {quantity}_mm"
        ),
    )
