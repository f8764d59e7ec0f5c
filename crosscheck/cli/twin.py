"""``crosscheck twin``: measurements with something hidden in them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from crosscheck.cli import choices
from seecr.cli import options
from seecr.cli.following import following, typed
from seecr.cli.progress import progress_bar
from seecr.cli.results import made_by, tell

if TYPE_CHECKING:
    from crosscheck import Twin


@options.command(
    "crosscheck twin my_robot.xml --hide 7 --out case7",
    "crosscheck diagnose case7/robot.xml case7/measured.csv",
    "crosscheck twin --open case7",
    "crosscheck twin my_robot.xml --hide 8 --poses my_poses.csv --out case8",
)
@click.argument("robot", type=options.FILE, metavar="ROBOT.xml", required=False)
@options.fix
@options.passive
@options.option(
    "--hide SEED",
    "Seed from which the hidden effects, their sizes and the noise are drawn; the same seed gives "
    "the same case.",
    options.WholeNumber(min=0),
    "seed",
)
@options.option(
    "--effects K",
    "How many effects to hide.  [default: one or two, drawn from the seed]",
    options.WholeNumber(min=0),
    "count",
)
@options.option(
    "--effect NAME",
    "Hide this effect; only its size is drawn. FILE.py:CLASS is one of your own, which acts by its "
    "own law. May be repeated.",
    name="names",
    multiple=True,
)
@options.option(
    "--maybe-none",
    "Some seeds may hide nothing, or what the poses hardly show; else other effects are drawn.",
)
@options.option("--tensions", "Also record tensions.")
@options.option(
    "--poses POSES.csv", "Your own commands, with loads and way points, instead of the sweeps."
)
@choices.sigma
@options.option(
    "--open FILE", "Show what a case hides: its answer.sealed, or its folder.", name="opened"
)
@options.out("twin")
@options.as_json
@click.pass_context
def command(
    context: click.Context, robot: Path | None, seed: int | None, count: int | None,
    names: tuple[str, ...], maybe_none: bool, tensions: bool, poses: Path | None,
    sigmas: tuple[str, ...], opened: Path | None, out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Simulate measurements of a robot with hidden effects, with MuJoCo as the truth.

    The platform is commanded along sweeps to and fro, at two heights and across, and around a
    tilted loop, 144 rows in all, scaled to the robot. MuJoCo brings it to rest at each row; a
    tracker with noise reads its pose, angles only about axes that it can turn about. With --poses
    it follows your own commands: rows of POSES.csv without a reading are way points if other rows
    have one; the noise level is that of the TOML beside it, or of --sigma, and other poses get
    other noise. With the same seed and noise level it is the same robot, whatever is commanded, as
    long as that shows what it hides: measure again what seecr correct has written.

    \b
    Writes into --out:
      robot.xml        the robot as described, without what is hidden
      measured.csv     commands and readings
      measured.toml    the noise of the readings
      answer.sealed    what was hidden; no other command opens it
    """
    from seecr.cli.following import introduce_all

    if opened is not None:
        given = {
            name for name in context.params
            if context.get_parameter_source(name) is not ParameterSource.DEFAULT
        }  # fmt: skip
        if given - {"opened", "as_json", "names"} or not all(".py" in name for name in names):
            raise click.UsageError(
                "--open shows an existing case; leave out all other options but --json and "
                "--effect FILE.py:CLASS"
            )
        introduce_all(names)
        return _open(opened, as_json)
    if robot is None or seed is None:
        raise click.UsageError("expected ROBOT.xml and --hide SEED, or --open FILE")
    if names and count is not None:
        raise click.UsageError(
            "--effect already sets how many effects are hidden; leave out --effects"
        )
    from crosscheck import Sigma, load_commands, make_twin
    from crosscheck.twin import FILES
    from seecr.cli.arguments import robot_at
    from seecr.files import json_text

    files = list(dict.fromkeys(name for name in names if ".py" in name))
    own = dict(zip(files, introduce_all(files), strict=True))
    names = tuple(own.get(name, name) for name in names)
    noise = Sigma.parsed(sigmas)
    machine = robot_at(robot)
    commands = load_commands(poses, machine, sigma=noise) if poses is not None else None
    # whatever is hidden, the bar shows the same: rows of one kind, done or not
    with progress_bar("measuring", 1) as advance:
        twin = make_twin(
            machine, seed, effects=names or None, n_effects=count, out=out, tensions=tensions,
            poses=commands, sigma=commands.sigma if commands else noise, maybe_none=maybe_none,
            progress=lambda rows, now: advance(0, "measuring"),
        )  # fmt: skip
        advance(1, "measured")
    tell(twin.notes)
    if as_json:
        made = made_by(twin.robot.source, poses)
        document = {"made": made, **twin.as_json(), "folder": str(out), "files": list(FILES)}
        click.echo(json_text(document, indent=2))
    else:
        _tell_made(twin, out)
    return 0


def _tell_made(twin: Twin, out: Path) -> None:
    from crosscheck.twin import FILES
    from seecr.cli.following import given_effects
    from seecr.counted import counted

    sigma, own = twin.answer.sigma, given_effects()
    noise = f"{1e3 * sigma['position_m']:.3g} mm"
    if "orientation_rad" in sigma:
        noise += f", {math.degrees(sigma['orientation_rad']):.2g} deg"
    if "tension_N" in sigma:
        noise += f", {sigma['tension_N']:.2g} N"
    rows, runs = counted(twin.measured.n_rows, "row"), counted(len(twin.measured.runs), "run")
    click.echo(f"{rows} of {twin.robot.name} in {runs}; noise {noise}")
    click.echo(f"written to {out}: {', '.join(FILES)}")
    click.echo(f"to see what is hidden: {typed('crosscheck', 'twin', '--open', out, *own)}")
    click.echo(following("crosscheck", "diagnose", out / "robot.xml", out / "measured.csv"))


def _open(path: Path, as_json: bool) -> int:
    from crosscheck import unseal
    from crosscheck.show.effects import parameter_lines
    from crosscheck.twin import FILES
    from seecr import catalogue
    from seecr.counted import some
    from seecr.files import json_text

    answer = unseal(path)
    if as_json:
        files = [path / name for name in FILES] if path.is_dir() else [path]
        click.echo(json_text({"made": made_by(*files), **answer.as_json()}, indent=2))
        return 0
    if not answer.hidden:
        click.echo("nothing was hidden")
    for name, values in answer.values.items():
        moves = answer.moves_over_noise[name]
        click.echo(f"{name}: moves readings by up to {moves.max:.3g} times their noise")
        for line in parameter_lines(name, values):
            click.echo(f"  {line}")
    if strange := [name for name in answer.hidden if name not in catalogue()]:
        click.echo(
            f"{some(strange)}: of a file of its own; --effect FILE.py:CLASS names it, here and in "
            "the next command"
        )
    case = path if path.is_dir() else path.parent
    click.echo(following("crosscheck", "diagnose", case / "robot.xml", case / "measured.csv"))
    return 0
