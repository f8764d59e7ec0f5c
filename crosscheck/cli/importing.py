"""``crosscheck import``: other people's files into a case folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from seecr.cli.following import following
from seecr.cli.options import (
    FILE,
    Number,
    finite_option,
    json_option,
    made_by,
    out_option,
    progress_share,
)


@click.command(
    short_help="Convert recordings of other programs into measurements.",
    epilog="""\b
Examples:
  crosscheck import motive take.csv --robot robot.xml --commands commands.csv --out case
  crosscheck import vicon trial.csv --robot robot.xml --commands commands.csv
      --markers platform:1,platform:2,platform:3
  crosscheck import poses tracker.csv --robot robot.xml --commands commands.csv --clock 1.25
""",
)
@click.argument("form", type=click.Choice(["motive", "vicon", "poses"]), metavar="FORMAT")
@click.argument("files", type=FILE, nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--robot",
    type=FILE,
    required=True,
    metavar="ROBOT.xml",
    help="The recorded robot, as MJCF or the name of a shipped one.",
)
@click.option(
    "--commands",
    "logs",
    type=FILE,
    multiple=True,
    required=True,
    metavar="COMMANDS.csv",
    help="Log of commands, with a column t_s or one row per dwell; once for each FILE.",
)
@click.option("--body", metavar="NAME", help="The rigid body, if there are several.")
@click.option("--markers", metavar="A,B,C", help="Markers that form the body, three or more.")
@click.option(
    "--shape",
    type=FILE,
    metavar="SHAPE.csv",
    help="Marker positions in the platform's frame: columns name, x_mm, y_mm, z_mm.",
)
@click.option(
    "--point",
    "points",
    multiple=True,
    metavar="MARKER=X,Y,Z",
    help="A marker (or its x,y,z in the tracker's frame) and its position in the base frame in "
    "metres (or a cable's name, for its exit point); three or more align the frames.",
)
@click.option("--aligned", is_flag=True, help="The tracker's frame already is the base frame.")
@click.option(
    "--target",
    metavar="X,Y,Z",
    help="The body's origin in the platform's frame, in metres; the axes of both are parallel.",
)
@click.option("--up", type=click.Choice(["y", "z"]), help="The vertical axis in FILE.  [Motive: y]")
@click.option(
    "--unit", metavar="mm", help="Unit of lengths in a log whose columns do not state it."
)
@click.option(
    "--rotation",
    metavar="KIND",
    help="What the three numbers of a rotation mean: vector, or the order of Euler angles, such "
    "as xyz about fixed or XYZ about moving axes.",
)
@click.option(
    "--rest-for",
    type=Number(min=0, min_open=True),
    callback=finite_option,
    metavar="S",
    default=0.5,
    show_default=True,
    help="Minimum duration of a dwell.",
)
@click.option(
    "--rest-speed", metavar="1mm/s", help="Maximum speed at rest.  [default: from the noise]"
)
@click.option(
    "--clock",
    type=Number(),
    callback=finite_option,
    metavar="S",
    help="How far the tracker's clock is ahead of that of the commands.  [default: estimated]",
)
@out_option("case")
@json_option
def command(
    form: str,
    files: tuple[Path, ...],
    robot: Path,
    logs: tuple[Path, ...],
    out: Path,
    as_json: bool,
    **options: Any,
) -> int:
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
    from crosscheck.importing import check_case, write_case
    from seecr import load_robot
    from seecr.files import json_text

    machine = load_robot(robot)
    choices = ImportChoices.said(machine, **options)
    check_case(out, robot)
    with progress_share("reading the recordings") as progress:
        found = import_case(form, files, machine, logs, choices)
        made = made_by(machine.source, *files, *logs)
        progress("writing the case", 0.9)
        write_case(found, robot, out, made)
        progress("writing the case", 1.0)
    if as_json:
        click.echo(json_text({"made": made, **found.as_json(), "folder": str(out)}))
        return 0
    for line in found.lines():
        click.echo(line)
    click.echo(f"written to {out}")
    click.echo(following("crosscheck", "compare", out / "robot.xml", out / "measured.csv"))
    return 0
