"""A diagnosis on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from crosscheck.diagnosis.result import PROBABLE, MissingEffect, NotListed
from crosscheck.diagnosis.words import equals_of, probability_name, within_words
from crosscheck.fit.reasons import DiagnosisVerdict, Why, probability_words
from crosscheck.terminal.lines import console_for, print_parameters, rms_table, say
from seecr.counted import counted

if TYPE_CHECKING:
    from crosscheck.diagnosis.result import Diagnosis

_STYLE = {
    DiagnosisVerdict.NO_EFFECT_MISSING: "green",
    DiagnosisVerdict.EFFECTS_FOUND: "bold cyan",
    DiagnosisVerdict.MANY_EFFECTS: "bold magenta",
    DiagnosisVerdict.UNKNOWN_EFFECT: "bold yellow",
    DiagnosisVerdict.NO_VERDICT: "bold red",
}
_MOST_CANDIDATES, _MOST_PARAMETERS = 6, 9


def print_diagnosis(found: Diagnosis, out: Path, console: Console | None = None) -> None:
    """Print the verdict, the errors on the way, the parameters, and what to measure next."""
    console = console_for(console)
    for line in found.sight.lines() if found.sight is not None else ():
        say(console, line, "dim")
    say(console, f"{found.verdict}: {found.reason}", _STYLE[found.verdict])
    for note in found.notes:
        say(console, f"note: {note}", "dim")
    if found.verdict is not DiagnosisVerdict.NO_VERDICT:
        console.print(_way(found))
        if found.left is not None:
            say(console, f"error beyond the noise: {found.left.words}", "dim")
        if found.chances is not None and found.chances.words:
            say(console, f"note: {found.chances.words}", "dim")
        for finding in found.missing:
            _print_finding(console, finding, probability_name(found))
        if within := within_words(found):
            say(console, f"note: {within}", "dim")
        _print_candidates(console, found)
        for line in equals_of(found):
            say(console, line, "dim")
    for line in found.measure_further:
        say(console, f"measure next: {line}")
    say(console, f"Results in {out}/ (open diagnosis.html)", "dim")


def _way(found: Diagnosis) -> Table:
    rows = [("before", found.before, "")]
    for finding in found.missing:
        rows.append((f"+ {finding.effect}", finding.rms, ""))
        rows.append(("  on held-out runs", finding.held_out_rms, "dim"))
    return rms_table([*rows, ("noise alone", found.floor, "dim")])


def _print_finding(console: Console, finding: MissingEffect, probability: str) -> None:
    likely = probability_words(finding.probability)
    say(console, f"{finding.effect}: {finding.title} ({probability} {likely})", "bold")
    print_parameters(
        console, finding.layout, finding.values, finding.stderr, finding.at_bound,
        _MOST_PARAMETERS, "diagnosis.json",
    )  # fmt: skip
    if finding.rivals:
        names = ", ".join(finding.indistinguishable)
        say(console, f"  indistinguishable from: {names}")
    say(console, f"  check: {finding.check}")


def _print_candidates(console: Console, found: Diagnosis) -> None:
    # what the user left out need not be said
    rows = [row for row in found.candidates if row.why_not.why is not Why.EXCLUDED]
    for row in rows[:_MOST_CANDIDATES]:
        say(console, f"not {row.effect}: {row.why_not}{_all_the_same(found, row)}", "dim")
    if len(rows) > _MOST_CANDIDATES:
        say(console, _others(found, rows[_MOST_CANDIDATES:]), "dim")


def _all_the_same(found: Diagnosis, row: NotListed) -> str:
    """That an effect is probable, where its reason has it listed no more and does not say so."""
    chance = 0.0 if found.chances is None else found.chances.effect.get(row.effect, 0.0)
    if chance < PROBABLE or "{chance}" in row.why_not.why.value:
        return ""
    return f" ({probability_name(found)} {probability_words(chance)})"


def _others(found: Diagnosis, rows: Sequence[NotListed]) -> str:
    """How probable the effects are that are not printed, the probable ones by name."""
    chances = {} if found.chances is None else found.chances.effect
    likely = {row.effect: chances[row.effect] for row in rows if row.effect in chances}
    named = sorted((p, name) for name, p in likely.items() if p >= PROBABLE)[::-1]
    rest = [p for p in likely.values() if p < PROBABLE]
    said = [f"{name} {probability_words(p)}" for p, name in named]
    if rest:
        said.append(f"{'others ' if named else ''}{probability_words(max(rest))} or less")
    of = f" ({probability_name(found)}: {', '.join(said)})" if named else ""
    most = f" (probability {said[0]})" if said and not named else of
    return f"nor {counted(len(rows), 'other')}{most}: see candidates in diagnosis.json"
