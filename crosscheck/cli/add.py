"""``crosscheck add``: fit effects and put them into a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from crosscheck.cli import choices
from crosscheck.cli.following import Given, after_fit
from seecr.cli import options
from seecr.cli.progress import progress_share
from seecr.cli.results import made_by, result_in

if TYPE_CHECKING:
    from seecr import Model


@options.command(
    "crosscheck add pulley_radius robot.xml measured.csv --model model.toml",
    "crosscheck compare robot.xml measured.csv --model model.toml",
    "crosscheck add pulley_radius robot.xml second_day.csv --model model.toml --refit",
    "crosscheck add tracker_frame robot.xml monday.csv tuesday.csv --model model.toml --per file",
    "crosscheck add --all-from diagnosis.json robot.xml measured.csv --model model.toml",
)
@click.argument("words", nargs=-1, metavar="EFFECT ROBOT.xml DATA.csv...")
@options.option(
    "--all-from diagnosis.json",
    "Instead of EFFECT: fit all effects that this diagnosis lists, together.",
)
@options.fix
@options.passive
@choices.grown_model
@options.option("--refit", "Refit an effect that the model already has.")
@options.option("--per [file|run]", "Give EFFECT separate values for each file or run.")
@options.option("--force", "Add it even if it does not predict test runs better.")
@options.own_effects
@choices.sigma
@options.out_file("add.json")
@options.as_json
def command(
    words: tuple[str, ...], all_from: Path | None, model: Path, refit: bool, per: str | None,
    force: bool, sigmas: tuple[str, ...], out: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Fit EFFECT to DATA.csv, together with the model's own effects, and add it to the model.

    All effects of the model are refitted, because one may have absorbed what another causes. The
    model keeps the values, their standard errors and origin, and the errors before and after.

    An effect is not added if it does not improve the prediction of test runs: more parameters
    always fit better. Nor is it added if all its values together differ from null by no more than
    their standard errors. --force adds it anyway.

    \b
    Exit status: 0 added, 1 not added because it is not worth adding, 2 bad input, 3 rows without an
    equilibrium or a fit that does not converge.
    """
    from crosscheck import Sigma, add_effect, add_effects, load_diagnosed, load_measurements
    from crosscheck.model.write import check_place, state_of
    from crosscheck.show.models import print_addition
    from seecr import effect_named

    effect, robot, data = _arguments(words, all_from)
    if effect is not None:
        effect_named(effect)
    elif per is not None:
        raise click.UsageError("--per applies to a single EFFECT; leave out --all-from")
    from seecr.cli.arguments import robot_at

    machine = robot_at(robot)
    listed, said = load_diagnosed(all_from, machine) if all_from is not None else ((), ())
    names = [effect] if effect is not None else [term.name for term in listed]
    before = state_of(model)
    old = choices.model_or_new(model, machine)
    for name in names:
        _check_names(old, name, refit, model)
    measured = load_measurements(data, machine, sigma=Sigma.parsed(sigmas))
    check_place(model)
    with result_in(out, "add.json") as keep:
        with progress_share(f"adding {' + '.join(names)}") as progress:
            if effect is not None:
                found = add_effect(machine, measured, effect, old, progress, per=per)
            else:
                found = add_effects(machine, measured, listed, old, progress)
        found = replace(found, notes=(*said, *found.notes))
        written = found.pays or force
        # of the model as it was read
        made = made_by(machine.source, *data, all_from, model)
        more = {"model_notes": list(old.notes)}
        text = choices.keep_grown(found, model, before, written, made, keep, more)
    if as_json:
        click.echo(text)
    else:
        print_addition(choices.untold(found), model, written)
        given = Given(robot, data, model, sigmas)
        click.echo(after_fit(found.is_noise, written, given))
    return 0 if written else 1


def _arguments(
    words: tuple[str, ...], all_from: Path | None
) -> tuple[str | None, Path, tuple[Path, ...]]:
    """The effect, unless a diagnosis names them, the robot's file and those of the data."""
    from seecr import catalogue

    # beside --all-from the first word is the robot's file; an effect there was meant as one
    if all_from is not None and words and words[0] in catalogue() and not Path(words[0]).exists():
        raise click.UsageError(
            f"expected EFFECT or --all-from, not both; got {words[0]} and --all-from {all_from}; "
            "leave one of them out"
        )
    expected = ["EFFECT", "ROBOT.xml", "DATA.csv"][0 if all_from is None else 1 :]
    if len(words) < len(expected):
        given = " ".join(words) or "nothing"
        beside = "" if all_from is None else " with --all-from"
        raise click.UsageError(f"expected {' '.join(expected)}{beside}, got {given}")
    effect = words[0] if all_from is None else None
    robot, *data = (Path(word) for word in words[len(expected) - 2 :])
    return effect, robot, tuple(data)


def _check_names(old: Model, effect: str, refit: bool, path: Path) -> None:
    from crosscheck import CrosscheckError

    if effect in old.names and not refit:
        raise CrosscheckError(f"{path} already has {effect}; --refit fits it again")
    if refit and effect not in old.names:
        has = ", ".join(old.names) or "none"
        raise CrosscheckError(
            f"{path} has no {effect} to fit again (it has {has}); leave out --refit to add it"
        )
    if refit and old.terms[effect].knowledge.fixed.all():
        raise CrosscheckError(
            f"{path}: {effect} is fixed and never fitted; take out fixed = true to fit it again"
        )
