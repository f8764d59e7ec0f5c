"""What tracker and load cells make of a true pose, effect by effect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate

Reading = tuple[Array, Array, Array]
"""Position (n, 3) [m], quaternion (n, 4), tensions (n, m) [N]."""
Sensor = Callable[[Reading], Reading]


def _frame(effect: Any) -> Sensor:
    def read(reading: Reading) -> Reading:
        position, quat, tensions = reading
        turn = quat_from_rotvec(effect.rotation)
        return quat_rotate(turn, position) + effect.shift, quat_multiply(turn, quat), tensions

    return read


def _target(effect: Any) -> Sensor:
    def read(reading: Reading) -> Reading:
        position, quat, tensions = reading
        turned = quat_multiply(quat, quat_from_rotvec(effect.rotation))
        return position + quat_rotate(quat, effect.shift), turned, tensions

    return read


def _scale(effect: Any) -> Sensor:
    return lambda reading: (effect.factor * reading[0], reading[1], reading[2])


def _tension_scale(effect: Any) -> Sensor:
    return lambda reading: (reading[0], reading[1], effect.factor * reading[2])


SENSING: dict[str, Callable[[Any], Sensor]] = {
    "tracker_frame": _frame,
    "tracker_target": _target,
    "tracker_scale": _scale,
    "tension_scale": _tension_scale,
}
