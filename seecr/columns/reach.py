"""Implausible commands: in another unit, or for another robot."""

from __future__ import annotations

import numpy as np

from seecr.columns.known import POSITION, Columns
from seecr.description.joints import off_joints
from seecr.description.robot import ABSURD, Robot
from seecr.pose import Array
from seecr.units import of_columns

# Number of commands from which their median is meaningful.
_SEVERAL = 4
# Numbers below this part of the frame are near its origin, and no cable is so short.
_TINY = 0.01
# Units that commands far outside may be in, the likeliest first.
_LENGTHS = ("mm", "um")
# A reference position this part of the frame from the origin is not near it.
_OFF_ORIGIN = 0.1

__all__ = ["ABSURD", "away_from", "check_reach"]


def away_from(robot: Robot, poses: Array | None, lengths: Array | None) -> Array:
    """Distances (n, k) [m] of commands from the reference position; lengths (n, m) as they are."""
    if lengths is not None:
        return lengths
    assert poses is not None
    return np.abs(poses[:, :3] - robot.reference_pose[:3])


def check_reach(columns: Columns, robot: Robot, poses: Array | None, lengths: Array | None) -> None:
    """Refuse commands far outside the robot, or off its joints.

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
            home = 0.0 if lengths is not None else robot.reference_pose["xyz".index(quantity[-1])]
            _refuse_small(columns, quantity, home, robot.reach)
    if lengths is None and poses is not None:
        _refuse_another(columns, robot, poses)


def _refuse_another(columns: Columns, robot: Robot, poses: Array) -> None:
    """Refuse commands (n, 7) that are most likely for another robot."""
    off = off_joints(robot, poses)
    if off is not None:
        raise columns.table.error(
            f"the joints of robot {robot.name} cannot reach the commanded pose: it is off by "
            f"{off[1]}; expected a pose that they can reach; are these the commands of another "
            "robot?",
            row=off[0],
        )
    away = np.linalg.norm(poses[:, :3] - robot.reference_pose[:3], axis=1)
    if len(away) >= _SEVERAL and np.median(away) > robot.reach:
        raise columns.table.error(
            f"most commands are outside the frame of robot {robot.name}: half of them are "
            f"{np.median(away):.3g} m or more from its reference position, and the frame is "
            f"{robot.reach:.3g} m across; expected commands inside it; are these of another robot, "
            "or in another unit?"
        )


def _refuse_far(columns: Columns, quantity: str, away: Array, reach: float) -> None:
    unit = columns.known[quantity].unit
    given, named = columns.numbers(quantity) / unit.to_si(1.0), unit.suffix
    smaller = [one for one in _LENGTHS if of_columns("m")[one].to_si(1.0) < unit.to_si(1.0)]
    hint = f"? Name the column by its unit, such as {quantity}_{smaller[0]}" if smaller else "?"
    columns.refuse(
        away > ABSURD * reach,
        quantity,
        lambda row: (
            f"far outside the robot: expected numbers of the size of its frame, {reach:.3g} m "
            f"across, got {given[row]:.10g} {named}; are these really {named}{hint}"
        ),
    )


def _refuse_small(columns: Columns, quantity: str, home: float, reach: float) -> None:
    """Refuse metres under a smaller unit's name: all near zero, but inside the frame as metres."""
    unit, given = columns.known[quantity].unit, columns.numbers(quantity)
    as_metres = given / unit.to_si(1.0)
    length = quantity.startswith("length_")
    near = np.max(np.abs(given), initial=0.0) < _TINY * reach
    inside = np.all(np.abs(as_metres - home) <= reach) and np.any(as_metres != 0.0)
    if unit.suffix != "m" and near and inside and (length or abs(home) > _OFF_ORIGIN * reach):
        columns.refuse(
            np.ones(len(given), dtype=bool),
            quantity,
            lambda row: (
                f"expected numbers of the size of the robot's frame, {reach:.3g} m across, got at "
                f"most {np.max(np.abs(as_metres)):.4g} {unit.suffix}; are these really "
                f"{unit.suffix}? Name the column by its unit, such as {quantity}_m"
            ),
        )
