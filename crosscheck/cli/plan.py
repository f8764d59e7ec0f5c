"""``crosscheck plan``: what planned poses will be able to show, or which to measure."""

from __future__ import annotations

import math
from pathlib import Path

import click

from crosscheck.cli.choices import figures_in, figures_option, listed, sigma_option
from crosscheck.cli.following import after_plan
from seecr.cli.arguments import check_places
from seecr.cli.options import (
    FILE,
    Number,
    WholeNumber,
    json_option,
    made_by,
    out_option,
    progress_share,
)


@click.command(
    short_help="Find which effects planned poses can reveal, or choose poses to measure.",
    epilog="""\b
Examples:
  crosscheck plan robot.xml --rows 40
  crosscheck plan robot.xml poses.csv --reads position,tension --sigma position=0.1mm
""",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("poses", type=FILE, metavar="[POSES.csv]", required=False)
@click.option(
    "--rows",
    type=WholeNumber(min=6),
    metavar="N",
    help="Choose this many poses instead of reading a file.",
)
@click.option(
    "--reads",
    multiple=True,
    callback=listed,
    metavar="KIND,...",
    help="What will be measured: position, orientation, tension.  [default: position,orientation, "
    "and tension if its noise is stated]",
)
@sigma_option
@click.option(
    "--lowest",
    type=Number(),
    metavar="N",
    default=0.0,
    help="Lowest cable tension at proposed poses.",
)
@click.option(
    "--highest",
    type=Number(),
    metavar="N",
    default=math.inf,
    help="Highest cable tension at proposed poses.",
)
@click.option(
    "--box",
    metavar="X0,Y0,Z0,X1,Y1,Z1",
    help="Where poses are chosen and proposed [m].  [default: inside the exit points]",
)
@figures_option
@out_option("crosscheck-plan")
@json_option
def command(
    robot: Path,
    poses: Path | None,
    rows: int | None,
    reads: tuple[str, ...],
    sigmas: tuple[str, ...],
    lowest: float,
    highest: float,
    box: str | None,
    figures: Path | None,
    out: Path,
    as_json: bool,
) -> int:
    """Tell, before measuring, which effects the poses would reveal and distinguish.

    POSES.csv holds commands in the same format as a file of measurements; readings in it are
    ignored. With --rows the poses are chosen: of those where the robot comes to rest within the
    tension limits, those that together reveal and distinguish most effects. At some of them cables
    may be slack, which is said; with --lowest there are none such where enough others are. The
    noise comes from --sigma, or from [sigma] in the TOML beside POSES.csv, or else is that of good
    sensors.

    For each effect: the smallest visible size; the smallest size at which it can be named although
    another effect imitates it; which effects it would be indistinguishable from. Then what to add:
    poses, a payload, way points, tensions, the way back.

    \b
    Writes into --out:
      plan.json        all of it
      plan.html        the same as a page
      poses.csv        with --rows: the poses, as a controller can take them
      add-KIND.csv     the commands of each thing to add

    \b
    Exit status: 0 all well, 2 bad input, 3 poses without an equilibrium.
    """
    if (poses is None) == (rows is None):
        got = "neither" if poses is None else "both"
        raise click.UsageError(f"expected POSES.csv or --rows N, got {got}")
    from crosscheck import Sigma, choose_poses, load_commands, make_plan, write_plan
    from crosscheck.planning.write import NAME, box_of, check_own, sometimes_written
    from crosscheck.show.page import write_page
    from crosscheck.show.plan import print_plan
    from seecr import load_robot
    from seecr.files import json_text, staged, with_toml, write_text

    machine = load_robot(robot)
    room = box_of(box) if box else None
    if room is not None:
        check_places(room, machine)
    limits = (lowest, highest)
    sigma = Sigma.parsed(sigmas)
    given = None if poses is None else load_commands(poses, machine, sigma=sigma)
    sigma = sigma if given is None else given.sigma
    if poses is None:
        check_own(out)
    sometimes = sometimes_written(out, poses)
    with staged(out, sometimes=sometimes, read=with_toml(poses)) as folder:
        with progress_share("planning") as progress:
            commands = given or choose_poses(
                machine, rows or 0, sigma=sigma, reads=reads, limits=limits, progress=progress,
                box=room,
            )  # fmt: skip
            plan = make_plan(
                machine, commands, sigma, progress, reads=reads, limits=limits, box=room
            )
        made = made_by(machine.source, poses)
        status = 0 if plan.converged else 3
        files = write_plan(plan, folder, own=given is None)
        text = json_text(
            {"made": made, "exit_status": status, **plan.as_json(), "files": list(files)}
        )
        write_text(folder / NAME, text + "\n")
        with figures_in(figures):
            write_page(plan, folder / "plan.html", made)
    if as_json:
        click.echo(text)
    else:
        print_plan(plan, out, files)
        click.echo(after_plan(robot, poses or out / "poses.csv", sigmas))
    return status
