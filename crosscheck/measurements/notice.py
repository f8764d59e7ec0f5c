"""Mistakes that no single cell shows: units, orders, and implausible rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.degrees import refuse_followed_in_degrees
from crosscheck.measurements.sentinels import refuse_sentinels
from seecr.columns.known import ANGLES, POSITION, Columns
from seecr.columns.reach import away_from, check_reach
from seecr.counted import some
from seecr.errors import InputFileError
from seecr.pose import Array, quat_conjugate, quat_multiply, rotvec_from_quat, rxyz_from_quat

if TYPE_CHECKING:
    from seecr.description.robot import Robot

# Commands beyond this many times the frame's reach are odd.
_FAR = 2.5
# Readings whose spread is so many times that of the commands, or less, are in another unit.
_OTHER_UNIT, _LEAST_ROWS = 100.0, 4
# Angles that follow the commands turned by at least so much [rad], but this closely at a rate of
# pi/180 or its inverse, are in the other unit.
_TURNED_AT_LEAST, _FOLLOWS, _RATE_OFF = np.radians(0.5), 0.9, 0.25
# Commands that spread over this part of the frame along an axis are meant to move along it.
_MOVED = 0.02
# Readings that follow the negated commands so closely, and about as far, are of a mirrored axis;
# platforms that hang on few cables do not move as far as they are told.
_AGAINST, _AS_FAR = 0.95, 0.5
# Quaternions this far [rad] from where they should be, but near it in another order.
_TURNED, _UNTURNED = np.radians(90.0), np.radians(45.0)
# Positions whose usual distance from the commands exceeds these parts of the commands' spread and
# of the frame belong to something else; angles in radians that are so far off are degrees.
_ASTRAY, _OF_FRAME, _ODD_ANGLE = 0.5, 0.05, 0.5
_MOST_LINES = 8


def notice(columns: Columns, robot: Robot, data: Measurements) -> list[str]:
    """Notes that a reader should see.

    Raises:
        InputFileError: commands or readings that must be in another unit or order.
    """
    check_reach(columns, robot, data.command_pose, data.command_lengths)
    refuse_sentinels(columns, robot)
    _check_spread(columns, robot, data)
    _check_angles(columns, data)
    refuse_followed_in_degrees(columns, robot, data)
    _refuse_zeros(columns, robot, data)
    return [
        *_far(robot, data),
        *(_mirrored(columns, robot, data) or _elsewhere(robot, data)),
        *_degrees(columns, data),
        *_other_order(columns, robot, data),
        *twice(data),
    ]


def _far(robot: Robot, data: Measurements) -> list[str]:
    reach = robot.reach
    away = np.max(away_from(robot, data.command_pose, data.command_lengths), axis=1)
    row = int(np.argmax(away))
    if away[row] <= _FAR * reach:
        return []
    return [
        f"Line {data.place(row)}: a command {away[row]:.3g} m away, where the frame is "
        f"{reach:.3g} m across: check its unit."
    ]


def _spread(values: Array) -> float:
    """Median distance [m] from the median, (n, k), without NaN."""
    known = values[np.isfinite(values).all(axis=1)]
    if len(known) < _LEAST_ROWS:
        return 0.0
    return float(np.median(np.linalg.norm(known - np.median(known, axis=0), axis=1)))


def _check_spread(columns: Columns, robot: Robot, data: Measurements) -> None:
    """Refuse positions in another unit than their columns state, all of them or one."""
    if data.command_pose is None:
        return
    which = [k for k in range(3) if data.position_mask[k]]
    read, told = _spread(data.position[:, which]), _spread(data.command_pose[:, which])
    if read > 0.0 and told > 0.0 and not 1.0 / _OTHER_UNIT < read / told < _OTHER_UNIT:
        raise _other_unit(columns, which[0], read, told)
    for k in which:
        seen = np.isfinite(data.position[:, k])
        read, told = _mean_spread(data.position[seen, k]), _mean_spread(data.command_pose[seen, k])
        if told > _MOVED * robot.reach and 0.0 < read < told / _OTHER_UNIT:
            raise _other_unit(columns, k, read, told)


def _mean_spread(values: Array) -> float:
    """Mean distance [m] from the median, (n,); an outlier can only make it larger."""
    if len(values) < _LEAST_ROWS:
        return 0.0
    return float(np.mean(np.abs(values - np.median(values))))


def _other_unit(columns: Columns, k: int, read: float, told: float) -> InputFileError:
    column = columns.known[f"meas_{POSITION[k]}"]
    return columns.table.error(
        f"positions were measured over {read:.3g} m, but commanded over {told:.3g} m; expected "
        f"about the same; are these really {column.unit.suffix}? Name the columns by their unit, "
        f"such as meas_{POSITION[k]}_{'mm' if read > told else 'm'}",
        column=column.name,
    )


def _check_angles(columns: Columns, data: Measurements) -> None:
    """Refuse angles that follow the commanded ones, in radians where degrees are stated or so."""
    if data.command_pose is None:
        return
    told = rxyz_from_quat(data.command_pose[:, 3:])
    for k, angle in enumerate(ANGLES):
        column = columns.known.get(f"meas_{angle}")
        if column is None:
            continue
        read = columns.numbers(f"meas_{angle}", blank_is_nan=True)
        seen = np.isfinite(read)
        read, wanted = read[seen], told[seen, k]
        if _mean_spread(wanted) < _TURNED_AT_LEAST or _mean_spread(read) == 0.0:
            continue
        read, wanted = read - read.mean(), wanted - wanted.mean()
        rate = float(read @ wanted / (wanted @ wanted))
        other = "rad" if column.unit.suffix == "deg" else "deg"
        mistaken = np.pi / 180.0 if other == "rad" else 180.0 / np.pi
        follows = rate * np.sqrt((wanted @ wanted) / (read @ read))
        if follows > _FOLLOWS and abs(rate / mistaken - 1.0) < _RATE_OFF:
            raise columns.table.error(
                f"the angles are {rate:.3g} times the commanded ones; expected about the same; are "
                f"these really {column.unit.suffix}? Name the column by its unit, such as "
                f"meas_{angle}_{other}",
                column=column.name,
            )


def _refuse_zeros(columns: Columns, robot: Robot, data: Measurements) -> None:
    """Refuse positions of exactly 0 0 0 far from the command, which stand for "not seen"."""
    which = [k for k in range(3) if data.position_mask[k]]
    if data.command_pose is None or len(which) < 2:
        return
    off = np.linalg.norm(data.command_pose[:, which], axis=1)
    zero = np.all(data.position[:, which] == 0.0, axis=1)
    columns.refuse(
        zero & (off > _OF_FRAME * robot.reach),
        f"meas_{POSITION[which[0]]}",
        lambda row: (
            f"expected a position near its command, got exactly {' '.join('0' * len(which))}, "
            f"{off[row]:.3g} m from it; leave the cells empty where nothing was read"
        ),
    )


def _mirrored(columns: Columns, robot: Robot, data: Measurements) -> list[str]:
    """A note about positions that run against the commands, along one axis or several."""
    if data.command_pose is None or "tracker_frame" in data.free:
        return []
    against = [k for k in range(3) if data.position_mask[k] and _runs_against(robot, data, k)]
    if not against:
        return []
    names = " ".join(columns.known[f"meas_{POSITION[k]}"].name for k in against)
    told = " and ".join("xyz"[k] for k in against)
    if len(against) == 1:
        said = f"Column {names} goes against the commands along {told}: is its sign"
    else:
        said = f"Columns {names} go against the commands along {told}: are their signs"
    return [
        f"{said} the other way round, or has the tracker's frame other axes than the robot's "
        "(crosscheck import aligns turned ones, not mirrored ones)?"
    ]


def _runs_against(robot: Robot, data: Measurements, k: int) -> bool:
    """Whether positions along an axis follow the negated commands over a part of the frame."""
    assert data.command_pose is not None
    seen = np.isfinite(data.position[:, k])
    read, told = data.position[seen, k], data.command_pose[seen, k]
    if _mean_spread(told) <= _MOVED * robot.reach or _mean_spread(read) == 0.0:
        return False
    read, told = read - read.mean(), told - told.mean()
    rate = float(read @ told / (told @ told))
    follows = rate * np.sqrt((told @ told) / (read @ read))
    return bool(follows < -_AGAINST and abs(rate + 1.0) < _AS_FAR)


def _elsewhere(robot: Robot, data: Measurements) -> list[str]:
    """A note about positions that do not follow the commands."""
    if data.command_pose is None or "tracker_frame" in data.free:
        return []
    which = [k for k in range(3) if data.position_mask[k]]
    told, read = data.command_pose[:, which], data.position[:, which]
    off = np.linalg.norm(read - told, axis=1)
    off = off[np.isfinite(off)]
    if not which or len(off) < _LEAST_ROWS:
        return []
    usual, spread = float(np.median(off)), _spread(told)
    if usual <= max(_ASTRAY * spread, _OF_FRAME * robot.reach):
        return []
    return [
        f"The measured positions do not follow the commands: they are {usual:.3g} m from them, "
        f"which spread by {spread:.3g} m. Are axes exchanged, is this the file of another robot, "
        "or is the tracker's frame not the robot's (crosscheck import aligns it)?"
    ]


def _degrees(columns: Columns, data: Measurements) -> list[str]:
    """A note about angles in radians that are far from the commanded ones."""
    if data.command_pose is None:
        return []
    told = rxyz_from_quat(data.command_pose[:, 3:])
    for k, angle in enumerate(ANGLES):
        column = columns.known.get(f"meas_{angle}")
        if column is None or column.unit.suffix != "rad":
            continue
        off = columns.numbers(f"meas_{angle}", blank_is_nan=True) - told[:, k]
        off = off[np.isfinite(off)]
        if len(off) >= _LEAST_ROWS and np.sqrt(np.mean(off**2)) > _ODD_ANGLE:
            return [
                f"Column {column.name} is {np.sqrt(np.mean(off**2)):.3g} rad (rms) from the "
                "commanded angles: are these degrees? Name the column by its unit, such as "
                f"meas_{angle}_deg."
            ]
    return []


def _turn(quat: Array, of: Array) -> Array:
    """Angles (n,) [rad] between quaternions."""
    return np.asarray(
        np.linalg.norm(rotvec_from_quat(quat_multiply(quat, quat_conjugate(of))), axis=-1)
    )


def _other_order(columns: Columns, robot: Robot, data: Measurements) -> list[str]:
    """Find quaternions that are far off, unless their last number is the scalar."""
    home = np.tile(robot.reference_pose[3:], (data.n_rows, 1))
    if data.command_pose is not None and "cmd_qw" in columns.known:
        quat = data.command_pose[:, 3:]
        if np.all(_turn(quat, home) > _TURNED) and np.all(
            _turn(np.roll(quat, 1, axis=1), home) < _UNTURNED
        ):
            raise columns.table.error(
                "every command turns the platform by more than 90 deg from the reference pose, "
                "but none by 45 deg if the scalar is taken as last; expected the scalar first; "
                "put the right numbers into cmd_qw cmd_qx cmd_qy cmd_qz",
                column="cmd_qw",
            )
    if data.quat_wxyz is None or "meas_qw" not in columns.known:
        return []
    rows = np.isfinite(data.quat_wxyz).all(axis=1)
    told = (home if data.command_pose is None else data.command_pose[:, 3:])[rows]
    quat = data.quat_wxyz[rows]
    here = np.degrees(np.median(_turn(quat, told)))
    there = np.degrees(np.median(_turn(np.roll(quat, 1, axis=1), told)))
    if here < np.degrees(_TURNED) or there > 0.2 * here:
        return []
    return [
        f"The measured quaternions are {here:.0f} deg from the commanded ones, and only "
        f"{there:.0f} deg if their last number is the scalar: are meas_qw meas_qx meas_qy meas_qz "
        "in the right order?"
    ]


def twice(data: Measurements) -> list[str]:
    """A note about rows equal to others to the last digit, which noise never produces."""
    columns = [column for name, column in data.columns() if name != "run"]
    first: dict[tuple[object, ...], int] = {}
    pairs = []
    for row, (read, *values) in enumerate(zip(data.read.tolist(), *columns, strict=True)):
        if read:
            before = first.setdefault(tuple(values), row)
            if before != row:
                pairs.append(f"{data.place(row)} as {data.place(before)}")
    if not pairs:
        return []
    return [
        f"Identical rows: line {some(pairs, _MOST_LINES)}; they count twice, so remove one of "
        "each pair if it was measured only once."
    ]
