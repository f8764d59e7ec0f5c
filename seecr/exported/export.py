"""A robot with its model as MJCF: its description, and a file for MuJoCo alone if needed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from seecr.commands import Commands
from seecr.compiled.cable_law import LEAST
from seecr.compiled.columns import CUBIC, FORCE_OF_WEIGHT, QUADRATIC, STRAIN, UP
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.mjcf_text import plain_text
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.effects.edits import edit_setup, setup_with
from seecr.effects.setup import QUANTITIES, History, plain_setup
from seecr.equilibrium.solving import solve
from seecr.errors import InputError, NoRestError
from seecr.exported.bodies import SEGMENTS, bodies_text
from seecr.prediction.experiment import effects_of, senses
from seecr.result import Record, Result
from seecr.statics.solution import Solution
from seecr.statics.starts import commanded_poses

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects


# Which effects of a model an MJCF file can express, found from the quantities that they edit.

# Quantities that a robot's description holds, and those that need more bodies and springs.
_PLAIN = frozenset(("exit_points", "anchor_points", "ea", "mass", "centre_of_mass", "gravity"))
_BODIES = frozenset(
    ("pulley_radius", "quadratic", "cubic", "winch_side", "compliance", "lift", "cable_weight",
     "wrench")
)  # fmt: skip
_LENGTHS = frozenset(name for name, item in QUANTITIES.items() if item.paid_out)
_KNOWN = _PLAIN | _BODIES | _LENGTHS
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


def expressed(robot: Robot, effects: Sequence[Effect], soft: bool = False) -> Expressed:
    """Sort effects by where MJCF can express them.

    Args:
        robot: as described. effects: with their values.
        soft: whether cables are stretched to where their polynomial falls, as MuJoCo's then does.
    """
    said: dict[str, list[Any]] = {"plain": [], "bodies": [], "lengths": [], "nowhere": []}
    every = [_edits(robot, effect) for effect in effects]
    lifts = any("lift" in edits for edits, _law in every)
    wheels = any("pulley_radius" in edits for edits, _law in every)
    for effect, (edits, law) in zip(effects, every, strict=True):
        reasons = {
            LAW: law,
            PAST: edits & _PAST,
            WARM: edits and "temperature" in effect.needs,
            LIFTED_SHEAVE: lifts and wheels and "lift" in edits,
            SOFT: soft and edits & {"quadratic", "cubic"},
            SENSED: not edits & _KNOWN and senses(type(effect)),
        }
        places = {"bodies": _BODIES, "plain": _PLAIN, "lengths": _LENGTHS}
        if why := next((why for why, holds in reasons.items() if holds), ""):
            said["nowhere"].append((effect, why))
        elif place := next((place for place, some in places.items() if edits & some), ""):
            said[place].append(effect)
    return Expressed(**{place: tuple(some) for place, some in said.items()})


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


# The comment at the top of a file for MuJoCo alone, by which it is known to be of an export.
_ALONE = "for MuJoCo alone, written by seecr export"
# Directions whose sine is smaller count as equal.
_ALONG = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class Export(Result):
    """A robot's MJCF.

    Attributes:
        robot: with the part of its model that a description can hold; rest lengths are those
            actually paid out at the reference pose.
        text: its MJCF, which :func:`seecr.load_robot` reads.
        mujoco_text: for MuJoCo alone, at the commanded pose: with pulleys, sag and the like. None
            if ``text`` is complete.
        solution: the equilibrium in that file, its keyframe; None without one.
        plain, bodies, lengths: names of the effects in ``text``, of those added in
            ``mujoco_text``, and of those in the rest lengths of both.
        nowhere: names of the effects in neither, and why.
    """

    robot: Robot
    text: str
    mujoco_text: str | None
    solution: Solution | None
    plain: tuple[str, ...]
    bodies: tuple[str, ...]
    lengths: tuple[str, ...]
    nowhere: tuple[tuple[str, str], ...]

    @property
    def softens(self) -> bool:
        """Whether a law of the cables is in no file because they are stretched too far here."""
        return any(why == SOFT for _name, why in self.nowhere)

    @property
    def leans(self) -> bool:
        """Whether the file's cables hang along gravity, but seecr's along another vertical."""
        if self.solution is None or "cable_weight" not in self.bodies:
            return False
        load = self.solution.tables.load[0]
        weight = load[FORCE_OF_WEIGHT : FORCE_OF_WEIGHT + 3]
        across = np.cross(weight, load[UP : UP + 3])
        return bool(np.linalg.norm(across) > _ALONG * np.linalg.norm(weight))

    def lines(self, name: str = "the file", mujoco_name: str = "the file for MuJoCo") -> list[str]:
        """Which effects are in which file, and which are in none."""
        return list(self._lines(name, mujoco_name))

    def records(self) -> list[Record]:
        """One row per effect: which file has it, or why none does."""
        places = (
            ("the file", self.plain),
            ("the file for MuJoCo", self.bodies),
            ("the rest lengths", self.lengths),
        )
        inside = [(name, place, "") for place, names in places for name in names]
        nowhere = [(name, "nowhere", why) for name, why in self.nowhere]
        return [
            {"effect": name, "where": place, "why": why} for name, place, why in inside + nowhere
        ]

    def as_json(self) -> dict[str, Any]:
        """Where each effect is, the rest lengths at the reference pose, the equilibrium."""
        return {
            "robot": self.robot.name,
            "plain": self.plain,
            "mujoco_alone": self.bodies,
            "rest_lengths": self.lengths,
            "nowhere": dict(self.nowhere),
            "rest_lengths_m": self.robot.rest_lengths,
            "pose": None if self.solution is None else self.solution.pose[0],
        }

    def _lines(self, name: str, mujoco_name: str) -> Iterator[str]:
        yield f"{name} contains {', '.join(self.plain) or 'the robot as it was'}"
        if self.bodies:
            alone = " alone" if mujoco_name.endswith("MuJoCo") else ", for MuJoCo alone,"
            yield f"{mujoco_name}{alone} also contains {', '.join(self.bodies)}"
        if self.robot.constant_tension_N.any():
            yield f"{mujoco_name} has an actuator for each constant tension, which is no spring"
        if "cable_weight" in self.bodies:
            yield (
                f"  cables hang as {SEGMENTS} springs with masses between: as catenaries do at "
                "this pose, nearly so elsewhere"
            )
        if self.leans:
            yield (
                "  its cables sag along the tilted gravity, in seecr along the vertical of their "
                "pulleys and frame: the equilibrium differs by a part of the tilt"
            )
        if self.lengths:
            yield (
                f"only in the rest lengths of the reference pose: {', '.join(self.lengths)}; at "
                "other poses use the rest lengths that seecr computes"
            )
        for effect, why in self.nowhere:
            yield f"not in any file: {effect}; {why}"


def export(robot: GivenRobot, effects: GivenEffects = (), at: ArrayLike | None = None) -> Export:
    """A robot with its model as MJCF, as far as MJCF can express it.

    Given the same rest lengths, MuJoCo comes to rest where :func:`seecr.solve` does.

    Args:
        robot: as described, or its MJCF.
        effects: a model, its file, or effects with values.
        at: (7,) command for which the file for MuJoCo alone is made; the reference pose by default.

    Returns:
        the texts, and which effects are in which of them.

    Raises:
        InputError: not one pose.
        NoRestError: the platform has no stable equilibrium there.

    Example:
        ``seecr.export(robot, "model.toml").text``
    """
    robot = robot_of(robot)
    place = robot.reference_pose[None] if at is None else commanded_poses(at, "at", robot)
    if len(place) != 1:
        raise InputError(f"expected one pose to export at, got {len(place)}")
    said, solution = _sorted(robot, effects_of(effects, robot), place)
    home = Commands(robot.reference_pose[None])
    plain = setup_with((*said.plain, *said.lengths), robot, home)
    described = replace(
        robot, exit_points=plain.exit_points, anchor_points=plain.anchor_points, ea=plain.ea,
        mass=plain.mass, centre_of_mass=plain.centre_of_mass, gravity=plain.gravity,
        rest_lengths=plain.rest_lengths()[0],
    )  # fmt: skip
    mujoco_text = None
    if solution is not None:
        inside = _inside(said)
        setup = setup_with(inside, robot, Commands(place))
        about = f"{robot.name} with {_names(inside)}; {_ALONE}"
        mujoco_text = bodies_text(setup, solution, about)
    comment = f"{robot.name} with {_names(said.plain) or 'no effect'}; written by seecr export"
    plain_names, bodies, lengths = (
        tuple(one.name for one in group) for group in (said.plain, said.bodies, said.lengths)
    )
    nowhere = tuple((one.name, why) for one, why in said.nowhere)
    text = plain_text(described, comment)
    return Export(described, text, mujoco_text, solution, plain_names, bodies, lengths, nowhere)


def wrote(path: Path) -> bool:
    """Whether an export wrote a file for MuJoCo alone."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
    comment, end, _rest = text.partition("-->")
    return bool(end) and comment.rstrip().endswith(_ALONE)


