"""What holds the exit points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from seecr.effects.base import Effect, mean_length, parameter
from seecr.setup import Setup


@dataclass(frozen=True, eq=False)
class FrameCompliance(Effect):
    """Exit points yield towards the pull of their cable: A_i -> A_i + compliance T_i u.

    u points from A_i along the cable: the effective cable is longer by compliance T_i (Hooke).

    Isotropic: the frame moves the way it is pulled. From poses this cannot be told from
    elastic cable behind the exit point of length compliance x E S.
    """

    name: ClassVar[str] = "frame_compliance"
    place: ClassVar[str] = "structure"
    title: ClassVar[str] = "a frame that yields under load"
    advice: ClassVar[str] = (
        "pull an exit point with a spring balance beside a dial gauge: expect {compliance:.4g} mm "
        "per newton"
    )

    compliance: float = parameter(
        "m_per_N", lambda r: 0.3 * mean_length(r) / float(np.mean(r.ea)), bounds=(0.0, 1e3)
    )

    def edit_setup(self, setup: Setup) -> None:
        setup.compliance = setup.compliance + self.compliance
