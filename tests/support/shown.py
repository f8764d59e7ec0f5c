"""Pages whose files, commands and examples are what they say.

A fence after a line that ends in a file's name and a colon, such as `poses.csv`:, is that file.
Commands of a `sh` fence are run in order, and so is the code of a `python` fence; a `text` fence
right after either shows what was printed. A line of three dots stands for lines left out.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from click.testing import CliRunner

import crosscheck.cli
import seecr.cli

PROGRAMS = {"crosscheck": crosscheck.cli.main, "seecr": seecr.cli.main}
LEFT_OUT = "..."
_FENCE = re.compile(r"(?P<before>[^\n]*)\n\n?```(?P<kind>\w+)\n(?P<text>.*?)```", re.DOTALL)
_FILE = re.compile(r"`([\w./]+)`:$")
_ENDS = re.compile(r"#.*\bends (\d)")


@dataclass
class Page:
    """A page that is run in a folder; examples share their names."""

    folder: Path
    names: dict[str, Any] = field(default_factory=dict)
    commands: list[str] = field(default_factory=list)

    def run(self, text: str) -> None:
        """Write its files and run its commands and examples; what it shows is what they print."""
        printed = ""
        with contextlib.chdir(self.folder):
            for before, kind, inside in _fences(text):
                if name := _FILE.search(before):
                    path = Path(name.group(1))
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_text(inside, encoding="utf-8")
                elif kind == "sh":
                    printed = "".join(self._command(line) for line in _lines(inside))
                elif kind == "python":
                    printed = self._example(inside)
                elif kind == "text" and printed:
                    assert_shown(inside, printed)
                    printed = ""

    def _command(self, line: str) -> str:
        program, *words = shlex.split(line, comments=True)
        if program == "cd":
            os.chdir(words[0])
            return ""
        assert program in PROGRAMS, f"not a command of ours: {line}"
        self.commands.append(line)
        result = CliRunner(env={"COLUMNS": "100"}).invoke(PROGRAMS[program], words)
        expected = int(ends.group(1)) if (ends := _ENDS.search(line)) else 0
        assert result.exit_code == expected, f"{line}\n{result.output}"
        return result.output

    def _example(self, code: str) -> str:
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, "example", "exec"), self.names)
        return out.getvalue()


def assert_shown(said: str, printed: str) -> None:
    """What a page shows was printed: its lines in order, whole, without gaps but those it shows."""
    rest = f"\n{_tidy(printed)}\n"
    for part in re.split(rf"^{re.escape(LEFT_OUT)}$", said, flags=re.MULTILINE):
        if lines := _tidy(part):
            _, found, rest = rest.partition(f"\n{lines}\n")
            assert found, f"the page shows\n{part}\nwhich was not printed in\n{printed}"
            rest = f"\n{rest}"


def _fences(text: str) -> Iterator[tuple[str, str, str]]:
    for found in _FENCE.finditer(text):
        yield found["before"], found["kind"], found["text"]


def _lines(text: str) -> list[str]:
    joined = text.replace("\\\n", " ")
    return [line for line in joined.split("\n") if line.strip() and not line.startswith("#")]


def _tidy(text: str) -> str:
    """Text without spaces at the ends of lines, which no page keeps, nor empty lines around it."""
    return "\n".join(line.rstrip() for line in text.split("\n")).strip("\n")
