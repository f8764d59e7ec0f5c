"""``crosscheck control``: schemes of control in MuJoCo, with time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from seecr.cli import control as at_rest
from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.progress import progress_bar
from seecr.cli.results import files_of_pictures, made_by


@options.command(
    "crosscheck control demobot_cogiro poses.csv --is true.toml",
    "crosscheck control robot.xml poses.csv --scheme elastic+pose_feedback --rate 20 --delay 0.1",
    "crosscheck control robot.xml poses.csv --scheme geometric --speed 2 --damping 0.02",
    cls=options.NumbersCommand,
)
@click.argument("robot", type=options.FILE, metavar="ROBOT.xml")
@click.argument("poses", type=options.FILE, metavar="POSES.csv")
@at_rest.schemes
@at_rest.believes
@at_rest.truth
@at_rest.loop
@at_rest.aims
@options.option(
    "--speed M/S", "Of the winch that turns most, between poses [m/s].", options.Number(),
    default=0.05,
)  # fmt: skip
@options.option("--hold S", "How long each pose is held [s].", options.Number(), default=5.0)
@options.option(
    "--bandwidth HZ", "Of the winches' first-order lag [Hz].", options.Number(), default=5.0
)
@options.option("--winch-speed M/S", "Largest speed of a winch [m/s].  [default: none]",
                options.Number())  # fmt: skip
@options.option(
    "--damping PART", "Of the slowest vibration, as a part of critical.", options.Number(),
    default=0.05,
)  # fmt: skip
@options.pictures
@options.out("control")
@options.as_json
def command(
    robot: Path, poses: Path, scheme: str, believes: Path | None, true: Path | None, speed: float,
    hold: float, bandwidth: float, winch_speed: float | None, damping: float, figure: str,
    no_recording: bool, out: Path, as_json: bool, **ways: Any,
) -> int:  # fmt: skip
    """Show in MuJoCo, with time, what a robot does whose controller believes another one.

    The platform starts at rest at its reference pose and goes through POSES.csv. Winches follow
    what they are told with a lag; cables are springs that damp; sensors read at a rate, and a
    feedback works while a pose is held. Schemes are those of seecr control, and each is compared
    with what that says: slow commands come to rest there, to the suite's thresholds.

    Effects of pulleys, sag, friction, play and memory are simulated at rest alone; here they are
    refused.

    Writes control.json, SCHEME.csv and SCHEME.rrd of each scheme, and a figure.

    \b
    Exit status: 0 all at rest where seecr control says, 1 a platform that does not come to rest or
    rests elsewhere, 2 bad input, 3 a pose for which a scheme has no command, or that has no rest.
    """
    from crosscheck import Timing, Winches, control_in_time
    from crosscheck.show.control import (
        timed_figure,
        timed_json,
        trace_csv,
        write_timed_recording,
    )
    from seecr.cli.arguments import model_at, robot_at
    from seecr.files import json_text, with_toml, write_text
    from seecr.folders import staged

    machine = robot_at(robot)
    known, own = model_at(believes, machine), model_at(true, machine)
    wanted, free = at_rest.wanted_of(machine, poses)
    names = at_rest.parts_of(scheme)
    pictures, every_picture = files_of_pictures("control", figure, True)
    recordings = {f"{name}.rrd" for name in names}
    names_out = {"control.json", *pictures, *(f"{name}.csv" for name in names)}
    names_out |= set() if no_recording else recordings
    made = made_by(machine.source, poses, believes, true)
    where: dict[str, Any] = {
        "sometimes": every_picture | recordings, "read": with_toml(poses), "made": made,
    }  # fmt: skip
    top = float("inf") if winch_speed is None else winch_speed
    with staged(out, names=names_out, **where) as folder:
        given = at_rest.arguments(machine, **ways)
        with progress_bar("moving", len(names) * len(wanted.commands)) as tell:
            result = control_in_time(
                machine, wanted.commands, scheme=names, believes=known or (), true=own or (),
                any_orientation=free, winches=Winches(bandwidth, top, damping),
                timing=Timing(speed, hold, given.pop("rate")),
                progress=lambda done: tell(done, ""), **given,
            )  # fmt: skip
        every = result.schemes.values()
        status = 0 if all(one.same.all() for one in every) else 1
        if not all(one.rests.all() for one in result.at_rest.schemes.values()):
            status = 3
        text = json_text({
            "made": made, "exit_status": status,
            "robot": machine.name, "cables": machine.cable_names,
            "notes": [*wanted.notes, *result.at_rest.notes], "schemes": timed_json(result),
        })  # fmt: skip
        write_text(folder / "control.json", text + "\n")
        for name, one in result.schemes.items():
            write_text(folder / f"{name}.csv", trace_csv(one))
        if figure != "none":
            timed_figure(folder / f"control.{figure}", result)
        for name, one in ({} if no_recording else result.schemes).items():
            write_timed_recording(one, folder / f"{name}.rrd")
    then = following("seecr", "correct", robot, poses)
    lines = [*wanted.notes, *result.lines(), f"Results in {out}/", then]
    click.echo(text if as_json else "\n".join(lines))
    return status
