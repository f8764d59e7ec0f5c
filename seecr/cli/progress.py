"""How far work is, how long it takes, and by whom it is done."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from concurrent.futures import Executor

SECONDS_BETWEEN_LINES = 15.0
"""How often work that takes long tells where it is, without a terminal."""


# Seconds at the start and for each row or pose, on one core of 2.5 GHz (time.process_time): of
# twins of demobot_cogiro with one hidden effect, 32 to 288 rows; of grids of 16 000 poses; of the
# suite, which takes a quarter of a minute on two. More cables and missing effects take longer.
_SECONDS = {
    "diagnose": (1.5, 0.027),
    "calibrate": (1.3, 0.027),
    "plan": (0.7, 0.004),
    "choose": (2.0, 0.004),
    "run": (0.0, 0.0105),
    "map": (0.1, 1.2e-5),
}
# Work of less than this [s] is done before its line is read.
_SOON = 2.0


def say_duration(
    work: str, count: int, noun: str, silent: bool = False, more: str = "", at_once: int = 1
) -> None:
    """Tell on a terminal about how long work takes for so many rows, unless it is soon done.

    Args:
        work: of the table above. count: of its rows or poses. noun: what these are.
        silent: whether only JSON is wanted. more: what may make it longer.
        at_once: how many processes share it.
    """
    first, each = _SECONDS[work]
    seconds = first + each * count / at_once
    if silent or seconds < _SOON or not sys.stderr.isatty():
        return
    words = f"{float(f'{seconds:.1g}'):g} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"
    click.echo(f"about {words} for {count} {noun}{more}", err=True)


@contextmanager
def executor_of(scheduler: str | None, jobs: int = 1) -> Iterator[Executor | None]:
    """The workers of ``--scheduler``, or so many processes; None for this process alone."""
    from seecr.parallel import cluster, processes

    def tell(text: str) -> None:
        click.echo(f"note: {text}", err=True)

    with processes(jobs) if scheduler is None else cluster(scheduler, tell) as executor:
        yield executor


@contextmanager
def progress_bar(text: str, total: int) -> Iterator[Callable[[int, str], None]]:
    """A progress bar on standard error; a line now and then where that is no terminal.

    Args:
        text: what is going on. total: steps to come.

    Yields:
        a function to call with the steps done since the last call, and what is going on now.
    """
    if not sys.stderr.isatty():
        yield _lines(text, total)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    name = TextColumn("{task.description}")
    columns = (name, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)

        def advance(steps: int, now: str) -> None:
            bar.update(task, advance=steps, description=now or text)

        yield advance


def _lines(text: str, total: int) -> Callable[[int, str], None]:
    """Tells on standard error how far the work is, where it takes long."""
    done, last = 0, monotonic()

    def advance(steps: int, now: str) -> None:
        nonlocal done, last
        done += steps
        if monotonic() - last >= SECONDS_BETWEEN_LINES:
            last = monotonic()
            click.echo(f"{text}: {100 * done // max(total, 1)} %{now and ', '}{now}", err=True)

    return advance


@contextmanager
def progress_share(text: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar for work that tells its share done; it never goes back.

    Yields:
        a function to call with what is going on now and the share of it (0 to 1) that is done.
    """
    done = 0
    with progress_bar(text, 100) as advance:

        def tell(now: str, share: float) -> None:
            nonlocal done
            percent = max(done, int(100 * share))
            advance(percent - done, now)
            done = percent

        yield tell
