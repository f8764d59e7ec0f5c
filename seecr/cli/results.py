"""What a command keeps and tells: notes, how it came to its result, and the files of that."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seecr.cli.group import ARGUMENTS

if TYPE_CHECKING:
    from seecr.files import Made

# In a context's ``meta``: the notes that were told already.
_TOLD = "seecr.told"


def tell(notes: Iterable[str]) -> None:
    """Tell notes on standard error, each once."""
    told = _told()
    for note in untold(notes):
        click.echo(f"note: {note}", err=True)
        told.append(note)


def untold(notes: Iterable[str]) -> list[str]:
    """The notes that :func:`tell` did not tell."""
    told = _told()
    return [note for note in notes if note not in told]


def _told() -> list[str]:
    """Those of the command that is running; none where Python calls what commands call."""
    ctx = click.get_current_context(silent=True)
    out: list[str] = [] if ctx is None else ctx.meta.setdefault(_TOLD, [])
    return out


def made_by(*files: Path | None) -> Made:
    """How the command that is running came to its result, from these files."""
    from seecr.files import Made

    ctx = click.get_current_context()
    words = [ctx.find_root().info_name or "seecr", *ctx.meta.get(ARGUMENTS, [])]
    return Made.now(shlex.join(words), files)


def files_of_pictures(name: str, figure: str, no_recording: bool) -> tuple[set[str], set[str]]:
    """Pictures of that name: those that ``--figure`` and ``--no-recording`` ask for, and all."""
    every = {kind: f"{name}.{kind}" for kind in ("png", "svg", "rrd")}
    now = {figure} | (set() if no_recording else {"rrd"})
    return {file for kind, file in every.items() if kind in now}, {*every.values()}


@contextmanager
def result_in(out: Path | None, name: str) -> Iterator[Callable[[str], None]]:
    """A function that keeps a result's text in a folder, if any; it is tried before the work."""
    from seecr.files import write_text
    from seecr.folders import staged

    if out is None:
        yield lambda _text: None
        return
    with staged(out, names=[name]) as folder:
        yield lambda text: write_text(folder / name, text + "\n")
