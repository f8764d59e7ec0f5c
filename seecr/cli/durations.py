"""How long work takes is said before it takes it, on a terminal."""

from __future__ import annotations

import sys

import click

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
