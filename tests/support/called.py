"""The two programs, called as a shell calls them: ``ran("seecr pose camera 1 1 1")``.

``run("compare", xml, data)`` is ``ran`` of crosscheck with words that need no quotes.
"""

from __future__ import annotations

import json
import shlex
from typing import Any

from click.testing import CliRunner, Result
from shown import PROGRAMS

# A figure and a recording take most of the time of a command: where nobody looks at them, none.
BARE = "--figure none --no-recording"


def ran(words: str, status: int | None = None) -> Result:
    """A command's result; where a status is given it must be that."""
    program, *arguments = shlex.split(words)
    result = CliRunner().invoke(PROGRAMS[program], arguments, prog_name=program)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert status in (None, result.exit_code), result.output
    return result


def drawn_bare(words: str, status: int | None = None) -> str:
    """What a sweep or a map prints, without its pictures."""
    return ran(f"{words} {BARE}", status).output


def as_json(words: str, status: int = 0) -> dict[str, Any]:
    """The same of what a command prints for programs."""
    document: dict[str, Any] = json.loads(ran(f"{words} --json", status).stdout)
    return document


def refused_in_a_line(words: str) -> str:
    """The one line with which bad input ends; notes about the robot may be before it."""
    result = ran(words, 2)
    lines = result.stderr.splitlines(keepends=True)
    said = [line for line in lines if not line.startswith("note: ")]
    assert result.stdout == "" and len(said) == 1, result.output
    assert said[0].startswith(f"{words.split()[0]}: ")
    return said[0]


def run(*arguments: object, status: int | None = None) -> Result:
    """The result of crosscheck."""
    return ran(_words(arguments), status)


def printed(*arguments: object, status: int = 0) -> str:
    """What crosscheck prints."""
    return run(*arguments, status=status).output


def refused(*arguments: object) -> str:
    """The one line of a refusal of crosscheck."""
    return refused_in_a_line(_words(arguments))


def _words(arguments: tuple[object, ...]) -> str:
    return shlex.join(["crosscheck", *map(str, arguments)])


def following(result: Result) -> str:
    """The next command that a result names, without its comment."""
    assert result.exit_code == 0, result.output
    line = result.stdout.splitlines()[-1]
    assert line.startswith("next: "), result.stdout
    return line.removeprefix("next: ").partition("  # ")[0]
