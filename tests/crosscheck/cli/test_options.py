"""What all commands share: their options, and progress on a terminal only."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from crosscheck.cli.compare import command as compare_command
from crosscheck.comparison.limits import RULES, option
from seecr.cli.options import json_option, out_option, progress_bar, progress_share


@click.command()
@out_option("results")
@json_option
def shared(out: object, as_json: bool) -> None:
    click.echo(f"{out} {as_json}")


def test_shared_options() -> None:
    runner = CliRunner()
    assert runner.invoke(shared, []).stdout == "results False\n"
    assert runner.invoke(shared, ["--out", "here", "--json"]).stdout == "here True\n"
    assert runner.invoke(shared, ["--out"]).exit_code == 2


def test_every_limit_is_an_option_of_compare() -> None:
    names = {name for parameter in compare_command.params for name in parameter.opts}
    assert {option(name) for name in RULES} <= names


def test_progress_is_silent_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("working", 3) as advance:
        advance(1, "still")
    with progress_share("working") as tell:
        tell("half", 0.5)
        tell("done", 1.0)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == ""
