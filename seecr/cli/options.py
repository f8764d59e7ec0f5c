"""Options and habits that all commands share."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

import click

from seecr.cli.following import STDIN
from seecr.cli.group import ARGUMENTS

if TYPE_CHECKING:
    from seecr.files import Made

F = TypeVar("F", bound=Callable[..., Any])

SECONDS_BETWEEN_LINES = 15.0
"""How often work that takes long tells where it is, without a terminal."""


class WholeNumber(click.IntRange):
    """A whole number in a range; what is none, or outside, is told what was expected."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number, or a usage error."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected a whole number{_within(self)}, got {value!r}.", param, ctx)


class Number(click.FloatRange):
    """A number in a range; what is none, or outside, is told what was expected."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number, or a usage error."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected a number{_within(self)}, got {value!r}.", param, ctx)

    def _describe_range(self) -> str:
        """The range in the help; click describes one without ends as x<=None."""
        return "" if self.min is None and self.max is None else super()._describe_range()


def _within(numbers: click.IntRange | click.FloatRange) -> str:
    """A range in words, with a space before; nothing if there is none."""
    low, high = numbers.min, numbers.max
    if low is None:
        return "" if high is None else f" of at most {high:g}"
    least = f"above {low:g}" if numbers.min_open else f"of at least {low:g}"
    return f" {least}" if high is None else f" {least} and at most {high:g}"


class _File(click.Path):
    """A path; ``-`` is standard input, as everywhere."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path of what is given."""
        return super().convert(STDIN if value == "-" else value, param, ctx)


FILE = _File(path_type=Path)
"""A file that the command itself opens, so that the error is its own."""


def out_option(default: str) -> Callable[[F], F]:
    """``--out DIR``, given to the command as ``out``, a path."""
    return click.option(
        "--out",
        type=FILE,
        default=default,
        show_default=True,
        metavar="DIR",
        help=(
            "Folder for the results; created if it does not exist. Older results there are "
            "replaced."
        ),
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
    type=WholeNumber(min=1),
    default=None,
    metavar="N",
    help="Number of parallel processes.  [default: one per processor]",
)
"""``--jobs N``, given to the command as ``jobs``; None means :func:`seecr.parallel.processors`."""

seed_option = click.option(
    "--seed",
    type=WholeNumber(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="Seed of the random numbers.",
)
"""``--seed N``, given to the command as ``seed``."""


def made_by(*files: Path | None) -> Made:
    """How the command that is running came to its result, from these files."""
    from seecr.files import Made

    ctx = click.get_current_context()
    words = [ctx.find_root().info_name or "seecr", *ctx.meta.get(ARGUMENTS, [])]
    return Made.now(shlex.join(words), files)


@contextmanager
def progress_bar(text: str, total: int) -> Iterator[Callable[[int, str], None]]:
    """A progress bar on standard error; a line now and then where that is no terminal.

    Args:
        text: what is going on.
        total: steps to come.

    Yields:
        a function to call with the steps done since the last call, and what is going on now.
    """
    if not sys.stderr.isatty():
        yield _lines(text, total)
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

    Args:
        text: what is going on.

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


def finite_option(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """A number as it is, as an option's callback; a usage error where it is none, or has no end."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.", ctx, param)
    return value
