"""Numbers of a file that cannot be meant so: other units, another robot, a quaternion's order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from seecr.columns.known import POSITION, Columns
from seecr.counted import figures
from seecr.description.joints import off_joints
from seecr.description.robot import ABSURD as ABSURD  # for those who read commands
from seecr.description.robot import Robot
from seecr.errors import Faults
from seecr.pose import Array, quat_conjugate, quat_multiply, rotvec_from_quat
from seecr.units import of_columns

# Number of commands from which their median is meaningful.
_SEVERAL = 4
# Numbers below this part of the frame are near its origin, and no cable is so short.
_TINY = 0.01
# Units that commands far outside may be in, the likeliest first.
_LENGTHS = ("mm", "um")
# A reference position this part of the frame from the origin is not near it.
_OFF_ORIGIN = 0.1
# Orientations are within a turn [rad], to the rounding of what is written; degrees are, too.
_TURN, _TURN_DEG = 2.0 * np.pi + 1e-3, 360.0
# Quaternions whose scalar is last turn by more than a right angle as they stand, and by less than
# half of one when read so [rad]: the wrong order makes half a turn of none.
_TURNED, _UNTURNED = np.radians(90.0), np.radians(45.0)
# An axis with such a component is that of the base frame.
_ALONG = 1.0 - 1e-6


def away_from(robot: Robot, poses: Array | None, lengths: Array | None) -> Array:
    """Distances (n, k) [m] of commands from the reference position; lengths (n, m) as they are."""
    if lengths is not None:
        return lengths
    assert poses is not None
    return np.abs(poses[:, :3] - robot.reference_pose[:3])


def check_commands(
    columns: Columns, robot: Robot, poses: Array | None, lengths: Array | None
) -> None:
    """Refuse commands far outside the robot; poses are those of its joints.

    Raises:
        InputFileError: with line and column of the first.
    """
    homes = {f"length_{i + 1}": 0.0 for i in range(robot.n_cables)}
    if lengths is None:
        homes = {f"cmd_{axis}": robot.reference_pose[k] for k, axis in enumerate(POSITION)}
    away, faults = away_from(robot, poses, lengths), Faults()
    for quantity, distances in zip(homes, away.T, strict=True):
        if quantity in columns.known:
            faults.of(_refuse_far, columns, quantity, distances, robot.reach)
    faults.check()
    for quantity, home in homes.items():
        if quantity in columns.known:
            _refuse_small(columns, quantity, home, robot.reach)
    if lengths is None and poses is not None:
        _refuse_another(columns, robot, poses)


def _refuse_another(columns: Columns, robot: Robot, poses: Array) -> None:
    """Refuse commands (n, 7) that are most likely for another robot."""
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


def refuse_degrees(columns: Columns, prefix: str, angles: Sequence[str]) -> None:
    """Refuse columns of orientations in radians that go beyond a whole turn.

    Readings beyond a turn in degrees, too, are left to those who look for what nobody measured.

    Raises:
        InputFileError: with line and column of the first.
    """
    for angle in angles:
        quantity = f"{prefix}_{angle}"
        column = columns.known.get(quantity)
        if column is None or column.unit.suffix != "rad":
            continue
        size = np.abs(columns.numbers(quantity, blank_is_nan=prefix != "cmd"))
        if prefix == "meas" and np.any(size > _TURN_DEG):
            continue
        given = columns.table.cells[column.index]
        columns.refuse(
            size > _TURN,
            quantity,
            lambda row, given=given, quantity=quantity: (  # type: ignore[misc]
                f"expected radians within one turn, at most 6.283, got {given[row]}, as if in "
                f"degrees; name the column {quantity}_deg, or, if it counts turns, subtract whole "
                "ones"
            ),
        )


def turned_from(quat: Array, of: Array) -> Array:
    """Angles (n,) [rad] between quaternions (n, 4)."""
    turn = rotvec_from_quat(quat_multiply(quat, quat_conjugate(of)))
    return np.asarray(np.linalg.norm(turn, axis=-1))


def scalar_may_be_last(quat: Array, expected: Array, part: float = 1.0) -> bool:
    """Whether quaternions (n, 4) are near those expected only with their last number as the scalar,
    at this part of the rows at the least.
    """
    here = np.quantile(turned_from(quat, expected), 1.0 - part)
    there = np.quantile(turned_from(np.roll(quat, 1, axis=1), expected), part)
    return bool(here > _TURNED and there < _UNTURNED)


def scalar_last(robot: Robot, turns: ArrayLike) -> tuple[str, ...]:
    """A note that quaternions (n, 4) seem to have their scalar last, where all of them do.

    As they are they turn the platform by more than a right angle from its reference pose, and would
    by less than half of one.
    """
    given = np.reshape(np.asarray(turns, float), (-1, 4))
    home = np.tile(robot.reference_pose, (len(given), 1))
    if not len(given) or not scalar_may_be_last(given, home[:, 3:]):
        return ()
    meant = np.roll(given, 1, axis=1)
    if off_joints(robot, np.concatenate([home[:, :3], meant], axis=1)) is not None:
        return ()  # nor could the robot take what it would be
    turn = np.degrees(rotvec_from_quat(quat_multiply(given[0], quat_conjugate(home[0, 3:]))))
    size = float(np.linalg.norm(turn))
    along = np.flatnonzero(np.abs(turn) > _ALONG * size)
    about = f" about {'xyz'[along[0]]}" if len(along) else ""
    first, last = (" ".join(figures(q, ".4g") for q in quat[0]) for quat in (given, meant))
    return (
        f"quaternions are scalar first: {first} turns the platform by {size:.4g} deg{about} "
        f"from its reference pose; if the scalar is last there, write {last}",
    )
