"""The commands in a file of measurements: platform poses or paid-out lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crosscheck.measurements.columns import ANGLES, POSITION, QUATERNION, near_misses
from crosscheck.measurements.data import Mask
from crosscheck.measurements.source import Source
from seecr.pose import (
    Array,
    quat_from_rotvec,
    quat_from_rxyz,
    quat_multiply,
    quat_rotate,
    rxyz_from_quat,
)

if TYPE_CHECKING:
    from seecr.robot import Robot


def command_lengths(source: Source) -> Array | None:
    """Commanded rest lengths (n, m) [m], or None where the file has no such columns."""
    given = source.header.cables("length")
    if not given:
        return None
    m = source.robot.n_cables
    missing = [f"length_{i}_m" for i in range(1, m + 1) if i not in given]
    if missing:
        raise source.half_there("length", missing, f"all {m} cables of the robot")
    return np.stack([_length(source, f"length_{i}") for i in given], axis=1)


def _length(source: Source, quantity: str) -> Array:
    length = source.column(quantity)
    source.refuse(
        length <= 0,
        quantity,
        lambda row: f"expected a length above zero, got {length[row]:g} m",
    )
    return length


def command_pose(source: Source) -> Array:
    """Commanded poses (n, 7); what the robot cannot change may be left out of the file.

    Raises:
        InputFileError: no command at all, or one that is half there.
    """
    present = source.header.present
    if not present("cmd", POSITION + QUATERNION + ANGLES):
        raise source.table.error(
            "no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or length_1_m to "
            f"length_{source.robot.n_cables}_m{near_misses(source.header)}"
        )
    free, reference = free_coordinates(source.robot), source.robot.reference_pose
    position = _group(source, POSITION, "m", free[:3], reference[:3])
    if present("cmd", QUATERNION):
        orientation = source.quaternions("cmd", blank_is_nan=False)
    elif present("cmd", ANGLES):
        rxyz = rxyz_from_quat(reference[3:])
        orientation = quat_from_rxyz(_group(source, ANGLES, "deg", free[3:], rxyz))
    else:
        source.notes.append("No commanded orientation: that of the reference pose is used.")
        orientation = np.tile(reference[3:], (source.n_rows, 1))
    return np.concatenate([position, orientation], axis=1)


def _group(
    source: Source, parts: tuple[str, ...], unit: str, free: Mask, reference: Array
) -> Array:
    """Three coordinates or angles (n, 3); the reference pose's where they cannot change."""
    absent = [k for k, part in enumerate(parts) if not source.has(f"cmd_{part}")]
    missing = [f"cmd_{parts[k]}_{unit}" for k in absent if free[k]]
    if missing:
        need = " ".join(f"cmd_{parts[k]}_{unit}" for k in range(3) if free[k])
        raise source.half_there("commanded pose", missing, need)
    if absent:
        names = " ".join(f"cmd_{parts[k]}" for k in absent)
        source.notes.append(
            f"No {names}: the robot cannot move there, the reference pose's value is used."
        )
    values = np.tile(np.asarray(reference, float), (source.n_rows, 1))
    for k, part in enumerate(parts):
        if k not in absent:
            values[:, k] = source.column(f"cmd_{part}")
    return values


def free_coordinates(robot: Robot) -> Mask:
    """Which of x y z rx ry rz of the platform can change at all, (6,).

    Found by moving the joints at random (product of exponentials, first joint outermost), so
    that any chain of slides and hinges is covered.
    """
    if not robot.joints:
        return np.ones(6, dtype=bool)
    steps = np.random.default_rng(0).uniform(-0.5, 0.5, (8, len(robot.joints)))
    moved = np.array([_pose_coordinates(robot, step) for step in steps])
    free: Mask = np.ptp(moved, axis=0) > 1e-9
    return free


def _pose_coordinates(robot: Robot, steps: Array) -> Array:
    """x y z [m] rx ry rz [rad] (6,) with the joints moved by steps (d,) [m or rad]."""
    reference = np.asarray(robot.reference_pose, float)
    position, quat = reference[:3], reference[3:]
    for joint, step in zip(reversed(robot.joints), steps, strict=True):
        if joint.kind == "slide":
            position = position + step * joint.axis
            continue
        turn = quat_from_rotvec(step * joint.axis)
        position = joint.point + quat_rotate(turn, position - joint.point)
        quat = quat_multiply(turn, quat)
    return np.concatenate([position, rxyz_from_quat(quat)])
