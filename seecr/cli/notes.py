"""Notes about a robot, which are told before there is any result."""

from __future__ import annotations

from collections.abc import Iterable

import click

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
