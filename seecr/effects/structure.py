"""What holds the exit points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from seecr.description.robot import Robot
from seecr.effects.base import Effect, OfRobot, mean_length, parameter
from seecr.effects.setup import Setup


def _third(robot: Robot) -> float:
    """A frame that yields a third as much as its cables stretch."""
    return 0.3 * mean_length(robot) / float(np.mean(robot.ea))


_PLAUSIBLE = OfRobot("0.3 x the mean cable length / the mean E S", _third)


@dataclass(frozen=True, eq=False)
class FrameCompliance(Effect):
    """Exit points yield to the pull of their cable: A_i -> A_i + C T_i u, C = diag(s, s, upwards).

    u points from A_i along the cable, s is the compliance sideways (Hooke); up is against
    gravity. Frames are stiffer upwards than sideways. Where both are alike the frame moves the
    way it is pulled and the cable is longer by s T_i: from poses this cannot be told from elastic
    cable behind the exit point of length s x E S.
    """

    name: ClassVar[str] = "frame_compliance"
    place: ClassVar[str] = "structure"
    title: ClassVar[str] = "a compliant frame"
    advice: ClassVar[str] = (
        "pull an exit point with a spring balance beside a dial gauge: expect {sideways:.4g} mm "
        "per newton sideways, {upwards:.4g} mm upwards"
    )
    renamed: ClassVar[dict[str, tuple[str, ...]]] = {
        "compliance_m_per_N": ("sideways_m_per_N", "upwards_m_per_N")
    }

    sideways: float = parameter("m_per_N", _PLAUSIBLE, bounds=(0.0, 1e3))
    upwards: float = parameter("m_per_N", _PLAUSIBLE, bounds=(0.0, 1e3))

    def edit_setup(self, setup: Setup) -> None:
        setup.compliance = setup.compliance + self.sideways
        setup.lift = setup.lift + (self.upwards - self.sideways)
