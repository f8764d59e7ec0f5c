"""Poses and lengths in a file of measurements: as commanded, and how the platform was turned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crosscheck.measurements.columns import ANGLES, POSITION, QUATERNION, Columns
from crosscheck.measurements.data import Mask
from seecr.joints import pose_of_values
from seecr.pose import Array, quat_from_rxyz, rxyz_from_quat

if TYPE_CHECKING:
    from seecr.robot import Robot

# Files with six digits are rounded by up to 1e-6; a quaternion farther off is a mistake.
_NORM_TOLERANCE = 1e-3


def command_lengths(columns: Columns, robot: Robot) -> Array | None:
    """Commanded rest lengths (n, m) [m], or None where the file has no such columns."""
    given = columns.cables("length")
    if not given:
        return None
    m = robot.n_cables
    missing = [f"length_{i}_m" for i in range(1, m + 1) if i not in given]
    if missing:
        raise columns.half_there("length", missing, f"all {m} cables of the robot")
    return np.stack([_length(columns, f"length_{i}") for i in given], axis=1)


def _length(columns: Columns, quantity: str) -> Array:
    length = columns.numbers(quantity)
    columns.refuse(
        length <= 0,
        quantity,
        lambda row: f"expected a length above zero, got {length[row]:g} m",
    )
    return length


def command_poses(columns: Columns, robot: Robot) -> Array:
    """Commanded poses (n, 7); what the robot cannot change may be left out of the file.

    Raises:
        InputFileError: no command at all, or one that is half there.
    """
    present = columns.present
    if not present("cmd", POSITION + QUATERNION + ANGLES):
        raise columns.table.error(
            "no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or length_1_m to "
            f"length_{robot.n_cables}_m{columns.near_misses()}"
        )
    free, reference = _free_coordinates(robot), robot.reference_pose
    position = _group(columns, POSITION, "m", free[:3], reference[:3])
    if present("cmd", QUATERNION):
        orientation = _quaternions(columns, "cmd", blank_is_nan=False)
    elif present("cmd", ANGLES):
        rxyz = rxyz_from_quat(reference[3:])
        orientation = quat_from_rxyz(_group(columns, ANGLES, "deg", free[3:], rxyz))
    else:
        columns.notes.append("No commanded orientation: that of the reference pose is used.")
        orientation = np.tile(reference[3:], (columns.n_rows, 1))
    return np.concatenate([position, orientation], axis=1)


def _group(
    columns: Columns, parts: tuple[str, ...], unit: str, free: Mask, reference: Array
) -> Array:
    """Three coordinates or angles (n, 3); the reference pose's where they cannot change."""
    absent = [k for k, part in enumerate(parts) if f"cmd_{part}" not in columns.known]
    missing = [f"cmd_{parts[k]}_{unit}" for k in absent if free[k]]
    if missing:
        need = " ".join(f"cmd_{parts[k]}_{unit}" for k in range(3) if free[k])
        raise columns.half_there("commanded pose", missing, need)
    if absent:
        names = " ".join(f"cmd_{parts[k]}" for k in absent)
        columns.notes.append(
            f"No {names}: the robot cannot move there, the reference pose's value is used."
        )
    values = np.tile(np.asarray(reference, float), (columns.n_rows, 1))
    for k, part in enumerate(parts):
        if k not in absent:
            values[:, k] = columns.numbers(f"cmd_{part}")
    return values


def _free_coordinates(robot: Robot) -> Mask:
    """Which of x y z rx ry rz of the platform can change at all, (6,): found by trying."""
    if not robot.joints:
        return np.ones(6, dtype=bool)
    values = np.random.default_rng(0).uniform(-0.5, 0.5, (8, len(robot.joints)))
    poses, _joints = pose_of_values(robot, values)
    moved = np.concatenate([poses[:, :3], rxyz_from_quat(poses[:, 3:])], axis=1)
    free: Mask = np.ptp(moved, axis=0) > 1e-9
    return free


def _quaternions(columns: Columns, prefix: str, *, blank_is_nan: bool) -> Array:
    """Unit quaternions (n, 4); rows of NaN where all four cells are empty."""
    given = columns.present(prefix, QUATERNION)
    missing = [f"{prefix}_{part}" for part in QUATERNION if part not in given]
    if missing:
        raise columns.half_there("quaternion", missing, "all four or none")
    parts = [columns.numbers(f"{prefix}_{p}", blank_is_nan=blank_is_nan) for p in QUATERNION]
    quat = np.stack(parts, axis=1)
    _check_whole(columns, prefix, np.isnan(quat))
    norm: Array = np.linalg.norm(quat, axis=1)
    _check_norm(columns, prefix, quat, norm)
    unit: Array = quat / norm[:, None]
    return unit


def _check_whole(columns: Columns, prefix: str, blank: Mask) -> None:
    text = "quaternion half there; expected all four cells filled or all four empty"
    for k, part in enumerate(QUATERNION):
        alone = blank[:, k] & ~np.all(blank, axis=1)
        columns.refuse(alone, f"{prefix}_{part}", lambda row: text)


def _check_norm(columns: Columns, prefix: str, quat: Array, norm: Array) -> None:
    def text(row: int) -> str:
        got = " ".join(f"{value:g}" for value in quat[row])
        return (
            f"expected a unit quaternion, scalar first, got {got} with norm {norm[row]:.6g}; "
            "check the order and the columns"
        )

    columns.refuse(np.abs(norm - 1.0) > _NORM_TOLERANCE, f"{prefix}_qw", text)


def measured_orientation(columns: Columns) -> tuple[Array | None, Array]:
    """Quaternions (n, 4) or None, and angles (n, 3) [rad] where these are all there is."""
    angles = columns.readings("meas", ANGLES)
    if columns.present("meas", QUATERNION):
        quat = _quaternions(columns, "meas", blank_is_nan=True)
        if np.all(np.isnan(quat)):
            columns.notes.append("Columns meas_qw to meas_qz are empty: not measured.")
            return None, angles
        return quat, angles
    blank = np.isnan(angles)
    if np.all(blank) or np.any(blank != blank[:, :1]):
        return None, angles
    # Every row has all three angles or none, so nothing is lost by going to quaternions.
    return quat_from_rxyz(angles), np.full_like(angles, np.nan)
