"""What callers give: a robot or a model as a file's path, or as what was read from it."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from crosscheck.errors import CrosscheckError
from seecr.arguments import finite
from seecr.description.mjcf import GivenRobot as GivenRobot
from seecr.description.mjcf import load_robot, robot_file
from seecr.description.mjcf import robot_of as robot_of
from seecr.description.passive import declare
from seecr.description.robot import Robot
from seecr.effects import Effect, GivenEffect, Term, Terms, catalogue, class_of
from seecr.errors import InputError, RobotError
from seecr.folders import check_ours
from seecr.pose import Array
from seecr.prediction.model import Model, effects_given, model_given, new_model

GivenModel: TypeAlias = Model | Iterable[Term | Effect] | str | Path
"""A model, its effects alone, or the path of its TOML; ``()`` is the plain model."""

GivenNames: TypeAlias = Iterable[GivenEffect] | GivenEffect
"""Effects by their names, their classes or instances; or one."""


def considered(only: GivenNames = (), exclude: GivenNames = ()) -> frozenset[str]:
    """Names of the effects that may be missing.

    Args:
        only: these alone; all of the catalogue where there are none.
        exclude: and not these.

    Raises:
        InputError: no effect of a name; the known ones are listed, nearest first. Or two of one
            name.
        CrosscheckError: none is left.
    """
    chosen, left_out = names_of(only, "only"), names_of(exclude, "exclude")
    names = frozenset(chosen or catalogue()) - frozenset(left_out)
    if not names:
        raise CrosscheckError(
            f"no effect is left to consider: only {', '.join(chosen) or 'all'} and not "
            f"{', '.join(left_out)}; leave one of them out"
        )
    return names


def names_of(given: GivenNames, argument: str) -> list[str]:
    """A list of names of effects, each once; one effect stands for itself.

    Raises:
        InputError: something else than effects, or two of one name.
    """
    if isinstance(given, str | type | Effect):
        given = [given]
    if not isinstance(given, Iterable):
        raise InputError(f"{argument}: expected names of effects, got {given!r}")
    found: dict[str, type[Effect]] = {}
    for effect in map(class_of, given):
        if found.setdefault(effect.name, effect) is not effect:
            raise InputError(
                f"{argument}: two effects are called {effect.name}: {found[effect.name].__name__} "
                f"and {effect.__name__}; expected a name of its own for each"
            )
    return list(found)


def copy_robot(source: Path, copy: Path, robot: Robot | None = None) -> None:
    """Copy a robot's MJCF to where nothing of what may stand beside it is.

    Lines of ``robot`` that are passive because its user said so are declared in the copy.

    Raises:
        CrosscheckError: it needs other files, so that the copy is no robot.
    """
    shutil.copyfile(robot_file(source), copy)
    try:
        own = load_robot(copy)
        if robot is not None and own.passive_names != robot.passive_names:
            declare(copy, robot)
    except RobotError:
        raise CrosscheckError(
            f"{source}: needs other files, which a case folder does not have; expected an "
            "MJCF that stands alone"
        ) from None


def check_case(out: str | Path, files: Iterable[str], robot: Path) -> None:
    """Check that a case may be written into a folder, before the work that it is for.

    Args:
        out: the folder. files: the names of its files. robot: copied to ``robot.xml`` there,
            which it may be itself.

    Raises:
        InputFileError: it holds files of these names that no command wrote.
    """
    copy = Path(out) / "robot.xml"
    same = copy.exists() and robot.exists() and copy.samefile(robot)
    check_ours(Path(out), {*files} - ({copy.name} if same else set()))


def file_of(given: GivenRobot) -> Path:
    """The MJCF of a robot, for what reads the file itself.

    Raises:
        RobotError: no such file, or no cable robot in it.
        InputError: a robot of no file, or one whose numbers are no more those of its file.
    """
    robot = robot_of(given)
    wanted = "expected one as seecr.load_robot reads it; seecr.export writes its MJCF"
    if robot.source is None:
        raise InputError(f"robot {robot.name} was not read from a file; {wanted}")
    if isinstance(given, Robot) and not _same_numbers(
        given, load_robot(robot.source, given.passive_names)
    ):
        raise InputError(f"robot {robot.name} has different numbers from {robot.source}; {wanted}")
    return robot.source


def opened(given: GivenModel, robot: Robot) -> GivenModel:
    """The same, read if it is a path, so that it is read once.

    Raises:
        InputFileError: no such file, or no model of this robot in it.
    """
    return model_given(given, robot) if isinstance(given, str | Path) else given


def basis_of(given: GivenModel, robot: Robot) -> Model:
    """The model that fitted values are written into: the one given, or a new one of the robot.

    Raises:
        InputFileError: no such file, or no model of this robot in it.
    """
    return model_given(given, robot) if isinstance(given, Model | str | Path) else new_model(robot)


def _same_numbers(one: Robot, other: Robot) -> bool:
    pairs = [(getattr(one, field.name), getattr(other, field.name)) for field in fields(Robot)]
    return all(np.array_equal(a, b) for a, b in pairs if isinstance(a, np.ndarray | float))


def model_of(given: GivenModel, robot: Robot) -> tuple[Terms, tuple[str, ...]]:
    """The model's effects and what its file says about them, read if need be.

    Raises:
        InputFileError: no such file, or no model of this robot in it.
        InputError: something else than effects with values.
    """
    effects, notes = effects_given(given, robot)
    return Terms(one if isinstance(one, Term) else Term.of(robot, one) for one in effects), notes


def check_above_zero(sizes: Any) -> None:
    """Check that the fields of a dataclass are numbers above zero, or None.

    Raises:
        InputError: something else.
    """
    for name, value in vars(sizes).items():
        if value is None:
            continue
        size = finite(value, name)
        if size.shape or not size > 0.0:
            raise InputError(f"{name}: expected a number above zero, got {value!r}")


def numbers_of(option: str, text: str, count: int = 3, expected: str = "") -> Array:
    """So many numbers (count,) between commas, as an option gives them.

    Args:
        option: its name. text: what was given. count: of the numbers.
        expected: what is said of other input.

    Raises:
        CrosscheckError: other than that.
    """
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not np.isfinite(values).all():
        expected = expected or f"{count} numbers such as 0.1,0,2.5"
        raise CrosscheckError(f"{option}: expected {expected}, got {text!r}")
    return values
