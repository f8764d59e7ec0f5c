"""``crosscheck import``: other people's files into a case folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.progress import progress_share
from seecr.cli.results import made_by


@options.command(
    "crosscheck import motive take.csv --robot robot.xml --commands commands.csv --out case",
    "crosscheck import vicon trial.csv --robot robot.xml --commands commands.csv",
    "    --markers platform:1,platform:2,platform:3",
    "crosscheck import poses tracker.csv --robot robot.xml --commands commands.csv --clock 1.25",
)
@click.argument("form", type=click.Choice(["motive", "vicon", "poses"]), metavar="FORMAT")
@click.argument("files", type=options.FILE, nargs=-1, required=True, metavar="FILE...")
@options.option(
    "--robot ROBOT.xml", "The recorded robot, as MJCF or the name of a shipped one.", required=True
)
@options.fix
@options.passive
@options.option(
    "--commands COMMANDS.csv",
    "Log of commands, with a column t_s or one row per dwell; once for each FILE.",
    name="logs",
    multiple=True,
    required=True,
)
@options.option("--body NAME", "The rigid body, if there are several.")
@options.option("--markers A,B,C", "Markers that form the body, three or more.")
@options.option(
    "--shape SHAPE.csv", "Marker positions in the platform's frame: columns name, x_mm, y_mm, z_mm."
)
@options.option(
    "--point MARKER=X,Y,Z",
    "A marker (or its x,y,z in the tracker's frame) and its position in the base frame in metres "
    "(or a cable's name, for its exit point); three or more align the frames.",
    name="points",
    multiple=True,
)
@options.option("--aligned", "The tracker's frame already is the base frame.")
@options.option(
    "--target X,Y,Z",
    "The body's origin in the platform's frame, in metres; the axes of both are parallel.",
)
@options.option("--up [y|z]", "The vertical axis in FILE.  [Motive: y]")
@options.option("--unit mm", "Unit of lengths in a log whose columns do not state it.")
@options.option(
    "--rotation KIND",
    "What the three numbers of a rotation mean: vector, or the order of Euler angles, such as xyz "
    "about fixed or XYZ about moving axes.",
)
@options.option(
    "--rest-for S",
    "Minimum duration of a dwell.",
    options.Number(min=0, min_open=True),
    default=0.5,
    callback=options.check_finite,
)
@options.option("--rest-speed 1mm/s", "Maximum speed at rest.  [default: from the noise]")
@options.option(
    "--clock S",
    "How far the tracker's clock is ahead of that of the commands.  [default: estimated]",
    options.Number(),
    callback=options.check_finite,
)
@options.columns
@options.out("case")
@options.as_json
def command(
    form: str, files: tuple[Path, ...], robot: Path, logs: tuple[Path, ...], out: Path,
    as_json: bool, **said: Any,
) -> int:  # fmt: skip
    """Make a case folder from recordings: find dwells, average them and assign their commands.

    FORMAT is motive (CSV exports of OptiTrack), vicon (of Nexus) or poses (a plain log with the
    columns t_s, x_mm, y_mm, z_mm, qw, qx, qy, qz). Units, axes and order come from the labels.

    The tracker's frame is aligned roughly, from points that you name or from the commands. It has
    then absorbed a part of the error, so it stays free in every later fit (docs/formats.md).

    \b
    Writes into --out:
      robot.xml        the robot as described
      measured.csv     commands and readings, one row per dwell
      measured.toml    the noise of the readings, and what stays free
      dwells.csv       when each dwell was, its samples and their scatter
      import.json      what was done
    """
    from crosscheck import ImportChoices, import_case
    from crosscheck.given import check_case
    from crosscheck.importing import FILES, write_case
    from seecr.cli.arguments import robot_at
    from seecr.files import json_text

    machine = robot_at(robot)
    choices = ImportChoices.said(machine, **said)
    check_case(out, FILES, robot)
    with progress_share("reading the recordings") as progress:
        found = import_case(form, files, machine, logs, choices)
        made = made_by(machine.source, *files, *logs)
        progress("writing the case", 0.9)
        write_case(found, robot, out, made)
        progress("writing the case", 1.0)
    if as_json:
        click.echo(json_text({"made": made, **found.as_json(), "folder": str(out)}))
        return 0
    then = following("crosscheck", "compare", out / "robot.xml", out / "measured.csv")
    click.echo("\n".join([*found.lines(), f"written to {out}", then]))
    return 0
