"""What the commands of seecr are given: a robot, a model, numbers that may be negative."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from seecr.cli.options import FILE, Number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from seecr import Commands, Model, Robot, Solution

F = TypeVar("F", bound=Callable[..., Any])

# A number below zero, or an axis of a grid that begins with one.
_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?(:.*)?")


_LEAST_EA, _MOST_EA = 1e-3, 1e12  # [N]: a steel rope as thick as an arm has 1e9
_MOST_POSES = 10_000_000  # of a grid or line; more would take days, and all memory


class NumbersCommand(click.Command):
    """A command whose negative numbers are values, not options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Let negative numbers pass as arguments; refuse other unknown options as ever."""
        known = {name for p in self.get_params(ctx) for name in (*p.opts, *p.secondary_opts)}
        for arg in args[: args.index("--") if "--" in args else None]:
            name = arg.partition("=")[0]
            is_option = len(arg) > 1 and arg.startswith("-") and not _NUMBER.fullmatch(arg)
            if is_option and name not in known:
                near = difflib.get_close_matches(name, known, n=3)
                raise click.NoSuchOption(name, possibilities=near, ctx=ctx)
        ctx.ignore_unknown_options = True
        return super().parse_args(ctx, args)


def robot_options(function: F) -> F:
    """``ROBOT``, ``--cable`` and ``--model``, given as ``robot``, ``cable`` and ``model``."""
    function = click.option(
        "--model",
        type=FILE,
        metavar="M.toml",
        help="Model file with the robot's effects.  [default: plain SEECR]",
    )(function)
    function = click.option(
        "--cable",
        metavar="NAME|N",
        help=(
            "k_c = E S of all cables, instead of that in the robot's file: vectran, fishing, or a "
            "number [N]."
        ),
    )(function)
    return click.argument("robot", type=FILE, metavar="ROBOT")(function)


def limit_options(function: F) -> F:
    """``--lowest`` and ``--highest``, given as ``lowest`` and ``highest`` [N], None without."""
    function = click.option(
        "--highest", type=Number(), metavar="N", help="Highest allowed tension of every cable [N]."
    )(function)
    return click.option(
        "--lowest",
        type=Number(),
        default=0.0,
        show_default=True,
        metavar="N",
        help="Lowest allowed tension of every cable [N].",
    )(function)


def turned_option(of: str) -> Callable[[F], F]:
    """``--turned``, the orientation ``of`` what it is said to be of, given as ``turned``."""
    return click.option(
        "--turned",
        nargs=4,
        type=Number(),
        metavar="QW QX QY QZ",
        callback=_unit_turn,
        help=f"Orientation of {of}.  [default: that of the reference pose]",
    )


def _unit_turn(
    _ctx: click.Context, _option: click.Parameter, value: tuple[float, ...] | None
) -> tuple[float, ...] | None:
    """``--turned`` as given, if it is a rotation."""
    if value is not None:
        _check_unit("--turned", value)
    return value


def _check_unit(name: str, turn: Sequence[float]) -> None:
    """That a quaternion is of unit norm, to the rounding of what is typed.

    Raises:
        InputError: it is not.
    """
    from seecr import InputError
    from seecr.pose import NORM_TOLERANCE

    norm = sum(part * part for part in turn) ** 0.5
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        raise InputError(
            f"{name}: expected a unit quaternion, scalar first, got one of norm {norm:.4g}"
        )


_FIGURES = ("png", "svg")


def files_of_pictures(name: str) -> list[str]:
    """All files of that name that ``--figure`` and ``--no-recording`` write or leave out."""
    return [f"{name}.{kind}" for kind in (*_FIGURES, "rrd")]


def picture_options(function: F) -> F:
    """``--figure`` and ``--no-recording``, given as ``figure`` and ``no_recording``."""
    function = click.option(
        "--no-recording", is_flag=True, help="Do not write a recording (.rrd)."
    )(function)
    return click.option(
        "--figure",
        type=click.Choice([*_FIGURES, "none"]),
        default="png",
        show_default=True,
        help="File type of the figure.",
    )(function)


def robot_at(given: Path, cable: str | None = None) -> Robot:
    """The robot of a file, or the shipped one of that name, with another cable if one is named.

    Raises:
        RobotError, InputError: no such file and no such name, no such cable.
    """
    import numpy as np

    from seecr import InputError, load_robot
    from seecr.description.mjcf import CABLES

    robot = load_robot(given)
    if cable is None:
        return robot
    try:
        ea = CABLES[cable] if cable in CABLES else float(cable)
    except ValueError:
        ea = -1.0
    if not _LEAST_EA <= ea <= _MOST_EA:
        raise InputError(
            f"--cable: expected {', '.join(CABLES)} or k_c from {_LEAST_EA:g} to {_MOST_EA:g} N, "
            f"got {cable!r}"
        )
    return replace(robot, ea=np.full(robot.n_cables, ea))


def model_at(given: Path | None, robot: Robot) -> Model | None:
    """The model of a file, or none."""
    from seecr import load_model

    if given is None:
        return None
    model = load_model(given, robot)
    return replace(model, notes=(*model.notes, *_usual(model)))


def notes_of(
    model: Model | None, solution: Solution, commands: Commands | None = None
) -> tuple[str, ...]:
    """What is to be told of a robot, of commands, of a model, and of answers beyond its data.

    Args:
        model: of the robot. solution: of the commands.
        commands: as given; None for poses without times and temperatures.
    """
    from seecr import Commands
    from seecr.columns.plausible import scalar_last
    from seecr.effects.base import unfed
    from seecr.equilibrium.solving import strained, strained_rows

    robot = solution.robot
    much = (*strained(robot), *strained_rows(solution))
    slips = (*outside(robot, solution.command), *scalar_last(robot, solution.command[:, 3:]))
    said = (*robot.notes, *much, *slips)
    if model is None:
        return said
    given = Commands(solution.command) if commands is None else commands
    return (*said, *model.notes, *unfed(model.terms.effects, given), *model.beyond(solution))


def outside(robot: Robot, commands: NDArray[np.float64]) -> tuple[str, ...]:
    """That commands (n, 7) lie outside the frame, where some do: most likely a slip."""
    import numpy as np

    from seecr.counted import counted

    away = np.linalg.norm(commands[:, :3] - robot.reference_pose[:3], axis=1)
    out = int(np.sum(away > robot.reach))
    if out == 0:
        return ()
    return (
        f"{out} of {counted(len(away), 'command')} outside the frame: up to {away.max():.3g} m "
        f"from the reference position, and the frame is {robot.reach:.3g} m across",
    )


def _usual(model: Model) -> list[str]:
    """That values of no file or run in particular are used, where there are others."""
    own = [(term.name, term.own.kind) for term in model.terms if term.own is not None]
    return [
        f"{name} has separate values for each {kind}: the values for no particular {kind} are used"
        for name, kind in own
    ]


def pose_of(coordinates: Sequence[float], robot: Robot) -> list[float]:
    """A pose (7,) from X Y Z or X Y Z QW QX QY QZ; turned as the reference pose without the last.

    Raises:
        InputError: another number of numbers, or a position far outside the robot.
    """
    from seecr import InputError
    from seecr.counted import counted

    if len(coordinates) not in (3, 7):
        raise InputError(
            f"expected X Y Z or X Y Z QW QX QY QZ, got {counted(len(coordinates), 'number')}"
        )
    check_places(coordinates[:3], robot)
    if len(coordinates) == 7:
        _check_unit("QW QX QY QZ", coordinates[3:])
    return [*coordinates[:3], *(coordinates[3:] or robot.reference_pose[3:].tolist())]


def check_places(places: ArrayLike, robot: Robot) -> None:
    """That positions (..., 3) [m] are numbers, and of the robot's size.

    Raises:
        InputError: they are in another unit, which a solve would answer after minutes, if at all.
    """
    import numpy as np

    from seecr import InputError
    from seecr.columns.plausible import ABSURD

    array = np.asarray(places, float).reshape(-1, 3)
    far = ~(np.abs(array - robot.reference_pose[:3]) <= ABSURD * robot.reach)
    if np.any(far):
        row, axis = np.argwhere(far)[0]
        raise InputError(
            f"{'XYZ'[axis]}: expected metres, in the range of {robot.name}'s frame, "
            f"{robot.reach:.3g} m across, got {array[row, axis]:g}"
        )


def check_count(option: str, poses: int) -> None:
    """That there are not more poses than can be solved.

    Raises:
        InputError: there are.
    """
    from seecr import InputError

    if poses > _MOST_POSES:
        raise InputError(f"{option}: expected at most {_MOST_POSES:.0e} poses, got {poses:.1e}")


def axes_of(
    texts: Sequence[str], robot: Robot, directions: NDArray[np.float64] | None = None
) -> list[NDArray[np.float64]]:
    """The axes of a grid, along x, y and z or along directions (3, 3) in rows.

    Raises:
        InputError: one that is none, or far outside the robot; more poses than can be solved.
    """
    import math

    import numpy as np

    axes = [_axis_of(text) for text in texts]
    total = math.prod(len(axis) for axis in axes)
    check_count("--grid", total)
    places = np.array([[axis[k] for axis in axes] for k in (0, -1)])
    check_places(places if directions is None else places @ directions, robot)
    return axes


def _axis_of(text: str) -> NDArray[np.float64]:
    """One axis of a grid: FIRST:LAST:COUNT or one number.

    Raises:
        InputError: it is neither.
    """
    import numpy as np

    from seecr import InputError

    parts = text.split(":")
    try:
        if len(parts) == 1:
            return np.array([float(text)])
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) != 3 or count < 1 or not np.isfinite(last - first):
            raise ValueError
    except (ValueError, IndexError):
        raise InputError(
            f"--grid: expected FIRST:LAST:COUNT with a count above zero, or one number [m], "
            f"got {text!r}"
        ) from None
    from seecr.workspace.maps import evenly  # takes a while to import

    return evenly(first, last, min(count, _MOST_POSES + 1))
