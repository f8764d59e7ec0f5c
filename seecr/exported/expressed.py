"""Which effects of a model an MJCF file can express, found from the quantities that they edit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.effects.edits import edit_setup
from seecr.effects.setup import QUANTITIES, History, plain_setup
from seecr.prediction.experiment import senses

# Quantities that a robot's description holds, and those that need more bodies and springs.
_PLAIN = frozenset(("exit_points", "anchor_points", "ea", "mass", "centre_of_mass", "gravity"))
_BODIES = frozenset(
    ("pulley_radius", "quadratic", "cubic", "winch_side", "compliance", "lift", "cable_weight",
     "wrench")
)  # fmt: skip
_LENGTHS = frozenset(name for name, item in QUANTITIES.items() if item.paid_out)
_PAST = frozenset(name for name, item in QUANTITIES.items() if item.history is not History.NONE)

PAST = "it depends on the motion before"
WARM = "it depends on the temperature, which no MJCF states"
SENSED = "it changes what sensors read, not where the platform rests"
LAW = "it has its own law for the cables"
SOFT = (
    "at this pose cables are stretched to where its polynomial falls; seecr keeps a hundredth of "
    "their stiffness there, and MuJoCo does not"
)
LIFTED_SHEAVE = "with pulleys, the frame must be equally compliant in all directions"


@dataclass(frozen=True)
class Expressed:
    """Effects by where they can be expressed; those at their null values are in none.

    Attributes:
        plain: in a robot's description, which :func:`seecr.load_robot` reads.
        bodies: in a file for MuJoCo alone.
        lengths: in the rest lengths.
        nowhere: (effect, reason).
    """

    plain: tuple[Effect, ...]
    bodies: tuple[Effect, ...]
    lengths: tuple[Effect, ...]
    nowhere: tuple[tuple[Effect, str], ...]


def expressed(robot: Robot, effects: Sequence[Effect]) -> Expressed:
    """Sort effects by where MJCF can express them."""
    plain: list[Effect] = []
    bodies: list[Effect] = []
    lengths: list[Effect] = []
    nowhere: list[tuple[Effect, str]] = []
    for effect in effects:
        edits, law = _edits(robot, effect)
        if law:
            nowhere.append((effect, LAW))
        elif edits & _PAST:
            nowhere.append((effect, PAST))
        elif edits and "temperature" in effect.needs:
            nowhere.append((effect, WARM))
        elif edits & _BODIES:
            bodies.append(effect)
        elif edits & _PLAIN:
            plain.append(effect)
        elif edits & _LENGTHS:
            lengths.append(effect)
        elif senses(type(effect)):
            nowhere.append((effect, SENSED))
    yields = [one for one in bodies if "lift" in _edits(robot, one)[0]]
    if yields and any("pulley_radius" in _edits(robot, one)[0] for one in bodies):
        nowhere += [(one, LIFTED_SHEAVE) for one in yields]
        bodies = [one for one in bodies if one not in yields]
    return Expressed(tuple(plain), tuple(bodies), tuple(lengths), tuple(nowhere))


def without_law(robot: Robot, said: Expressed) -> Expressed:
    """The same without the effects that bend the cables' elastic law."""
    bent = [one for one in said.bodies if _edits(robot, one)[0] & {"quadratic", "cubic"}]
    return replace(
        said,
        bodies=tuple(one for one in said.bodies if one not in bent),
        nowhere=(*said.nowhere, *((one, SOFT) for one in bent)),
    )


def _edits(robot: Robot, effect: Effect) -> tuple[set[str], bool]:
    """Names of the quantities that an effect changes, and whether it adds a cable law."""
    # some effects change nothing at the reference pose; hence a second pose
    poses = np.stack([robot.reference_pose, robot.reference_pose])
    poses[1, :3] += 0.3 * robot.length
    commands = Commands(poses, temperature=np.array([20.0, 35.0]))
    plain, edited = plain_setup(robot, commands), plain_setup(robot, commands)
    edit_setup(effect, edited)
    names = {
        name
        for name in QUANTITIES
        if not np.array_equal(getattr(plain, name), getattr(edited, name))
    }
    return names, bool(edited.laws)
