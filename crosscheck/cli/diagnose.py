"""``crosscheck diagnose``: which effects are missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from crosscheck.cli import choices
from crosscheck.cli.following import Given, after_diagnosis
from seecr.cli import options
from seecr.cli.progress import progress_share, say_duration
from seecr.cli.results import made_by

if TYPE_CHECKING:
    from crosscheck import Diagnosis


@click.command(epilog="Example: crosscheck diagnose robot.xml measured.csv --out diagnosis")
@choices.robot_and_data
@options.option("--model M.toml", "Effects that the model already has.")
@choices.considered
@options.own_effects
@choices.sigma
@choices.tolerance
@options.option("--model-out M.toml", "Write the model with the missing effects added.")
@options.words_option(
    "--fail-on VERDICT,...",
    "Exit with status 1 if the verdict is one of these, such as unknown_effect,no_verdict.",
)
@choices.figures
@options.no_recording
@options.out("crosscheck-diagnosis")
@options.as_json
def command(
    robot: Path, data: tuple[Path, ...], model: Path | None, only: tuple[str, ...],
    exclude: tuple[str, ...], sigmas: tuple[str, ...], tolerances: tuple[str, ...],
    model_out: Path | None, fail_on: tuple[str, ...], figures: Path | None, no_recording: bool,
    out: Path, as_json: bool,
) -> int:  # fmt: skip
    """Find which effects a model misses, those that explain most first.

    ROBOT.xml is the robot's MJCF, DATA.csv its measurements; a TOML file beside it states the
    noise. Writes diagnosis.json, diagnosis.html and diagnosis.rrd.

    \b
    Exit status: 0 with a verdict, or without one for lack of data; 1 a verdict of --fail-on, 2 bad
    input, 3 rows without an equilibrium.
    """
    from crosscheck import DiagnosisVerdict, Tolerance, diagnose
    from crosscheck.model.write import check_place
    from crosscheck.show.diagnosis import print_diagnosis
    from crosscheck.show.residuals import drawn_words
    from seecr import load_model, new_model, with_history
    from seecr.description.fingerprint import fingerprint
    from seecr.files import json_text
    from seecr.folders import staged

    gates = [DiagnosisVerdict.named(word) for word in fail_on]
    tolerance = Tolerance.parsed(tolerances)
    choices.check_effects(only, exclude)  # a wrong name is told before any file is read
    machine, measured = choices.measured_by(robot, data, sigmas)
    own = load_model(model, machine) if model is not None else new_model(machine)
    if model_out is not None:
        check_place(model_out)
    made = made_by(machine.source, *data, model)
    names, sometimes = ["diagnosis.json", "diagnosis.html"], ["diagnosis.rrd"]
    with staged(out, names=names, sometimes=sometimes, read=data, made=made) as folder:
        say_duration("diagnose", measured.n_rows, "rows", as_json, ", longer if much is missing")
        with progress_share("diagnosing") as progress:
            found = diagnose(
                machine, measured, own, progress, only=only, exclude=exclude,
                tolerance=tolerance,
            )  # fmt: skip
        text = json_text({"made": made, "robot": fingerprint(machine), **found.as_json()})
        recorded = not no_recording and found.path is not None
        choices.keep_page(found, folder, "diagnosis", text + "\n", made, figures, recorded)
        if found.path is not None and (said := drawn_words(found.path.problem.data.n_rows)):
            click.echo(said, err=True)
        note = "" if model_out is None else keep_found(found, model_out)
    if as_json:
        click.echo(text)
    else:
        print_diagnosis(choices.untold(found), out)
    if note:
        click.echo(note, err=as_json)
    if not as_json:
        lengths, history = measured.command_lengths is not None, bool(with_history(machine, own))
        given = Given(robot, data, model, sigmas, lengths, history)
        click.echo(after_diagnosis(found, given, model_out, out))
    if found.verdict in gates:
        return 1
    return 0 if found.converged else 3


def keep_found(found: Diagnosis, path: Path) -> str:
    """Write the model that was found, if there was a verdict; what was done."""
    from crosscheck import DiagnosisVerdict, save_model

    if found.model is None:
        return f"{path} was not written: there is no verdict"
    save_model(path, found.model)
    if found.missing:
        text = f"Written to {path}: {', '.join(one.effect for one in found.missing)}"
        if found.verdict is DiagnosisVerdict.MANY_EFFECTS:
            text += (
                ". Its values are fitted without the other missing effects, so that it predicts "
                "best; those above allow for them and are nearer to the truth"
            )
        return text
    if found.refitted:
        names = ", ".join(found.refitted)
        return f"Written to {path}: {names}, refitted to these data; nothing added"
    return f"Written to {path}: the model as it was, with nothing added"
