"""``crosscheck effects``: the catalogue on the terminal."""

from __future__ import annotations

from pathlib import Path

import click

from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.results import made_by, result_in


@options.command("crosscheck effects", "crosscheck effects pulley_radius --robot robot.xml")
@click.argument("name", required=False)
@options.option("--robot ROBOT.xml", "Show expected sizes for this robot.")
@options.own_effects
@options.fix
@options.passive
@options.out_file("effects.json")
@options.as_json
def command(name: str | None, robot: Path | None, out: Path | None, as_json: bool) -> int:
    """List the effects of the catalogue, or describe one: its formula, its parameters, and how to
    check it.

    Effects of your own packages are included and marked. With --robot, the expected size of each
    parameter for that robot is shown; diagnose and calibrate use it as the prior's standard
    deviation.
    """
    from crosscheck.show.effects import effect_record, print_effect, print_effects
    from seecr import catalogue, effect_named
    from seecr.cli.arguments import robot_at
    from seecr.files import json_text

    machine = robot_at(robot) if robot is not None else None
    chosen = [effect_named(name)] if name is not None else list(catalogue().values())
    rows = [effect_record(effect, machine) for effect in chosen]
    told = rows[0] if name is not None else {"effects": rows}
    text = json_text({"made": made_by(None if machine is None else machine.source), **told})
    with result_in(out, "effects.json") as keep:
        keep(text)
    if as_json:
        click.echo(text)
    elif name is not None:
        print_effect(chosen[0], machine)
        given = (robot or "ROBOT.xml", "DATA.csv", "--model", "model.toml")
        click.echo(following("crosscheck", "add", name, *given))
    else:
        print_effects(chosen)
        click.echo(following("crosscheck", "effects", chosen[0].name, "--robot", "ROBOT.xml"))
    return 0
