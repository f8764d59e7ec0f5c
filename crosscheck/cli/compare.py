"""``crosscheck compare``: a model against measurements."""

from __future__ import annotations

from pathlib import Path

import click

from crosscheck.cli.choices import figures_in, figures_option, sigma_option
from crosscheck.cli.following import Given, after_comparison
from seecr.cli.options import FILE, json_option, made_by, out_option, progress_share


@click.command(
    short_help="Compare a model with measurements.",
    epilog="""\b
Examples:
  crosscheck compare robot.xml measured.csv
  crosscheck compare robot.xml measured.csv --model model.toml --max-position 0.5mm
  crosscheck compare robot.xml measured.csv --limits limits.toml --json
""",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("data", type=FILE, nargs=-1, required=True, metavar="DATA.csv...")
@click.option("--model", type=FILE, metavar="M.toml", help="The model.  [default: plain SEECR]")
@click.option("--max-position", metavar="0.5mm", help="Limit on the rms position error.")
@click.option("--max-orientation", metavar="0.2deg", help="Limit on the rms orientation error.")
@click.option("--max-tension", metavar="1N", help="Limit on the rms tension error.")
@click.option("--max-position-worst", metavar="2mm", help="Limit on the worst row's error.")
@click.option("--max-orientation-worst", metavar="1deg", help="Limit on the worst row's error.")
@click.option("--max-tension-worst", metavar="5N", help="Limit on the worst row's error.")
@click.option(
    "--limits",
    "limits_file",
    type=FILE,
    metavar="FILE.toml",
    help='Limits from a file: max_position = "0.5mm" and so on; options override it.',
)
@sigma_option
@figures_option
@click.option("--no-recording", is_flag=True, help="Do not write a recording (.rrd).")
@out_option("crosscheck-comparison")
@json_option
def command(
    robot: Path,
    data: tuple[Path, ...],
    model: Path | None,
    limits_file: Path | None,
    sigmas: tuple[str, ...],
    figures: Path | None,
    no_recording: bool,
    out: Path,
    as_json: bool,
    **options: str | None,
) -> int:
    """Show where a model is off, by how much, and whether the residuals are noise.

    ROBOT.xml is the robot's MJCF, DATA.csv its measurements; a TOML file beside it states the
    noise. The model's values are used as they are; nothing is fitted but what the data leave free,
    and the notes name it. It also tells how far the platform is from the wanted poses (columns
    want_*, as seecr correct writes them), else from the commanded ones. Writes comparison.json,
    comparison.html and comparison.rrd.

    \b
    With limits the command is a gate for continuous integration: on the rms over all rows and
    components, as in the tables, or on the worst row (the length of its error vector).
    Exit status: 0 all well, 1 a limit exceeded, 2 bad input, 3 rows without an equilibrium.
    """
    from crosscheck import Limits, Sigma, compare, exceeded, load_limits, load_measurements
    from crosscheck.show.page import write_page
    from seecr import load_model, load_robot, with_history
    from seecr.files import json_text, staged, write_text

    limits = (load_limits(limits_file) if limits_file else Limits()).but(options)
    machine = load_robot(robot)
    measured = load_measurements(data, machine, sigma=Sigma.parsed(sigmas))
    own = load_model(model, machine) if model is not None else None
    with (
        staged(out, sometimes=["comparison.rrd"]) as folder,
        progress_share("comparing") as progress,
    ):
        found = compare(machine, measured, own.terms if own else ())
        beyond = exceeded(limits, found)
        status = 1 if beyond else (0 if found.converged else 3)
        made = made_by(machine.source, *data, model)
        document = {
            "made": made,
            "exit_status": status,
            "limits": {k: v for k, v in vars(limits).items() if v is not None},
            "exceeded": beyond,
            **found.as_json(),
            "model_notes": list(own.notes) if own else [],
        }
        text = json_text(document)
        write_text(folder / "comparison.json", text + "\n")
        progress("drawing the page" if no_recording else "drawing the page, recording", 0.5)
        with figures_in(figures):
            write_page(found, folder / "comparison.html", made)
            if not no_recording:
                from crosscheck.show.error_recordings import write_comparison_recording

                write_comparison_recording(found, folder / "comparison.rrd")
        progress("all is written", 1.0)
    if as_json:
        click.echo(text)
        return status
    from crosscheck.show.comparison import print_comparison

    for note in own.notes if own else ():
        click.echo(f"note: {note}")
    print_comparison(found, beyond, limits != Limits(), out)
    history = own is not None and bool(with_history(machine, own))
    given = Given.with_data(measured, robot, data, model, sigmas, history)
    click.echo(after_comparison(found, given))
    return status
