"""Effects as a user writes them, in no package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import seecr


@dataclass(frozen=True, eq=False)
class Hose(seecr.Effect):
    """A hose pulls along x, the more the farther out: w_x -> w_x + pull x / 0.5 m."""

    name: ClassVar[str] = "hose"
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "a hose that pulls at the platform"
    advice: ClassVar[str] = "take the hose off: expect {pull:.3g} N less at 0.5 m"

    pull: float = seecr.parameter("N", 1.0)

    def edit_setup(self, setup: seecr.Setup) -> None:
        force = np.zeros((len(setup.commands), 6))
        force[:, 0] = self.pull * setup.commands.pose[:, 0] / 0.5
        setup.wrench = setup.wrench + force


@dataclass(frozen=True, eq=False)
class Heavier(seecr.Effect):
    """What platform_mass is, once more: MuJoCo can tell whether a twin has it right."""

    name: ClassVar[str] = "heavier"
    place: ClassVar[str] = "load"
    title: ClassVar[str] = "a platform with a tool"
    advice: ClassVar[str] = "weigh it: expect {added:.3g} kg more"

    added: float = seecr.parameter("kg", 0.05)

    def edit_setup(self, setup: seecr.Setup) -> None:
        setup.mass = setup.mass + self.added
