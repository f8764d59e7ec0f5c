"""What all commands share: their options, and progress."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

import crosscheck.cli
import seecr.cli
from crosscheck.cli.compare import command as compare_command
from crosscheck.comparison.limits import RULES, option
from seecr.cli import options, progress
from seecr.cli.group import LazyGroup
from seecr.cli.progress import progress_bar, progress_share, say_duration


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        (options.WholeNumber(min=6), "abc", "expected a whole number of at least 6, got 'abc'"),
        (options.WholeNumber(min=6), "5", "expected a whole number of at least 6, got '5'"),
        (options.Number(), "1,5", "expected a number, got '1,5'"),
        (options.Number(0.0, 1.0, min_open=True), "0", "a number above 0 and at most 1, got '0'"),
        (options.Number(max=2.0), "3", "expected a number of at most 2, got '3'"),
    ],
)
def test_numbers_are_refused_with_what_is_expected(
    kind: click.ParamType, text: str, words: str
) -> None:
    with pytest.raises(click.BadParameter) as refused:
        kind.convert(text, None, None)
    assert words in str(refused.value)
    assert options.WholeNumber(min=6).convert("6", None, None) == 6
    assert options.Number().convert("-1.5", None, None) == -1.5


def test_every_limit_is_an_option_of_compare() -> None:
    names = {name for parameter in compare_command.params for name in parameter.opts}
    assert {option(name) for name in RULES} <= names


def test_without_a_terminal_long_work_tells_where_it_is_and_never_goes_back(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    with progress_share("working") as tell:
        for share in (0.25, 0.75, 0.5, 1.0):
            tell("on it", share)
    with progress_bar("working", 4) as advance:
        advance(1, "")
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"working: {p} %, on it" for p in (25, 75, 75, 100)] + ["working: 25 %"]


def test_every_command_that_may_take_a_second_has_a_bar() -> None:
    without = {
        module
        for group in (crosscheck.cli, seecr.cli)
        for module, _said in group.COMMANDS.values()
        for source in [Path(inspect.getfile(group)).with_name(f"{module}.py").read_text()]
        if not re.search(r"progress_(share|bar)\(", source)
    }
    assert without == {"effects", "export", "new"}


def test_short_work_says_nothing_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("working", 3) as advance:
        advance(1, "still")
    with progress_share("working") as tell:
        tell("half", 0.5)
        tell("done", 1.0)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == ""


def test_a_terminal_is_told_how_long_work_takes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def said(work: str, count: int, noun: str, **more: Any) -> str:
        say_duration(work, count, noun, **more)
        out, err = capsys.readouterr()
        assert out == ""
        return err

    assert said("diagnose", 144, "rows") == ""  # no terminal
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    # 1.5 s + 144 x 0.027 s
    assert said("diagnose", 144, "rows", more=", or so") == "about 5 s for 144 rows, or so\n"
    assert said("diagnose", 10_000, "rows") == "about 5 min for 10000 rows\n"
    assert said("run", 2868, "poses", at_once=2) == "about 20 s for 2868 poses\n"
    assert said("diagnose", 144, "rows", silent=True) == ""  # JSON alone
    assert said("map", 1000, "poses") == ""  # done before it is read


@pytest.mark.parametrize("group", [crosscheck.cli.main, seecr.cli.main])
def test_of_an_option_for_one_file_several_are_refused(group: LazyGroup) -> None:
    """Of two models the last was taken, and nothing said."""
    refused = set()
    for name in group.table:
        command = group.get_command(click.Context(group), name)
        assert command is not None
        options = [one for one in command.params if isinstance(one, click.Option)]
        for one in options:
            if isinstance(one.type, click.Path) and not one.multiple:
                words = [one.opts[0], "file"]
                said = CliRunner().invoke(group, [name, *words, *words], prog_name="it")
                assert said.exit_code == 2 and said.stdout == ""
                assert f"{one.opts[0]}: expected once, got 2 times" in said.stderr
                assert f"(see it {name} --help)" in said.stderr
                refused.add(one.opts[0])
    assert {"--model", "--out"} <= refused


def test_other_options_may_be_repeated() -> None:
    words = "diagnose robot.xml data.csv --only a --only b --figures f"
    assert "expected once" not in CliRunner().invoke(crosscheck.cli.main, words.split()).stderr