def _sorted(
    robot: Robot, effects: Sequence[Effect], pose: np.ndarray
) -> tuple[Expressed, Solution | None]:
    """Where each effect can be expressed, and the equilibrium in the file for MuJoCo alone."""
    said = expressed(robot, effects)
    solution = _rest(robot, said, pose)
    if solution is not None and _softens(solution):
        said = expressed(robot, effects, soft=True)
        solution = _rest(robot, said, pose)
    return said, solution


def _rest(robot: Robot, said: Expressed, pose: np.ndarray) -> Solution | None:
    """The equilibrium with all that the files hold; None if one file holds it all."""
    if not (said.bodies or robot.constant_tension_N.any()):
        return None
    solution = solve(robot, pose, effects=_inside(said))
    if not solution.converged[0]:
        raise NoRestError(
            f"robot {robot.name}: no rest at the pose to export at: {solution.sentence(0)}; "
            "expected another pose"
        )
    return solution


def _softens(solution: Solution) -> bool:
    """Whether a cable is stretched to where its polynomial is softer than seecr lets it be."""
    row, strain = solution.tables.cables[0], solution.evaluation.states[0, :, STRAIN]
    q, c = row[:, QUADRATIC], row[:, CUBIC]
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = np.clip(np.where(c > 0.0, -q / (3.0 * c), strain), 0.0, np.maximum(strain, 0.0))
    slopes = [1.0 + 2.0 * q * e + 3.0 * c * e**2 for e in (strain, lowest)]
    return bool(np.any(np.minimum(*slopes) < LEAST))


def _inside(said: Expressed) -> tuple[Effect, ...]:
    return (*said.plain, *said.bodies, *said.lengths)


def _names(effects: tuple[Effect, ...]) -> str:
    return ", ".join(effect.name for effect in effects)
