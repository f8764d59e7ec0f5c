"""What the tracker and the load cells report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from seecr.effects.base import Effect, Readings, of_length, parameter
from seecr.effects.setup import Setup
from seecr.pose import Array, products, quat_from_rotvec, rotated


@dataclass(frozen=True, eq=False)
class TrackerFrame(Effect):
    """The tracker's base frame is not the robot's: reported = R p + t, and R times R_platform.

    R turns about the base origin by the rotation vector, t is the shift.
    """

    name: ClassVar[str] = "tracker_frame"
    anew: ClassVar[tuple[str, ...]] = ("file", "run")
    place: ClassVar[str] = "sensing"
    title: ClassVar[str] = "the tracker's frame relative to the robot's"
    advice: ClassVar[str] = "register the tracker again on targets fixed to the frame"

    shift: Array = parameter("m", of_length(5e-3), size="vector")
    rotation: Array = parameter("rad", 5e-3, size="vector")

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        if np.any(self.rotation):
            turn = quat_from_rotvec(self.rotation)
            readings.position = rotated(turn, readings.position)
            readings.quat_wxyz = products(turn, readings.quat_wxyz)
        readings.position = readings.position + self.shift


@dataclass(frozen=True, eq=False)
class TrackerTarget(Effect):
    """The tracked target is not at the platform origin.

    Reported = p + R_platform shift, orientation R_platform R(rotation): both in the platform
    frame.
    """

    name: ClassVar[str] = "tracker_target"
    anew: ClassVar[tuple[str, ...]] = ("file",)
    place: ClassVar[str] = "sensing"
    title: ClassVar[str] = "the position of the target on the platform"
    advice: ClassVar[str] = "measure where the target sits on the platform"

    shift: Array = parameter("m", of_length(5e-3), size="vector")
    rotation: Array = parameter("rad", 5e-3, size="vector")

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        if np.any(self.shift):
            readings.position = readings.position + rotated(readings.quat_wxyz, self.shift)
        if np.any(self.rotation):
            turn = quat_from_rotvec(self.rotation)
            readings.quat_wxyz = products(readings.quat_wxyz, turn)


@dataclass(frozen=True, eq=False)
class TrackerScale(Effect):
    """The tracker's scale is off: reported position = factor x position.

    Above 1: it reports too much.
    """

    name: ClassVar[str] = "tracker_scale"
    place: ClassVar[str] = "sensing"
    title: ClassVar[str] = "the tracker's scale"
    advice: ClassVar[str] = (
        "measure a scale bar with the tracker: expect {factor:.5f} of its length"
    )

    factor: float = parameter("", 3e-3, null=1.0, bounds=(0.5, 2.0))

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        readings.position = readings.position * self.factor


@dataclass(frozen=True, eq=False)
class TensionScale(Effect):
    """The load cells are off by one factor: reported tension = factor x tension.

    Above 1: they report too much.
    """

    name: ClassVar[str] = "tension_scale"
    place: ClassVar[str] = "sensing"
    title: ClassVar[str] = "the scale of the load cells"
    needs: ClassVar[tuple[str, ...]] = ("tensions",)
    advice: ClassVar[str] = "hang a known weight on a load cell: expect {factor:.3f} of it"

    factor: float = parameter("", 0.1, null=1.0, bounds=(0.05, 20.0))

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        readings.tensions = readings.tensions * self.factor
