"""``seecr correct``: what to tell the winches so that the platform comes to wanted poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seecr.cli import options
from seecr.cli.following import following, given_with, mapping
from seecr.cli.progress import progress_share
from seecr.cli.results import made_by, untold

if TYPE_CHECKING:
    from seecr import Model, Robot
    from seecr.columns.commands import CommandFile

# A tracker that reads poses off by less [m] is not worth a line.
_SEEN = 1e-6


@options.command(
    "seecr correct robot.xml poses.csv --model model.toml --out corrected",
    "seecr correct robot.xml poses.csv --lowest 1 --highest 50 --aim middle",
    "seecr correct robot.xml --grid 0.2:0.6:9 0.1:0.4:7 0.15 --model model.toml --out table",
    "seecr sweep robot.xml corrected/corrected.csv --model model.toml",
    cls=options.NumbersCommand,
)
@options.robot
@click.argument("poses", type=options.FILE, metavar="[POSES.csv]", required=False)
@options.option("--grid X Y Z", "Each FIRST:LAST:COUNT or one number [m]; z varies fastest.")
@options.turned("--grid")
@options.columns
@options.limits
@options.option(
    "--aim safe|minimum|middle|N,N,...",
    "Where tensions should be within their limits, or the wanted tensions: one, or one per cable. "
    "Safe ones are the smallest that the model, as uncertain as it is, keeps within the limits. "
    "The nearest ones that balance are taken: with the middle Pott's closed form, wherever that "
    "is within the limits.",
    default="safe",
)
@options.option(
    "--prefer [pose|position]", "What to keep of a pose that cannot be held.", default="pose"
)
@options.option(
    "--as-read",
    "Take the poses as what the model's tracker should read, not as poses in the base frame.",
)
@options.out("seecr-correction")
@options.as_json
def command(
    robot: Path, poses: Path | None, cable: str | None, model: Path | None, lowest: float,
    highest: float | None, aim: str, prefer: str, as_read: bool, out: Path, as_json: bool,
    **ways: Any,
) -> int:  # fmt: skip
    """Find the commands that bring the platform to rest at the poses of a file or a grid.

    ROBOT is an MJCF file or the name of a shipped robot, POSES.csv a list of commands: the wanted
    poses. Elasticity and all effects of the model are taken into account; tensions stay within the
    limits. A pose that cannot be held is replaced by the nearest one that can (without --highest,
    the nearest of those that strain no cable by more than 5 %), and the program says which cables
    would have to push, or pull more than allowed. Without --highest it says how much cables are
    strained, and which ropes that breaks. If the model has a covariance, tensions keep a
    distance from the limits, so that they stay within them with a probability of 0.99 wherever the
    balance allows it, and correction.json gives that probability for each row.

    With --grid, table.csv is a look-up table for a controller, too: x_m, y_m, z_m, and what to
    command there, length_1_m ... (told lengths, counted as the plain model counts; empty without an
    answer), and reached, 1 or 0. Each pose of it is reached from the reference pose.

    If POSES.csv states positions alone and the robot has fewer cables than degrees of freedom, it
    may turn as the balance demands: positions are reached in whatever orientation holds them.

    Poses are those of the platform in the base frame. A calibration divides errors between robot
    and tracker as well as it can, and may leave the platform farther off in the base frame than
    before; only what the tracker will read is certain. With --as-read the platform is brought to
    where the model's tracker reads the poses of the file, and want_* are these places. If the
    tracker is known to read the platform in the base frame, calibrate with --exclude
    tracker_frame,tracker_target.

    If another equilibrium with the same lengths is lower than the pose reached, the program says
    so, as seecr sweep does. seecr sweep --follow says which of them the way there leads to.

    Writes corrected.csv and corrected.toml, which every command reads as commands, and
    correction.json. Poses without any answer are left out of corrected.csv; poses are named by
    their line in POSES.csv. If no pose has an answer, only correction.json is written, which says
    why.

    \b
    Exit status: 0 all poses reached, or some and the others replaced by the nearest, 2 bad input,
    3 a pose without an answer, one at which the platform does not come to rest, or none reached.
    """  # fmt: skip
    from seecr import correct, kept_chance, lower_equilibria
    from seecr.cli.arguments import model_at, notes_of, robot_at
    from seecr.files import json_text, with_toml, write_texts
    from seecr.folders import check_ours, staged
    from seecr.show.batch_words import chance_lines, rope_lines, turned_words
    from seecr.show.files import corrected_csv, corrected_toml, lookup_csv

    machine = robot_at(robot, cable)
    own = model_at(model, machine)
    wanted = _wanted(machine, poses, **ways)
    wanted, tracker = _as_tracked(machine, wanted, own, as_read)
    # fewer cables than degrees of freedom hold no orientation of one's choice
    turns = wanted.any_orientation and machine.n_driven < machine.n_dof
    limits = float("inf") if highest is None else highest
    near = aim_of(aim, machine.n_driven)
    commands_of_it = ("corrected.csv", "corrected.toml", "table.csv")
    made = made_by(machine.source, poses, model)
    where: dict[str, Any] = {"read": with_toml(poses), "made": made}
    with staged(out, names=["correction.json"], sometimes=commands_of_it, **where) as folder:
        check_ours(out, commands_of_it)
        with progress_share("correcting") as tell:
            found = correct(
                machine, wanted.commands, effects=own or (), lowest=lowest, highest=limits,
                aim=near, prefer=prefer, any_orientation=turns,
            )  # fmt: skip
            within = {"lowest": lowest, "highest": limits}
            kept = None
            if own is not None:
                tell("chances", 0.8)
                kept = kept_chance(machine, found.commands, own, **within)
            told = replace(found.solution, line=found.commands.line)
            tell("lower equilibria", 0.9)
            lower = lower_equilibria(told)
            tell("corrected", 1.0)
        status = 0 if found.stays.all() and found.reached.any() else 3
        notes = [*notes_of(own, told, wanted.commands), *wanted.notes, *tracker]
        if turns and found.reached.any():
            notes.append(turned_words(found))
        told_of_it = {"made": made, "exit_status": status, "notes": notes}
        text = json_text({**told_of_it, **found.as_json(kept), "lower": lower})
        files = {"correction.json": text + "\n"}
        if found.found.any():  # a list without commands is none that anything reads
            texts = [corrected_csv(found, wanted), corrected_toml(wanted)]
            if poses is None:
                texts.append(lookup_csv(found))
            files |= dict(zip(commands_of_it, texts, strict=False))
        write_texts({folder / name: text for name, text in files.items()})
    then = mapping(machine, robot, cable, own)  # where there is something to hold
    if found.found.any():
        given = (*given_with(cable, model), *(("--follow",) if len(lower.rows) else ()))
        then = following("seecr", "sweep", robot, out / "corrected.csv", *given)
    chances = chance_lines(found, kept, aim == "minimum", highest is not None)
    said = [*found.lines(), *rope_lines(found, cable), *chances, *lower.lines()]
    lines = [*untold(notes), *said, f"Results in {out}/", then]
    click.echo(text if as_json else "\n".join(lines))
    return status


def _wanted(
    robot: Robot, poses: Path | None, grid: tuple[str, ...] | None, turned: tuple[float, ...] | None
) -> CommandFile:
    """The wanted poses of a file or of a grid; each of a grid is a run of its own."""
    import numpy as np

    from seecr.cli.arguments import commands_of, wanted_poses_of
    from seecr.columns.commands import CommandFile

    if poses is not None and grid is None and turned is None:
        return wanted_poses_of(poses, robot, "correct")
    found, _more, notes, _wanted, _runs = commands_of(robot, poses, None, None, grid, turned)
    each = np.arange(len(found))
    return CommandFile(replace(found, run=each), None, tuple(map(str, each)), notes)


def aim_of(text: str, cables: int) -> str | list[float] | float:
    """The name of an aim, or tensions [N]."""
    from math import isfinite

    from seecr import InputError

    if text in ("safe", "minimum", "middle"):
        return text
    try:
        tensions = [float(part) for part in text.split(",")]
    except ValueError:
        tensions = []
    if len(tensions) not in (1, cables) or not all(map(isfinite, tensions)):
        raise InputError(
            f"--aim {text}: expected safe, minimum, middle, or tensions [N]: one, or {cables} with "
            "commas between, one per cable"
        )
    return tensions if len(tensions) > 1 else tensions[0]


def _as_tracked(
    robot: Robot, wanted: CommandFile, model: Model | None, as_read: bool
) -> tuple[CommandFile, list[str]]:
    """Where the platform is to come to, and what the model's tracker has to do with it."""
    import numpy as np

    from seecr import InputError, placed, tracked
    from seecr.show.batch_words import joint_lines
    from seecr.units import millimetres

    if model is None:
        if as_read:
            raise InputError("--as-read needs what the tracker reads; expected --model M.toml")
        return wanted, []
    commands = wanted.commands
    if as_read:
        at = placed(robot, commands, model)
        away = np.linalg.norm(at.pose[:, :3] - commands.pose[:, :3], axis=1).max()
        return replace(wanted, commands=at), [
            f"as read: the platform is brought to places up to {millimetres(away, 3)} from the "
            "wanted poses, where the model's tracker reads the wanted poses; want_* are those "
            "places",
            *joint_lines(commands.pose, tracked(robot, at, model), _SEEN),
        ]
    read = tracked(robot, commands, model)
    away = np.linalg.norm(read[:, :3] - commands.pose[:, :3], axis=1).max()
    if away <= _SEEN:
        return wanted, []
    return wanted, [
        f"the model's tracker reads these poses up to {millimetres(away, 3)} off: the platform is "
        "brought to them in the base frame, which a calibration with a tracker knows no better "
        "than that; --as-read brings the readings to them"
    ]
