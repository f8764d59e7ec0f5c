"""Options and habits that all commands share."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)
"""A file that the command itself opens, so that the error is its own."""


def out_option(default: str) -> Callable[[F], F]:
    """``--out DIR``, given to the command as ``out``, a path."""
    return click.option(
        "--out",
        type=FILE,
        default=default,
        show_default=True,
        metavar="DIR",
        help="Folder for the results; made if it does not exist.",
    )


json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the result as JSON on standard output, and nothing else there.",
)
"""``--json``, given to the command as ``as_json``."""

jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=None,
    metavar="N",
    help="How many at a time.  [default: one per processor]",
)
"""``--jobs N``, given to the command as ``jobs``; None means :func:`seecr.threads.processors`."""

seed_option = click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="Of the random numbers.",
)
"""``--seed N``, given to the command as ``seed``."""


@contextmanager
def progress_bar(text: str, total: int) -> Iterator[Callable[[int, str], None]]:
    """A progress bar on standard error if that is a terminal, else nothing.

    Args:
        text: what is going on.
        total: steps to come.

    Yields:
        a function to call with the steps done since the last call, and what is going on now.
    """
    if not sys.stderr.isatty():
        yield lambda steps, now: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)

        def advance(steps: int, now: str) -> None:
            bar.update(task, advance=steps, description=now or text)

        yield advance


@contextmanager
def progress_share(text: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar for work that tells its share of a round done, on a terminal only.

    Args:
        text: what is going on.

    Yields:
        a function to call with what is going on now and the share of it (0 to 1) that is done.
    """
    done = [0]
    with progress_bar(text, 100) as advance:

        def tell(now: str, share: float) -> None:
            percent = int(100 * share)
            advance(percent - done[0], now)
            done[0] = percent

        yield tell
