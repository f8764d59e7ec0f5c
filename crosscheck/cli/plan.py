"""``crosscheck plan``: what planned poses will be able to show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from seecr.cli.options import FILE, json_option, out_option, progress_share


@click.command(
    short_help="What planned poses will be able to show.",
    epilog="""\b
Examples:
  crosscheck plan robot.xml poses.csv
  crosscheck plan robot.xml poses.csv --position-sigma 0.1mm --tension-sigma 0.05N
""",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("poses", type=FILE, metavar="POSES.csv")
@click.option("--position-sigma", metavar="0.03mm", help="Noise of each measured coordinate.")
@click.option("--orientation-sigma", metavar="0.02deg", help="Noise of each measured angle.")
@click.option(
    "--tension-sigma", metavar="0.05N", help="Noise of tensions; without it none are recorded."
)
@out_option("crosscheck-plan")
@json_option
def command(
    robot: Path,
    poses: Path,
    position_sigma: str | None,
    orientation_sigma: str | None,
    tension_sigma: str | None,
    out: Path,
    as_json: bool,
) -> int:
    """Tell, before anyone measures, which effects POSES.csv would show and tell apart.

    POSES.csv holds commands as a file of measurements does; readings in it are ignored. Noise
    comes from the options, from [sigma] in the TOML beside it, or is that of a good tracker.

    For each effect: the smallest size that would show; the smallest beside the effect that
    imitates it best; what it could not be told from; and what to add: poses, a payload, tensions,
    the way back. Writes plan.json.

    \b
    Exit status: 0 all well, 2 bad input, 3 poses without an equilibrium.
    """
    from crosscheck import load_commands, make_plan
    from crosscheck.files import json_text, staged, write_text
    from crosscheck.terminal import print_plan
    from crosscheck.units import parse_quantity
    from seecr import load_robot

    texts = {
        "position_m": ("--position-sigma", "position", position_sigma),
        "orientation_rad": ("--orientation-sigma", "orientation", orientation_sigma),
        "tension_N": ("--tension-sigma", "tension", tension_sigma),
    }
    given = {
        key: parse_quantity(label, kind, text)
        for key, (label, kind, text) in texts.items()
        if text is not None
    }
    machine = load_robot(robot)
    commands = load_commands(poses, machine)
    with staged(out) as folder:
        with progress_share("planning") as progress:
            plan = make_plan(machine, commands, replace(commands.sigma, **given), progress)
        text = json_text({"exit_status": 0 if plan.converged else 3, **plan.as_json()})
        write_text(folder / "plan.json", text + "\n")
    if as_json:
        click.echo(text)
    else:
        print_plan(plan, out)
    return 0 if plan.converged else 3
