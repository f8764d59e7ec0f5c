"""Commands and poses given by callers, and poses at which a search starts."""

from __future__ import annotations

from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from seecr.arguments import finite, numbers
from seecr.commands import Commands
from seecr.counted import rows_words
from seecr.description.joints import values_of_pose
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import LARGEST, NORM_TOLERANCE, Array
from seecr.statics import batch
from seecr.statics.tables import Tables

__all__ = ["Commanded", "HasCommands", "answered", "commanded_poses", "commands_from", "start_of"]


@runtime_checkable
class HasCommands(Protocol):
    """What holds commands among other things, such as ``crosscheck.Measurements``."""

    def as_commands(self, robot: Robot) -> Commands:
        """The commands to the robot."""


Commanded: TypeAlias = Commands | HasCommands | ArrayLike
"""Commands, what holds them, or commanded poses (n, 7)."""


def commands_from(given: Commanded, robot: Robot) -> Commands:
    """Commands as the statics takes them.

    Raises:
        InputError: neither commands nor poses (n, 7) with unit quaternions.
    """
    if isinstance(given, Commands):
        return given
    if isinstance(given, HasCommands):
        return given.as_commands(robot)
    return Commands(commanded_poses(given))


def answered(commands: Commands) -> Commands:
    """The commands, if all lengths are numbers; a correction has NaN for poses without an answer.

    Raises:
        InputError: a row has none.
    """
    if commands.lengths is None:
        return commands
    lengths = numbers(commands.lengths, "lengths of the commands")
    odd = ~(np.abs(lengths) <= LARGEST)  # also of NaN
    lost = np.flatnonzero(np.atleast_2d(odd).any(axis=1))
    if len(lost):
        raise InputError(
            f"{rows_words(lost, commands.line)} of the commands: expected finite lengths, got "
            f"{lengths[odd][0]:g}; leave out rows for which a correction has none: "
            "commands.rows(np.flatnonzero(correction.found))"
        )
    return commands


def start_of(
    robot: Robot, tables: Tables, start: Array | None
) -> tuple[Array | None, Array | None]:
    """Deviations and joint values of start poses (n, 7)."""
    if start is None:
        return None, None
    if not robot.joints:
        return batch.deviations(tables, start), None
    values = values_of_pose(robot, np.concatenate([start, tables.poses]))[0]
    change = values[: len(start)] - values[len(start) :]
    return batch.deviations(tables, start), change * np.where(robot.hinges, robot.length, 1.0)


def commanded_poses(values: ArrayLike, name: str = "poses") -> Array:
    """Checked poses (n, 7) with unit quaternions; ``name`` is for errors."""
    array = np.atleast_2d(finite(values, name))
    if array.ndim != 2 or array.shape[1] != 7:
        raise InputError(f"{name} must be (n, 7), x y z qw qx qy qz, got {np.shape(values)}")
    norm = np.linalg.norm(array[:, 3:], axis=1)
    if np.any(np.abs(norm - 1.0) > NORM_TOLERANCE):
        row = int(np.argmax(np.abs(norm - 1.0)))
        raise InputError(
            f"{name} row {row} has a quaternion of norm {norm[row]:.4g}; expected a unit "
            "quaternion, scalar first"
        )
    out = array.copy()
    exact = np.abs(norm - 1.0) > 1e-15
    out[exact, 3:] /= norm[exact, None]
    return out
