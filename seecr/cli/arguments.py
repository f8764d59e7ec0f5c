"""What the commands of seecr are given: a robot, a model, poses, axes of a grid.

It takes a while to import: commands do so when they are called, not when their help is shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr import (
    Commands,
    InputError,
    InputFileError,
    Model,
    Robot,
    Solution,
    load_model,
    load_robot,
)
from seecr.cli.following import passive_lines
from seecr.cli.results import tell
from seecr.columns.commands import CommandFile, read_commands
from seecr.columns.plausible import ABSURD, scalar_last
from seecr.counted import counted
from seecr.description.cables import ea_of
from seecr.description.mjcf import CABLES
from seecr.effects.base import unfed
from seecr.equilibrium.strange import strained_rows, strange, walked_in_steps
from seecr.pose import NORM_TOLERANCE
from seecr.statics.starts import commanded_poses

_COUNT = 24  # poses of --line


def robot_at(given: Path, cable: str | None = None) -> Robot:
    """The robot of a file, or the shipped one of that name, with another cable if one is named.

    What is strange about it, or read otherwise than written, is told at once.

    Raises:
        RobotError, InputError: no such file and no such name, no such cable.
    """
    robot = load_robot(given, passive_lines())
    if cable is None:
        tell((*robot.notes, *strange(robot)))
        return robot
    try:
        ea = CABLES[cable] if cable in CABLES else ea_of(cable, "--cable")[0]
    except InputError as error:
        known = f"expected {', '.join(CABLES)}, E S"
        raise InputError(str(error).replace("expected E S", known, 1)) from None
    other = replace(robot, ea=np.where(robot.driven, ea, robot.ea))
    tell((*other.notes, *strange(other)))
    return other


def model_at(given: Path | None, robot: Robot) -> Model | None:
    """The model of a file, or none; it notes where values for each file or run are not used."""
    if given is None:
        return None
    model = load_model(given, robot)
    kinds = [(term.name, term.own.kind) for term in model.terms if term.own is not None]
    usual = [
        f"{name} has separate values for each {kind}: the values for no particular {kind} are used"
        for name, kind in kinds
    ]
    return replace(model, notes=(*model.notes, *usual))


def notes_of(
    model: Model | None, solution: Solution, commands: Commands | None = None
) -> tuple[str, ...]:
    """What is to be told of a robot, of commands, of a model, and of answers beyond its data.

    Args:
        model: of the robot. solution: of the commands.
        commands: as given; None for poses without times and temperatures.
    """
    robot = solution.robot
    much = (*strange(robot), *strained_rows(solution))
    slips = (*_outside(robot, solution.command), *scalar_last(robot, solution.command[:, 3:]))
    said = (*robot.notes, *much, *slips)
    if model is None:
        return said
    given = Commands(solution.command) if commands is None else commands
    unsure = walked_in_steps(solution, given, model.terms.effects)
    beyond = model.beyond(solution)
    return (*said, *model.notes, *unfed(model.terms.effects, given), *unsure, *beyond)


def _outside(robot: Robot, commands: NDArray[np.float64]) -> tuple[str, ...]:
    """That commands (n, 7) lie outside the frame, where some do: most likely a slip."""
    away = np.linalg.norm(commands[:, :3] - robot.reference_pose[:3], axis=1)
    out = int(np.sum(away > robot.reach))
    if out == 0:
        return ()
    return (
        f"{out} of {counted(len(away), 'command')} outside the frame: up to {away.max():.3g} m "
        f"from the reference position, and the frame is {robot.reach:.3g} m across",
    )


def pose_of(coordinates: Sequence[float], robot: Robot) -> list[float]:
    """A pose (7,) from X Y Z or X Y Z QW QX QY QZ; turned as the reference pose without the last.

    Raises:
        InputError: another number of numbers, or a position far outside the robot.
    """
    if len(coordinates) not in (3, 7):
        raise InputError(
            f"expected X Y Z or X Y Z QW QX QY QZ, got {counted(len(coordinates), 'number')}"
        )
    check_places(coordinates[:3], robot)
    if len(coordinates) == 7:
        check_unit("QW QX QY QZ", coordinates[3:])
    return [*coordinates[:3], *(coordinates[3:] or robot.reference_pose[3:].tolist())]


def check_places(places: ArrayLike, robot: Robot) -> None:
    """That positions (..., 3) [m] are numbers, and of the robot's size.

    Raises:
        InputError: they are in another unit, which a solve would answer after minutes, if at all.
    """
    array = np.asarray(places, float).reshape(-1, 3)
    far = ~(np.abs(array - robot.reference_pose[:3]) <= ABSURD * robot.reach)
    if np.any(far):
        row, axis = np.argwhere(far)[0]
        raise InputError(
            f"{'XYZ'[axis]}: expected metres, in the range of {robot.name}'s frame, "
            f"{robot.reach:.3g} m across, got {array[row, axis]:g}"
        )


def _check_count(option: str, poses: int, most: int | None = None, cure: str = "") -> None:
    """That there are not more poses than can be solved.

    Raises:
        InputError: there are.
    """
    from seecr.workspace.maps import MOST_POSES  # takes a while to import

    most = MOST_POSES if most is None else most
    if poses > most:
        raise InputError(f"{option}: expected at most {most:.0e} poses, got {poses:.1e}{cure}")


def axes_of(
    texts: Sequence[str], robot: Robot, directions: NDArray[np.float64] | None = None,
    most: int | None = None, cure: str = "",
) -> list[NDArray[np.float64]]:  # fmt: skip
    """The axes of a grid, along x, y and z or along directions (3, 3) in rows.

    Args:
        texts: each as :func:`axis_of` takes it. robot: as described. directions: see above.
        most: poses that are accepted, by default as many as fit into memory.
        cure: what to do about more, for the error.

    Raises:
        InputError: one that is none, or far outside the robot; more poses than can be solved.
    """
    from seecr.workspace.maps import axis_of  # takes a while to import

    axes = [axis_of(text, "--grid") for text in texts]
    _check_count("--grid", math.prod(map(len, axes)), most, cure)
    places = np.array([[axis[k] for axis in axes] for k in (0, -1)])
    check_places(places if directions is None else places @ directions, robot)
    return axes


def check_unit(name: str, turn: Sequence[float]) -> None:
    """That a quaternion is of unit norm, to the rounding of what is typed.

    Raises:
        InputError: it is not.
    """
    norm = sum(part * part for part in turn) ** 0.5
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        raise InputError(
            f"{name}: expected a unit quaternion, scalar first, got one of norm {norm:.4g}"
        )


def wanted_poses_of(poses: Path, robot: Robot, computed_by: str) -> CommandFile:
    """The poses of a file that are wanted of the robot.

    Raises:
        InputFileError: it is no list of commands, or states lengths, which are computed.
    """
    wanted = read_commands(poses, robot)
    if wanted.commands.lengths is not None:
        raise InputFileError.at(
            poses,
            "contains rest lengths; expected the wanted poses, such as cmd_x_m cmd_y_m cmd_z_m: "
            f"lengths are what {computed_by} computes",
        )
    return wanted


def commands_of(
    robot: Robot, poses: Path | None, line: tuple[float, ...] | None, count: int | None,
    grid: tuple[str, ...] | None, turned: tuple[float, ...] | None,
) -> tuple[
    Commands, Mapping[str, Sequence[Any]], tuple[str, ...], NDArray[np.float64] | None,
    Sequence[Any] | None,
]:  # fmt: skip
    """The commands of a file, or along ``--line``, or on a ``--grid``.

    Returns:
        commands, further columns of their file, notes on it, the poses that lengths are for, and
        which commands follow on each other: those of a run, or of a column of the grid.

    Raises:
        InputError: several of these ways, or none; options of another way.
    """
    ways = {"POSES.csv": poses, "--line": line, "--grid": grid}
    given = [name for name, value in ways.items() if value]
    if len(given) != 1:
        got = " and ".join(given) or "none"
        raise InputError(f"expected one of {', '.join(ways)}; got {got}")
    if poses is not None and turned:
        raise InputError(
            "--turned applies to --line and --grid; commands of a file are turned by columns such "
            f"as cmd_rx_deg; leave it out, or add them to {poses}"
        )
    if count and not line:
        raise InputError(
            f"--count applies to --line, got it together with {poses or '--grid'}, which sets the "
            "number of poses; leave it out"
        )
    if poses is not None:
        read = read_commands(poses, robot)
        return read.commands, read.conditions, read.notes, read.wanted, read.conditions.get("run")
    runs = None
    if line:
        check_places(line, robot)
        _check_count("--count", count or _COUNT)
        places = np.linspace(line[:3], line[3:], count or _COUNT)
    else:
        axes = axes_of(grid or (), robot)
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        column = next((len(axis) for axis in reversed(axes) if len(axis) > 1), 1)
        runs = [k // column for k in range(len(places))]
    turn = np.tile(turned or robot.reference_pose[3:], (len(places), 1))
    there = Commands(commanded_poses(np.column_stack([places, turn])))
    return there, {}, ("Poses are counted from 0, as the rows of sweep.json are.",), None, runs
