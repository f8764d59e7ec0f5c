"""``crosscheck plan``: what planned poses will be able to show, or which to measure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from crosscheck.cli import choices
from crosscheck.cli.following import Given
from seecr.cli import options
from seecr.cli.progress import progress_share, say_duration
from seecr.cli.results import made_by


@options.command(
    "crosscheck plan robot.xml --rows 40",
    "crosscheck plan robot.xml poses.csv --reads position,tension --sigma position=0.1mm",
)
@click.argument("robot", type=options.FILE, metavar="ROBOT.xml")
@click.argument("poses", type=options.FILE, metavar="[POSES.csv]", required=False)
@options.fix
@options.option(
    "--rows N", "Choose this many poses instead of reading a file.", options.WholeNumber(min=6)
)
@options.passive
@options.words_option(
    "--reads KIND,...",
    "What will be measured: position, orientation, tension.  [default: position,orientation, and "
    "tension if its noise is stated]",
)
@options.own_effects
@choices.sigma
@options.option(
    "--lowest N",
    "Lowest cable tension [N] of poses that are chosen or proposed.  [default: a tenth of the "
    "usual, where enough poses have that]",
    options.Number(),
)
@options.option(
    "--highest N",
    "Highest cable tension [N] of these.  [default: twice the usual]",
    options.Number(),
)
@options.option(
    "--box X0,Y0,Z0,X1,Y1,Z1",
    "Where these poses are [m].  [default: inside the frame, with a margin]",
)
@options.option("--tilt ANGLE", "Tilt of some of these poses, such as 10deg.  [default: all level]")
@options.option(
    "--floor Z",
    "Height of the floor [m].  [default: that of the MJCF, or a little below the reference pose]",
    options.Number(),
    callback=options.check_finite,
)
@choices.figures
@options.out("crosscheck-plan")
@options.as_json
def command(
    robot: Path, poses: Path | None, rows: int | None, reads: tuple[str, ...],
    sigmas: tuple[str, ...], lowest: float | None, highest: float | None, box: str | None,
    tilt: str | None, floor: float | None, figures: Path | None, out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Tell, before measuring, which effects the poses would reveal and distinguish.

    POSES.csv holds commands in the same format as a file of measurements; readings in it are
    ignored. With --rows the poses are chosen: of those where the robot may be sent, those that
    together reveal and distinguish most effects. The robot may be sent where it rests inside the
    frame of its exit points, above the floor, with a margin, level, with no cable pulling more than
    twice what is usual (the median over the poses), and with all cables taut where enough poses are
    so; else cables may be slack, which is said. Tilted poses, which reveal more, need --tilt. The
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
    from crosscheck.measurements.data import parse_quantity
    from crosscheck.planning.write import box_of, planned_files
    from crosscheck.show.plan import print_plan
    from seecr.cli.arguments import check_places, robot_at
    from seecr.files import json_text, with_toml
    from seecr.folders import staged

    machine = robot_at(robot)
    room = box_of(box) if box else None
    if room is not None:
        check_places(room, machine)
    turn = parse_quantity("--tilt", "orientation", tilt) if tilt else 0.0
    sigma = Sigma.parsed(sigmas)
    given = None if poses is None else load_commands(poses, machine, sigma=sigma)
    sigma = sigma if given is None else given.sigma
    made = made_by(machine.source, poses)
    where = planned_files(out, poses)
    with staged(out, read=with_toml(poses), made=made, **where) as folder:
        many = ("choose", rows or 0, "poses to choose")
        say_duration(*(many if given is None else ("plan", given.n_rows, "rows")), as_json)
        with progress_share("planning") as progress:
            asked: dict[str, Any] = {
                "reads": reads, "limits": (lowest, highest), "box": room, "tilt": turn,
                "floor": floor,
            }  # fmt: skip
            commands = given or choose_poses(
                machine, rows or 0, sigma=sigma, progress=progress, **asked
            )
            plan = make_plan(machine, commands, sigma, progress, **asked)
        status = 0 if plan.converged else 3
        files = write_plan(plan, folder, own=given is None)
        head = {"made": made, "exit_status": status}
        text = json_text({**head, **plan.as_json(), "files": list(files)})
        choices.keep_page(plan, folder, "plan", text + "\n", made, figures)
    if as_json:
        click.echo(text)
    else:
        print_plan(choices.untold(plan), out, files)
        to_measure = poses or out / "poses.csv"
        then = Given(robot, [to_measure], sigmas=sigmas).then("diagnose", robot, to_measure)
        click.echo(f"{then}  # once these poses are measured")
    return status
