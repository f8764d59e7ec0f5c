"""A calibrated model, on the terminal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from crosscheck.calibration import Calibrated
from crosscheck.model.fitted import Fitted
from crosscheck.terminal.lines import console_for, rms_table, say, table_of
from seecr.counted import counted

# A value this many standard errors from null is sure.
_SURE = 3.0
_UNSURE = (
    f"No single effect differs from null by {_SURE:g} standard errors: others can replace each of "
    "them, and only together they predict; crosscheck diagnose finds which are missing"
)


def print_calibration(
    found: Calibrated, model: Path, written: bool, console: Console | None = None
) -> None:
    """Print the errors, how far each effect is from nothing, the noise, and what was written."""
    console = console_for(console, found.notes)
    rows = (
        ("before", found.before, ""),
        ("calibrated", found.after, "bold"),
        ("calibrated, on held-out runs", found.held_out, ""),
    )
    console.print(rms_table(rows))
    table = table_of(["effect", "parameters", "largest value in standard errors"])
    largest = [_largest(one) for one in found.fitted]
    for one, size in zip(found.fitted, largest, strict=True):
        cell = "-" if size is None else f"{size:.1f}"
        table.add_row(one.term.name, str(len(one.term.layout)), cell)
    console.print(table)
    if not any(size is not None and size > _SURE for size in largest):
        say(console, _UNSURE)
    for line in found.noise_lines():
        say(console, line)
    for line in found.absent_lines():
        say(console, line, "dim")
    if not found.settled:
        say(console, "The fit did not converge: do not use its values.", "bold yellow")
    elif not found.pays:
        then = "" if written else ": not written; --force writes it"
        say(console, f"The prediction of held-out runs does not improve{then}", "bold yellow")
    if written:
        parts = (
            f"{counted(len(found.fitted), 'effect')}, {counted(len(found.covariance), 'parameter')}"
        )
        say(console, f"Written to {model}: {parts}, with their covariance")


def _largest(one: Fitted) -> float | None:
    """The value that stands out most from null, in standard errors; None where none is seen."""
    away = np.abs(one.term.vector - one.term.layout.null)
    seen = (one.stderr > 0.0) & np.isfinite(one.stderr)
    return float(np.max(away[seen] / one.stderr[seen])) if seen.any() else None
