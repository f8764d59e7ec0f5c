"""A setup as effects leave it, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from operator import is_
from threading import Lock

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.effects.checked import edit_setup
from seecr.effects.setup import Setup, plain_setup
from seecr.pose import Array


def setup_with(
    effects: Sequence[Effect], robot: Robot, commands: Commands, wrench: Array | None = None
) -> Setup:
    """The setup of commands as the effects leave it, in their order.

    Args:
        effects: with values.
        robot, commands, wrench: as for :func:`seecr.effects.setup.plain_setup`.
    """
    setup = plain_setup(robot, commands, wrench)
    for effect in effects:
        edit_setup(effect, setup)
    return setup


class Edits:
    """What effects make of one setup.

    A fit shifts one parameter after the other: what the effects before it left is kept. Threads
    may ask at once.
    """

    def __init__(self, plain: Setup) -> None:
        self._plain = plain
        self._kept: list[tuple[Effect, Setup]] = []
        self._lock = Lock()

    def by(self, effects: Sequence[Effect]) -> Setup:
        """The setup as the effects leave it, in their order."""
        with self._lock:
            return self._by([effect for effect in effects if _edits(type(effect))])

    def _by(self, effects: Sequence[Effect]) -> Setup:
        same = 0
        for (one, _left), effect in zip(self._kept, effects, strict=False):
            if one is not effect:
                break
            same += 1
        setup = self._left_by(same)
        if same < len(effects) == len(self._kept):
            later = [effect for effect, _left in self._kept[same + 1 :]]
            if all(map(is_, later, effects[same + 1 :])):
                # one effect is shifted: what all leave as they are will be asked for again
                for effect in effects[same:]:
                    edit_setup(effect, setup)
                return setup
        del self._kept[same:]
        for effect in effects[same:]:
            edit_setup(effect, setup)
            self._kept.append((effect, setup))
            setup = setup.shared()
        return setup

    def _left_by(self, count: int) -> Setup:
        """What the first of the effects left, to be edited."""
        return (self._kept[count - 1][1] if count else self._plain).shared()


def _edits(effect: type[Effect]) -> bool:
    """Whether an effect edits setups; those of the sensors do not."""
    return effect.edit_setup is not Effect.edit_setup
