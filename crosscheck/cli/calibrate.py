"""``crosscheck calibrate``: fit every effect at once and write the model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from crosscheck.cli.options import FILE, json_option, progress_share

if TYPE_CHECKING:
    from crosscheck import Calibrated
    from seecr import Model


@click.command(
    short_help="Fit all effects at once and write the model.",
    epilog="""\b
Examples:
  crosscheck calibrate robot.xml measured.csv --model model.toml
  crosscheck compare robot.xml second_day.csv --model model.toml
""",
)
@click.argument("robot", type=FILE, metavar="ROBOT.xml")
@click.argument("data", type=FILE, metavar="DATA.csv")
@click.option(
    "--model", type=FILE, required=True, metavar="M.toml", help="The model; made if need be."
)
@click.option("--out", type=FILE, metavar="DIR", help="Folder for calibration.json.")
@json_option
def command(robot: Path, data: Path, model: Path, out: Path | None, as_json: bool) -> int:
    """Fit every effect that DATA.csv can show, all at once, and write them to the model.

    Plausible sizes are priors, so what the data see poorly stays near null. The model is for
    predicting; which effects are really there is what crosscheck diagnose says. The covariance
    of the values is kept beside the model, in M.covariance.json.

    \b
    Exit status: 0 written, 2 bad input, 3 rows without an equilibrium.
    """
    from crosscheck import calibrate, load_measurements
    from seecr import load_model, load_robot, new_model

    machine = load_robot(robot)
    old = load_model(model, machine) if model.exists() else new_model(machine)
    measured = load_measurements(data, machine)
    with progress_share("calibrating") as progress:
        found = calibrate(machine, measured, old.terms, progress)
    _write(found, old, robot, data, model)
    _tell(found, old, model, out, as_json)
    return 0


def _write(found: Calibrated, old: Model, robot: Path, data: Path, path: Path) -> None:
    from datetime import date

    from crosscheck.files import json_text, write_text
    from crosscheck.model import Provenance, renewed, save_model, with_fit
    from seecr import __version__, load_robot

    source = Provenance(
        data=data.name,
        date=date.today().isoformat(),
        version=f"seecr {__version__}",
        by="crosscheck calibrate",
    )
    errors = {"before": found.before, "after": found.after, "held_out": found.held_out}
    new = old
    for one in found.fitted:
        new = with_fit(new, found.fitted, one.term.name, source, errors)
    save_model(path, renewed(new, load_robot(robot)))
    beside = {"parameters": found.labels, "covariance": found.covariance.tolist()}
    write_text(path.with_suffix(".covariance.json"), json_text(beside) + "\n")


def _tell(found: Calibrated, old: Model, model: Path, out: Path | None, as_json: bool) -> None:
    from crosscheck.files import json_text, staged, write_text

    text = json_text({"model": str(model), **found.as_json(), "model_notes": list(old.notes)})
    if out is not None:
        with staged(out) as folder:
            write_text(folder / "calibration.json", text + "\n")
    if as_json:
        click.echo(text)
        return
    for line in [*(f"note: {note}" for note in old.notes), *found.lines()]:
        click.echo(line)
    click.echo(f"Written to {model}: {', '.join(one.term.name for one in found.fitted)}")
