"""``crosscheck calibrate``: fit all effects that the data can see at once."""

from __future__ import annotations

from pathlib import Path

import click

from crosscheck.cli.choices import (
    check_effects,
    exclude_option,
    grown_model_option,
    only_option,
    result_in,
    sigma_option,
)
from crosscheck.cli.following import Given, after_fit
from crosscheck.cli.grown import keep_grown, model_or_new
from seecr.cli.options import FILE, json_option, made_by, progress_share


@click.command(
    short_help="Fit all effects at once, for a model that predicts well.",
    epilog="""\b
Examples:
  crosscheck calibrate robot.xml measured.csv --model model.toml
  crosscheck compare robot.xml another_day.csv --model model.toml
""",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("data", type=FILE, nargs=-1, required=True, metavar="DATA.csv...")
@grown_model_option
@only_option
@exclude_option
@sigma_option
@click.option(
    "--force", is_flag=True, help="Write it even if it does not predict held-out runs better."
)
@click.option(
    "--out", type=FILE, metavar="DIR", help="Folder for calibration.json.  [default: none]"
)
@json_option
def command(
    robot: Path,
    data: tuple[Path, ...],
    model: Path,
    only: tuple[str, ...],
    exclude: tuple[str, ...],
    sigmas: tuple[str, ...],
    force: bool,
    out: Path | None,
    as_json: bool,
) -> int:
    """Fit all effects that DATA.csv can reveal, at once, and write the model.

    Each parameter's plausible size is the standard deviation of its prior: what the data hardly
    determine stays near null. The size of the noise and its correlation along the runs are
    estimated. Use such a model for its predictions; diagnose says which of its effects are real.

    \b
    Exit status: 0 written, 1 not written because the prediction of held-out runs does not improve,
    2 bad input, 3 rows without an equilibrium or a fit that does not converge.
    """
    from crosscheck import Sigma, calibrate, load_measurements
    from crosscheck.model.write import check_place
    from crosscheck.show.fits import print_calibration
    from seecr import load_robot

    check_effects(only, exclude)  # a wrong name is told before any file is read
    machine = load_robot(robot)
    old = model_or_new(model, machine)
    measured = load_measurements(data, machine, sigma=Sigma.parsed(sigmas))
    check_place(model)
    with result_in(out, "calibration.json") as keep:
        with progress_share("calibrating") as progress:
            found = calibrate(machine, measured, old, progress, only=only, exclude=exclude)
        written = found.pays or (force and found.settled)
        made = made_by(machine.source, *data, model)  # of the model as it was read
        text = keep_grown(found, model, written, made, keep)
    if as_json:
        click.echo(text)
    else:
        print_calibration(found, model, written)
        given = Given.with_data(measured, robot, data, model, sigmas)
        click.echo(after_fit(written, written, given))
    if not found.settled:
        return 3
    return 0 if written else 1
