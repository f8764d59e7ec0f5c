"""A diagnosis on the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.diagnosis import Finding, Rms

if TYPE_CHECKING:
    from crosscheck.diagnosis import Diagnosis

_STYLE = {
    "no_effect_missing": "green",
    "effects_found": "bold cyan",
    "unknown_effect": "bold yellow",
    "no_verdict": "bold red",
}
# How a parameter is shown: factor and unit for people.
_SHOWN = {"m": (1e3, "mm"), "rad": (180.0 / np.pi, "deg"), "m_per_N": (1e3, "mm/N")}
_MOST_CANDIDATES, _MOST_PARAMETERS = 6, 9


def shown(value: float, unit: str) -> str:
    """A number with its unit as people read it."""
    factor, word = _SHOWN.get(unit, (1.0, unit.replace("_per_", "/")))
    return f"{factor * value:.4g} {word}".strip()


def print_diagnosis(found: Diagnosis, out: Path, console: Console | None = None) -> None:
    """Print the verdict, the errors on the way, the parameters, and what to measure next."""
    console = console or Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, 160)
    say(console, f"{found.verdict}: {found.sentence}", _STYLE[found.verdict])
    for note in found.notes:
        say(console, f"note: {note}", "dim")
    if found.verdict != "no_verdict":
        console.print(_way(found))
        for finding in found.missing:
            _print_finding(console, finding)
        _print_candidates(console, found)
    for line in found.measure_next:
        say(console, f"next: {line}")
    say(console, f"Results in {out}/ (open diagnosis.html)", "dim")


def say(console: Console, line: str, style: str = "") -> None:
    """One line, never broken: people search and pipe them."""
    console.print(Text(line, style=style), soft_wrap=True)


def _way(found: Diagnosis) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in ("rms error", "position\n[mm]", "orientation\n[deg]", "tension\n[N]"):
        table.add_column(head, justify="left" if head == "rms error" else "right")
    table.add_row("as it stands", *_cells(found.before))
    for finding in found.missing:
        table.add_row(f"+ {finding.effect}", *_cells(finding.rms))
        table.add_row("  on runs left out", *_cells(finding.held_out_rms), style="dim")
    table.add_row("noise alone", *_cells(found.floor), style="dim")
    return table


def _cells(rms: Rms) -> list[str]:
    keys = (("position_rms_m", 1e3), ("orientation_rms_rad", 180.0 / np.pi), ("tension_rms_N", 1.0))
    cells = []
    for key, factor in keys:
        value = rms.get(key)
        cells.append("-" if value is None else f"{factor * value:.4g}")
    return cells


def _print_finding(console: Console, finding: Finding) -> None:
    say(console, f"{finding.effect}: {finding.title}", "bold")
    rows = list(
        zip(
            finding.layout.names, finding.layout.units, finding.values, finding.stderr,
            finding.at_bound, strict=True,
        )
    )  # fmt: skip
    for name, unit, value, error, bound in rows[:_MOST_PARAMETERS]:
        spread = f"+- {shown(error, unit)}" if np.isfinite(error) else "not seen by these data"
        stop = " (at its bound)" if bound else ""
        say(console, f"  {name.removesuffix('_' + unit)} = {shown(value, unit)} {spread}{stop}")
    if len(rows) > _MOST_PARAMETERS:
        say(console, f"  and {len(rows) - _MOST_PARAMETERS} more in diagnosis.json")
    if finding.rivals:
        names = ", ".join(rival.name for rival in finding.rivals)
        say(console, f"  cannot be told from: {names}")
    say(console, f"  check: {finding.check}")


def _print_candidates(console: Console, found: Diagnosis) -> None:
    for row in found.candidates[:_MOST_CANDIDATES]:
        say(console, f"not {row['effect']}: {row['why_not']}", "dim")
