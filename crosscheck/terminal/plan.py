"""A plan on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.result import Plan, alike, gain_words
from crosscheck.terminal.lines import console_for, say
from seecr.counted import some

_MOST_GAINS, _MOST_SLACK = 3, 5


def print_plan(
    plan: Plan, out: Path, files: Sequence[str] = (), console: Console | None = None
) -> None:
    """Print what will show, what cannot be told apart, what to add, and the files of commands."""
    console = console_for(console, plan.notes)
    if plan.effects:
        console.print(_table(plan))
    for name, why in plan.missing.items():
        say(console, f"{name}: not testable with these data: {why.words}", "dim")
    _print_slack(console, plan)
    say(console, plan.sentence, "bold")
    for suggestion in plan.suggestions:
        _print_suggestion(console, suggestion)
    more = f", commands in {', '.join(files)}" if files else ""
    say(console, f"Results in {out}/{more}", "dim")


def _table(plan: Plan) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in (
        "effect",
        "smallest visible size",
        ("smallest size to name it"),
        "indistinguishable from",
    ):
        table.add_column(head)
    for found in plan.effects:
        named = "-" if found.twins else found.words(found.identifiable)
        style = "" if found.visible else "dim"
        table.add_row(found.name, found.words(found.factor), named, alike(found), style=style)
    return table


def _print_slack(console: Console, plan: Plan) -> None:
    if not plan.slack:
        return
    lines = [f"line {line} ({cable})" for line, cable in plan.slack]
    say(
        console,
        f"Close to the limit between slack and taut: {some(lines, _MOST_SLACK)}. At these poses "
        "small errors change which cables are taut, so this plan is less certain about them.",
        "bold yellow",
    )


def _print_suggestion(console: Console, item: Suggestion) -> None:
    reached = item.reached
    if not reached:
        return
    words = some([gain_words(g) for g in reached], _MOST_GAINS, "; ")
    say(console, f"add: {item.words}: {words}")
    for place in item.places:
        say(console, f"     {place}")
