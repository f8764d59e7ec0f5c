"""``crosscheck compare``: a model against measurements, or two models against each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click
from click.core import ParameterSource

from crosscheck.cli import choices
from crosscheck.cli.following import Given, after_comparison
from seecr.cli import options
from seecr.cli.following import following
from seecr.cli.progress import progress_share
from seecr.cli.results import made_by

# Files that are two models, or their diagnoses.
_SUFFIXES = (".toml", ".json")
# Options of `compare` that are for two models alone, and those that are for either.
_THEIRS = ("model_out", "fail_on")
_EITHER = ("out", "as_json")


@options.command(
    "crosscheck compare robot.xml measured.csv",
    "crosscheck compare robot.xml measured.csv --model model.toml --max-position 0.5mm",
    "crosscheck compare robot.xml measured.csv --limits limits.toml --json",
    "crosscheck compare monday.toml friday.toml --fail-on moved",
)
@choices.robot_and_data
@options.option("--model M.toml", "The model.  [default: plain SEECR]")
@options.option("--max-position 0.5mm", "Limit on the rms position error.")
@options.option("--max-orientation 0.2deg", "Limit on the rms orientation error.")
@options.option("--max-tension 1N", "Limit on the rms tension error.")
@options.option("--max-position-worst 2mm", "Limit on the worst row's error.")
@options.option("--max-orientation-worst 1deg", "Limit on the worst row's error.")
@options.option("--max-tension-worst 5N", "Limit on the worst row's error.")
@options.option(
    "--limits FILE.toml",
    'Limits from a file: max_position = "0.5mm" and so on; options override it.',
    name="limits_file",
)
@options.own_effects
@choices.sigma
@options.option("--model-out M.toml", "Of two models: write the pooled one.")
@options.words_option("--fail-on moved", "Of two models: exit with status 1 if a value moved.")
@choices.figures
@options.no_recording
@options.out("crosscheck-comparison")
@options.as_json
def command(
    robot: Path, data: tuple[Path, ...], model: Path | None, limits_file: Path | None,
    sigmas: tuple[str, ...], model_out: Path | None, fail_on: tuple[str, ...],
    figures: Path | None, no_recording: bool, out: Path, as_json: bool, **errors: str | None,
) -> int:  # fmt: skip
    """Show where a model is off, by how much, and whether the residuals are noise.

    Given two models (A.toml B.toml) or two diagnosis.json of one robot instead, it tells which
    values moved beyond their errors from the first to the second, which neither settles, and with
    --model-out writes one pooled model; it writes models.json.

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
    if _are_models(robot, data):
        return _compare_two(robot, data[0], out, model_out, fail_on, as_json)
    from crosscheck import Limits, compare, exceeded, load_limits
    from crosscheck.show.comparison import print_comparison
    from crosscheck.show.residuals import drawn_words
    from seecr import load_model, with_history
    from seecr.files import json_pieces
    from seecr.folders import staged

    limits = (load_limits(limits_file) if limits_file else Limits()).but(errors)
    machine, measured = choices.measured_by(robot, data, sigmas)
    own = load_model(model, machine) if model is not None else None
    made = made_by(machine.source, *data, model)
    names, sometimes = ["comparison.json", "comparison.html"], ["comparison.rrd"]
    with (
        staged(out, names=names, sometimes=sometimes, read=data, made=made) as folder,
        progress_share("comparing") as progress,
    ):
        found = compare(machine, measured, own.terms if own else ())
        beyond = exceeded(limits, found)
        status = 1 if beyond else (0 if found.converged else 3)
        stated = {k: v for k, v in vars(limits).items() if v is not None}
        head = {"made": made, "exit_status": status, "limits": stated, "exceeded": beyond}
        notes = own.notes if own else ()
        document = {**head, **found.as_json(), "model_notes": list(notes)}
        progress("drawing the page" if no_recording else "drawing the page, recording", 0.5)
        text = json_pieces(document)
        choices.keep_page(found, folder, "comparison", text, made, figures, not no_recording)
        progress("all is written", 1.0)
    if said := drawn_words(found.problem.data.n_rows):
        click.echo(said, err=True)
    if as_json:
        for piece in json_pieces(document):
            click.echo(piece, nl=False)
        return status
    for note in notes:
        click.echo(f"note: {note}")
    print_comparison(choices.untold(found), beyond, limits != Limits(), out)
    history = own is not None and bool(with_history(machine, own))
    lengths = measured.command_lengths is not None
    given = Given(robot, data, model, sigmas, lengths, history)
    click.echo(after_comparison(found, given))
    return status


# Two models instead of one and its measurements.


def _are_models(robot: Path, data: Sequence[Path]) -> bool:
    """Whether the files of ``compare`` are two models or diagnoses, by what they are called.

    Raises:
        UsageError: some are, and others are not, or there are more than two; or options of the
            other way.
    """
    files = [robot, *data]
    models = [file for file in files if file.suffix.lower() in _SUFFIXES]
    if models and (len(files) != 2 or len(models) != 2):
        raise click.UsageError(
            "expected ROBOT.xml DATA.csv..., or two models (A.toml B.toml) or diagnoses "
            f"(diagnosis.json) of one robot; got {' '.join(map(str, files))}"
        )
    context = click.get_current_context()
    for param in context.command.params:
        name = param.name or ""
        if name in _EITHER or not param.expose_value or not isinstance(param, click.Option):
            continue
        given = context.get_parameter_source(name) not in (ParameterSource.DEFAULT, None)
        if given and (name in _THEIRS) != bool(models):
            way = "two models" if name in _THEIRS else "ROBOT.xml DATA.csv..."
            raise click.UsageError(f"{param.opts[0]} is for compare {way}; leave it out")
    return bool(models)


def _compare_two(
    before: Path, now: Path, out: Path, model_out: Path | None, fail_on: Sequence[str],
    as_json: bool,
) -> int:  # fmt: skip
    """Compare two models, and keep what was found."""
    from crosscheck import compare_models, save_model
    from crosscheck.model.write import check_place
    from crosscheck.show.models import print_models
    from seecr.files import json_text, write_text
    from seecr.folders import staged

    if wrong := [word for word in fail_on if word != "moved"]:
        raise click.UsageError(f"--fail-on: expected moved, got {wrong[0]}")
    if model_out is not None:
        check_place(model_out)
    made = made_by(before, now)
    with staged(out, names=["models.json"], read=[before, now], made=made) as folder:
        found = compare_models(before, now)
        unwritten = model_out is not None and found.pooled is None
        status = 1 if (fail_on and found.differs) or unwritten else 0
        text = json_text({"made": made, "exit_status": status, **found.as_json()})
        write_text(folder / "models.json", text + "\n")
    if model_out is not None and found.pooled is not None:
        save_model(model_out, found.pooled)
    if as_json:
        click.echo(text)
        return status
    print_models(found, model_out)
    click.echo(f"Results in {out}/")
    kept = model_out if model_out is not None and found.pooled is not None else now
    model = ("--model", kept) if kept.suffix.lower() == ".toml" else ()
    click.echo(following("crosscheck", "compare", "ROBOT.xml", "DATA.csv", *model))
    return status
