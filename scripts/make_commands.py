"""Write docs/commands.md: every command of both programs, from the commands themselves.

    python scripts/make_commands.py

A test runs :func:`page` and goes red where the page is out of date.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from inspect import cleandoc
from pathlib import Path

import click
from link_words import with_links

import crosscheck.cli
import seecr.cli

PAGE = Path(__file__).resolve().parents[1] / "docs" / "commands.md"
PROGRAMS = {"crosscheck": crosscheck.cli.main, "seecr": seecr.cli.main}

_HEAD = """# Commands

What `crosscheck COMMAND --help` and `seecr COMMAND --help` say, on one page. Written by
`scripts/make_commands.py` from the commands. Files that go in are described in
[formats](formats.md), effects in [effects](effects.md); the [tutorial](tutorial.md) uses most
commands in their order.

Exit status of all: 0 all well, 1 a threshold exceeded, 2 bad input or usage, 3 a solve did not
converge.
"""


def page() -> str:
    """The page's text."""
    parts = [_HEAD]
    for program, group in PROGRAMS.items():
        context = click.Context(group, info_name=program)
        parts.append(f"## {program}\n")
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            assert command is not None
            parts += _command(click.Context(command, info_name=name, parent=context))
    return with_links("\n".join(parts))


def _command(context: click.Context) -> Iterator[str]:
    command = context.command
    yield f"### {context.command_path}\n"
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"```text\n{context.command_path} {usage}\n```\n"
    yield from _paragraphs(command.help or "")
    options = [one for one in command.params if isinstance(one, click.Option)]
    rows = [record for one in options if (record := one.get_help_record(context))]
    yield "| option | what it does |\n|---|---|"
    yield "\n".join(f"| `{_cell(name)}` | {_marked(_cell(words))} |" for name, words in rows) + "\n"
    yield from _paragraphs(command.epilog or "")


def _paragraphs(text: str) -> Iterator[str]:
    """A help text as Markdown; what a terminal must not wrap stays as it is."""
    for paragraph in cleandoc(text).split("\n\n"):
        if paragraph.startswith("Example: "):
            yield f"Example:\n\n```sh\n{paragraph.removeprefix('Example: ')}\n```\n"
            continue
        if not paragraph.startswith("\b"):
            yield f"{_marked(paragraph)}\n"
            continue
        head, *lines = paragraph.removeprefix("\b\n").split("\n")
        kind = "sh" if head.startswith("Example") else "text"
        body = "\n".join(line.removeprefix("  ") for line in lines)
        if head.endswith(":"):
            yield f"{_marked(head)}\n\n```{kind}\n{body}\n```\n"
        else:
            yield _marked("  \n".join([head, *lines])) + "\n"


def _marked(text: str) -> str:
    """A text with its options in the letters of code."""
    return re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)", r"`\1`", text)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


if __name__ == "__main__":
    part = PAGE.with_suffix(".md.part")
    part.write_text(page(), encoding="utf-8")
    part.replace(PAGE)
    sys.stdout.write(f"{PAGE.name}: {page().count('### ')} commands\n")
