"""The suite's results on the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.suite.effects import effect_failures, effects_line
from crosscheck.suite.results import (
    QUANTITY_HEADS,
    TABLE_HEADS,
    case_cells,
    failure_lines,
    widened_lines,
)
from crosscheck.suite.run import threshold_cells, verdict_line
from crosscheck.suite.verdicts import FINDINGS, Outcome, Verdict
from crosscheck.terminal.lines import console_for, say
from seecr.counted import counted

if TYPE_CHECKING:
    from crosscheck.suite.results import CaseResult
    from crosscheck.suite.run import Run

_STYLE = {
    Outcome.AGREE: "green",
    Outcome.DIFFER: "bold red",
    Outcome.NOT_CONVERGED: "bold yellow",
}
# Failures told on the terminal; summary.md and results.json have them all.
_MOST = 5
# Columns of words, of the case's result, and those shown on any terminal.
_RESULT = TABLE_HEADS.index("result")
_WORDS = (0, _RESULT, _RESULT + 1)
_ESSENTIAL = (0, *(TABLE_HEADS.index(head) for head in QUANTITY_HEADS.values()), _RESULT)
_ROOMY = 124


def print_run(run: Run, out: Path, console: Console | None = None) -> None:
    """Print the table, what needs a look, the verdict, and where the files are.

    Args:
        run: what to tell about.
        out: the folder of results.
        console: where to; standard output by default.
    """
    console = console_for(console)
    if run.results:
        console.print(_table(run, console.width))
    for result in run.results:
        _print_notes(console, result)
    for verdict in FINDINGS:
        if run.count(verdict):
            poses = counted(run.count(verdict), "pose")
            say(console, f"Finding at {poses}: {verdict.value}.")
    _print_lines(console, effect_failures(run.effects), "effects")
    if run.effects and run.results:
        say(console, effects_line(run.effects))
    say(console, verdict_line(run), _STYLE[run.outcome])
    say(console, f"{run.wall_s:.1f} s; results in {out}/")


def _table(run: Run, width: int) -> Table:
    """The cases, without the columns that are left out where the terminal is narrow."""
    shown = [i for i in range(len(TABLE_HEADS)) if width >= _ROOMY or i in _ESSENTIAL]
    table = Table(box=None, header_style="bold", pad_edge=False)
    for i in shown:
        head = Text(TABLE_HEADS[i].replace(" [", "\n["))
        table.add_column(head, justify="left" if i in _WORDS else "right", no_wrap=True)
    for result in run.results:
        cells = [Text(cell) for cell in case_cells(result)]
        cells[_RESULT].stylize(_STYLE[result.outcome])
        table.add_row(*(cells[i] for i in shown))
    limits = threshold_cells(run)
    table.add_row(*(Text(limits[i], style="dim") for i in shown))
    return table


def _print_notes(console: Console, result: CaseResult) -> None:
    """Failures, branches and widened thresholds of a case; its free motions are only counted."""
    lines = failure_lines(result)
    branches = [f for f in result.findings if f.verdict is Verdict.BRANCH and not f.fails]
    lines += [f"pose {f.pose}: {f.text}" for f in branches]
    lines += widened_lines(result)
    name = result.case.name
    _print_lines(console, [f"{name}, {line}" for line in lines], name)


def _print_lines(console: Console, lines: list[str], name: str) -> None:
    """The first few lines about a case or the effects, and how many more there are."""
    for line in lines[:_MOST]:
        say(console, line)
    if len(lines) > _MOST:
        say(console, f"{name}: {len(lines) - _MOST} more in summary.md")
