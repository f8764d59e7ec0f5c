"""What a person who measures would find: totals, and those that no robot can have.

An effect's parameter is often a difference: a platform 0.047 kg heavier. A scale shows 0.447 kg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Total:
    """A number as it can be measured on the robot.

    Attributes:
        value: with the effect. nominal: as the robot's file has it.
        unit: of both, as in the suffixes of CSV columns.
        lower, upper: what is possible lies between.
    """

    value: float
    nominal: float
    unit: str
    lower: float = -np.inf
    upper: float = np.inf

    @property
    def possible(self) -> bool:
        """Whether a robot can have it."""
        return bool(self.lower < self.value < self.upper)
