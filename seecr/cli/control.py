"""``seecr control``: what a robot does under different schemes of control."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.progress import progress_bar
from seecr.cli.results import files_of_pictures, made_by

if TYPE_CHECKING:
    from seecr import Robot

_AS_GOOD = "--believes and --is are the same: the controller knows the robot exactly"

believes = options.together(
    options.passive,
    options.option(
        "--believes M.toml", "Model that the controller believes.  [default: plain SEECR]"
    ),
)
truth = options.option(
    "--is TRUE.toml", "Model of what the robot really is.  [default: plain SEECR]", name="true"
)
schemes = options.option(
    "--scheme NAME,...",
    "Schemes to compare: geometric, elastic, stiffness, pose_feedback, tension_feedback, or sums "
    "such as elastic+pose_feedback.",
    default="geometric,elastic,pose_feedback",
)
loop = options.together(
    options.option("--gain G", "Gain of the feedbacks.", options.Number(), default=0.5),
    options.option("--rate HZ", "How often sensors are read [Hz].", options.Number(), default=10.0),
    options.option(
        "--delay S",
        "Time until a reading is used [s], in whole steps.",
        options.Number(),
        default=0.0,
    ),
)

aims = options.together(
    options.limits,
    options.option("--aim minimum|middle|N,N,...", "As of seecr correct.", default="minimum"),
    options.option(
        "--prefer [pose|position]", "What to keep of a pose that cannot be held.", default="pose"
    ),
    options.option(
        "--stiff [least|x|y|z|rx|ry|rz]",
        "Stiffness that the scheme stiffness makes largest: the least one, or that against a force "
        "or moment along an axis.",
        default="least",
    ),
    options.option(
        "--holding CABLE,...", "Winches that hold tensions in tension_feedback.  [default: all]"
    ),
    options.option(
        "--reads KIND,...",
        "What sensors read: position, orientation, tensions.",
        default="position,orientation,tensions",
    ),
    options.option(
        "--noise M RAD N",
        "One standard deviation of a reading of position [m], orientation [rad] and tension [N].  "
        "[default: none]",
        options.Number(min=0.0),
    ),
    options.option("--seed N", "Of the noise.", options.WholeNumber(min=0), default=0),
    options.option("--unstable", "Run loops that hold nowhere, too."),
)


@options.command(
    "seecr control demobot_cogiro poses.csv --is true.toml",
    "seecr control robot.xml poses.csv --scheme elastic,elastic+pose_feedback --believes m.toml "
    "--is true.toml --gain 0.8 --delay 0.1",
    "seecr control robot.xml poses.csv --scheme stiffness --highest 50 --stiff z",
    cls=options.NumbersCommand,
)
@click.argument("robot", type=options.FILE, metavar="ROBOT")
@click.argument("poses", type=options.FILE, metavar="POSES.csv")
@schemes
@believes
@truth
@loop
@options.option("--steps N", "Most steps at each pose.", options.WholeNumber(min=1), default=200)
@aims
@options.pictures
@options.out("seecr-control")
@options.as_json
def command(
    robot: Path, poses: Path, scheme: str, believes: Path | None, true: Path | None, figure: str,
    no_recording: bool, out: Path, as_json: bool, **ways: Any,
) -> int:  # fmt: skip
    """Show what a robot does whose controller believes another one.

    ROBOT is an MJCF file or the name of a shipped robot, POSES.csv a list of wanted poses. At each
    step the winches turn, the robot comes to rest, and sensors read: without dynamics, for which
    there is crosscheck control.

    \b
    geometric         rigid inverse kinematics, as in the paper's experiment
    elastic           what seecr correct commands, with the believed model
    stiffness         the same, with the tensions that make a stiffness largest
    pose_feedback     integral action on the tracker's pose, from the reference pose on
    tension_feedback  integral action on tensions, around the lengths of elastic

    A feedback is linearised about where it settles at each pose: it does if the spectral radius is
    below 1. Gains and delays that hold are stated. A loop that would hold at no pose even if the
    robot were as believed is refused.

    Writes control.json, control.csv, a figure and control.rrd.

    \b
    Exit status: 0 all at rest, 2 bad input, 3 a pose at which the platform does not come to rest,
    or for which a scheme has no command.
    """
    from seecr import control
    from seecr.cli.arguments import model_at, notes_of, robot_at
    from seecr.files import json_text, with_toml, write_text
    from seecr.folders import staged
    from seecr.show.control import control_csv, control_figure, schemes_json

    machine = robot_at(robot)
    known, own = model_at(believes, machine), model_at(true, machine)
    wanted, free = wanted_of(machine, poses)
    names = parts_of(scheme)
    pictures, every_picture = files_of_pictures("control", figure, no_recording)
    made = made_by(machine.source, poses, believes, true)
    names_out = {"control.json", "control.csv", *pictures}
    where: dict[str, Any] = {"sometimes": every_picture, "read": with_toml(poses), "made": made}
    with staged(out, names=names_out, **where) as folder:
        with progress_bar("controlling", len(names)) as tell:
            result = control(
                machine, wanted.commands, scheme=names, believes=known or (), true=own or (),
                any_orientation=free, progress=lambda _name: tell(1, ""),
                **arguments(machine, **ways),
            )  # fmt: skip
        every = result.schemes.values()
        status = 0 if all(one.rests.all() for one in every) else 3
        first = next(iter(every)).solution
        notes = [*notes_of(own, first, wanted.commands), *wanted.notes, *result.notes]
        notes += [] if known is None or own is None or known.path != own.path else [_AS_GOOD]
        text = json_text({
            "made": made, "exit_status": status,
            "robot": machine.name, "cables": machine.cable_names,
            "believes": None if known is None else known.names,
            "is": None if own is None else own.names, "notes": notes,
            "schemes": schemes_json(result),
        })  # fmt: skip
        write_text(folder / "control.json", text + "\n")
        write_text(folder / "control.csv", control_csv(result))
        if figure != "none":
            control_figure(folder / f"control.{figure}", result)
        if not no_recording:
            from seecr.show.control import write_control_recording

            write_control_recording(result, folder / "control.rrd")
    given = [part for o, p in (("--believes", believes), ("--is", true)) if p for part in (o, p)]
    then = following("crosscheck", "control", robot, poses, "--scheme", scheme, *given)
    lines = [*notes, *result.lines(), f"Results in {out}/", then]
    click.echo(text if as_json else "\n".join(lines))
    return status


def parts_of(text: str) -> list[str]:
    """Words with commas between."""
    return [word.strip() for word in text.split(",") if word.strip()]


def wanted_of(machine: Robot, poses: Path) -> tuple[Any, bool]:
    """The wanted poses of a file, and whether positions alone are wanted.

    Raises:
        InputFileError: it holds lengths, or is no list of commands.
    """
    from seecr.cli.arguments import wanted_poses_of

    wanted = wanted_poses_of(poses, machine, "a scheme of control")
    return wanted, wanted.any_orientation and machine.n_driven < machine.n_dof


def arguments(
    machine: Robot, lowest: float, highest: float | None, aim: str, holding: str | None,
    reads: str, noise: tuple[float, float, float] | None, seed: int, **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """The options as :func:`seecr.control` takes them."""
    from seecr import SensorNoise
    from seecr.cli.correct import aim_of

    return {
        **more,
        "lowest": lowest,
        "highest": float("inf") if highest is None else highest,
        "aim": aim_of(aim, machine.n_driven),
        "holding": None if holding is None else parts_of(holding),
        "reads": parts_of(reads),
        "noise": SensorNoise(*(noise or (0.0, 0.0, 0.0)), seed=seed),
    }
