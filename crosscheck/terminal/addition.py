"""The fit of an effect, on the terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from crosscheck.add import Addition
from crosscheck.model.fitted import Fitted
from crosscheck.terminal.lines import console_for, print_parameters, rms_table, say

_MOST = 12


def print_addition(
    found: Addition, model: Path, written: bool, console: Console | None = None
) -> None:
    """Print values, errors before and after, warnings, and what was written."""
    console = console_for(console, found.notes)
    for fitted in found.fitted:
        _print_values(console, fitted)
    console.print(_table(found))
    for warning in found.warnings:
        say(console, f"warning: {warning}", "bold yellow")
    say(console, f"With {found.name}, {_left(found)}.", "green" if found.is_noise else "")
    if not found.pays:
        say(console, why_not(found, written), "bold yellow")
    if written:
        say(console, f"Written to {model}: {', '.join(f.term.name for f in found.fitted)}")


def why_not(found: Addition, forced: bool = False) -> str:
    """Why an effect is not worth adding, and that --force adds it, or has added it."""
    then = "added because of --force" if forced else "--force adds it anyway"
    return f"{found.why_not}: it is not worth adding; {then}"


def _left(found: Addition) -> str:
    if found.coloured is not None:
        may = "may be" if found.is_open else "are"
        return f"the residuals {may} noise ({found.coloured.words})"
    if found.is_noise:
        return "the residuals are noise"
    return (
        f"the residuals are {found.whiteness.scale:.3g} times the noise: find what else is "
        "missing with crosscheck diagnose"
    )


def _print_values(console: Console, fitted: Fitted) -> None:
    layout = fitted.term.layout
    say(console, f"{layout.name}: {layout.effect.title}", "bold")
    print_parameters(
        console, layout, fitted.term.vector, fitted.stderr, fitted.at_bound, _MOST, "the model"
    )


def _table(found: Addition) -> Table:
    rows = (
        ("before", found.before, ""),
        (f"with {found.name}", found.after, "bold"),
        (f"without {found.name}, on held-out runs", found.held_out_before, "dim"),
        (f"with {found.name}, on held-out runs", found.held_out, ""),
    )
    return rms_table(rows)
