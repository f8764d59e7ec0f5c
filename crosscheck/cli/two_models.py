"""``crosscheck compare A.toml B.toml``: which values of two models differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from seecr.cli.following import following
from seecr.cli.results import made_by

_SUFFIXES = (".toml", ".json")
# Options of `compare` that are for two models alone, and those that are for either.
_THEIRS = ("model_out", "fail_on")
_EITHER = ("out", "as_json")


def are_models(robot: Path, data: Sequence[Path]) -> bool:
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
    _check_options(bool(models))
    return bool(models)


def _check_options(models: bool) -> None:
    """Refuse options of the other way of ``compare``."""
    context = click.get_current_context()
    default = click.core.ParameterSource.DEFAULT
    for param in context.command.params:
        of_either = param.name in _EITHER or not param.expose_value
        if not isinstance(param, click.Option) or param.name is None or of_either:
            continue
        given = context.get_parameter_source(param.name) not in (default, None)
        if given and (param.name in _THEIRS) != models:
            way = "two models" if param.name in _THEIRS else "ROBOT.xml DATA.csv..."
            raise click.UsageError(f"{param.opts[0]} is for compare {way}; leave it out")


def compare_two(
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
        status = 1 if (fail_on and found.differs) or _unwritten(found.pooled, model_out) else 0
        head: Mapping[str, Any] = {
            "made": made, "exit_status": status,
        }  # fmt: skip
        text = json_text({**head, **found.as_json()})
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


def _unwritten(pooled: object, model_out: Path | None) -> bool:
    return model_out is not None and pooled is None
