"""``crosscheck calibrate``: fit all effects that the data can see at once."""

from __future__ import annotations

from pathlib import Path

import click

from crosscheck.cli import choices
from crosscheck.cli.following import Given, after_fit
from seecr.cli import options
from seecr.cli.progress import progress_share, say_duration
from seecr.cli.results import made_by, result_in


@options.command(
    "crosscheck calibrate robot.xml measured.csv --model model.toml",
    "crosscheck compare robot.xml another_day.csv --model model.toml",
)
@choices.robot_and_data
@choices.grown_model
@choices.considered
@options.own_effects
@choices.sigma
@options.option("--force", "Write it even if it does not predict test runs better.")
@options.out_file("calibration.json")
@options.as_json
def command(
    robot: Path, data: tuple[Path, ...], model: Path, only: tuple[str, ...],
    exclude: tuple[str, ...], sigmas: tuple[str, ...], force: bool, out: Path | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Fit all effects that DATA.csv can reveal, at once, and write the model.

    Each parameter's expected size is the standard deviation of its prior: what the data hardly
    determine stays near null. The size of the noise and its correlation along the runs are
    estimated. Use such a model for its predictions; diagnose says which of its effects are real.

    \b
    Exit status: 0 written, 1 not written because the prediction of test runs does not improve,
    2 bad input, 3 rows without an equilibrium or a fit that does not converge.
    """
    from crosscheck import calibrate
    from crosscheck.model.write import check_place, state_of
    from crosscheck.show.models import print_calibration

    choices.check_effects(only, exclude)  # a wrong name is told before any file is read
    machine, measured = choices.measured_by(robot, data, sigmas)
    before = state_of(model)
    old = choices.model_or_new(model, machine)
    check_place(model)
    with result_in(out, "calibration.json") as keep:
        say_duration("calibrate", measured.n_rows, "rows", as_json)
        with progress_share("calibrating") as progress:
            found = calibrate(machine, measured, old, progress, only=only, exclude=exclude)
        written = found.pays or (force and found.settled)
        made = made_by(machine.source, *data, model)  # of the model as it was read
        text = choices.keep_grown(found, model, before, written, made, keep, {})
    if as_json:
        click.echo(text)
    else:
        print_calibration(choices.untold(found), model, written)
        given = Given(robot, data, model, sigmas)
        click.echo(after_fit(written, written, given))
    if not found.settled:
        return 3
    return 0 if written else 1
