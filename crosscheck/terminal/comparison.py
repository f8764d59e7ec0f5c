"""A comparison on the terminal, in millimetres and degrees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.comparison.limits import Exceeded
from crosscheck.comparison.quantities import QuantityKind
from crosscheck.comparison.result import Comparison, Group
from crosscheck.fit.least_squares.problem import KINDS, Kind, Rms
from crosscheck.terminal.lines import cell, console_for, four_digits, heading, say, table_of
from seecr.counted import counted
from seecr.units import in_unit

_MOST, _MOST_WORST, _MOST_UNSOLVED = 12, 5, 5


def print_comparison(
    found: Comparison,
    exceeded: Sequence[Exceeded],
    limited: bool,
    out: Path,
    console: Console | None = None,
) -> None:
    """Print the tables, the verdict, what exceeds its limit, and where the files are."""
    console = console_for(console, found.notes)
    if found.coordinates:
        console.print(_coordinates(found))
        console.print(_errors(found))
        _print_associations(console, found)
        _print_worst(console, found)
    if found.tracking is not None:
        say(console, found.tracking.words(found.problem.data))
    for row in found.unsolved[:_MOST_UNSOLVED]:
        say(console, f"line {row.line}, run {row.run}: {row.why}", "bold yellow")
    if len(found.unsolved) > _MOST_UNSOLVED:
        say(
            console,
            f"{counted(len(found.unsolved) - _MOST_UNSOLVED, 'more row')} without an equilibrium",
        )
    say(console, found.sentence, "green" if found.is_noise else "bold yellow")
    for item in exceeded:
        say(console, item.words, "bold red")
    if limited and not exceeded:
        say(console, "All limits hold.", "green")
    say(console, f"Results in {out}/", "dim")


def _coordinates(found: Comparison) -> Table:
    table = table_of(["measured minus predicted", "bias", "rms", "max", "unit", "at line", "rows"])
    for row in found.coordinates:
        factor, unit = in_unit(row.unit)
        numbers = [four_digits(factor * value) for value in (row.bias, row.rms, row.max)]
        table.add_row(row.name, *numbers, unit, found.problem.data.place(row.row), str(row.rows))
    return table


def _errors(found: Comparison) -> Table:
    """rms errors overall and of each run, direction and region."""
    kinds = [k for k in KINDS if found.rms.get(k.key) is not None]
    table = table_of(["rms error", *(heading(k) for k in kinds), "rows"])
    _add(table, kinds, "all rows", found.rms, int(found.problem.use.sum()), "bold")
    if found.outliers.any():
        rows = int((found.problem.use & ~found.outliers).sum())
        _add(table, kinds, "without outliers", found.rms_without, rows)
    _add(table, kinds, "noise alone", found.floor, "", "dim")
    for title, groups in (
        ("run", found.runs),
        ("travel", found.directions),
        ("region", found.regions),
    ):
        if len(groups) > 1:
            for row in _biggest(groups):
                _add(table, kinds, f"{title} {row.name}", row.rms, row.rows)
            if len(groups) > _MOST:
                table.add_row(f"{len(groups) - _MOST} more with smaller errors", style="dim")
    return table


def _biggest(groups: Sequence[Group]) -> Sequence[Group]:
    """Those with the largest errors of the first kind that was read, where they are too many."""
    if len(groups) <= _MOST:
        return groups
    return sorted(groups, key=lambda g: -next((v for v in g.rms.values() if v), 0.0))[:_MOST]


def _add(
    table: Table, kinds: Sequence[Kind], name: str, rms: Rms, rows: int | str, style: str = ""
) -> None:
    table.add_row(Text(name), *(cell(k, rms) for k in kinds), str(rows), style=style)


def _print_associations(console: Console, found: Comparison) -> None:
    strong = [a for a in found.associations if a.significant]
    if not strong:
        say(
            console,
            ("The errors depend on nothing that was tested: position, time, tension, travel ..."),
        )
        return
    for row in strong[:4]:
        factor, unit = in_unit(row.unit)
        steps = [(b.label, factor * b.mean) for b in row.bins if b.mean is not None]
        means = ", ".join(f"{mean:.3g} at {label}" for label, mean in steps[:6])
        share = f"{100 * row.share:.0f} %"
        text = f"Errors by {row.against}, which explains {share} of their variance"
        if row.kind is QuantityKind.EVERYWHERE:
            text = f"The errors have a constant offset ({share} of their mean square)"
            means = f"{steps[0][1]:.3g}"
        say(console, f"{text}: {row.strongest} [{unit}] {means}")


def _print_worst(console: Console, found: Comparison) -> None:
    for row in found.worst[:_MOST_WORST]:
        parts = []
        for kind in KINDS:
            size = found.errors_of(kind.name)[row.row]
            if np.isfinite(size):
                parts.append(f"{four_digits(kind.factor * size)} {kind.unit}")
        say(
            console,
            f"worst: line {row.line}, run {row.run}, {found.place(row.row)}: {', '.join(parts)} "
            f"({row.times_noise:.3g} times the noise)",
        )
