"""The suite's results as ``summary.md``, for the step summary of continuous integration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from crosscheck.suite.effects import (
    EFFECT_HEADS,
    against_line,
    effect_cells,
    effect_failures,
    effects_line,
)
from crosscheck.suite.results import (
    TABLE_HEADS,
    case_cells,
    failure_lines,
    finding_lines,
    widened_lines,
)
from crosscheck.suite.run import threshold_cells, verdict_line

if TYPE_CHECKING:
    from crosscheck.suite.results import CaseResult
    from crosscheck.suite.run import Run


def summary_md(run: Run, worst_pose: str) -> str:
    """The verdict, a table of the cases, then failures, findings, widened thresholds, effects.

    Args:
        run: the run.
        worst_pose: sentence about the file with the worst pose.
    """
    parts = ["# SEECR against MuJoCo", verdict_line(run)]
    if run.results:
        parts += _cases(run, worst_pose)
    parts += [f"Note: {note}." for note in run.notes]
    if run.effects:
        parts += _effects(run)
    parts.append(
        f"{run.wall_s:.1f} s with {run.jobs} at a time; random numbers of seed {run.seed}."
    )
    return "\n\n".join(parts) + "\n"


def _cases(run: Run, worst_pose: str) -> list[str]:
    parts = [
        _table(run),
        "Largest differences between SEECR and MuJoCo over each case's poses. `settled`: MuJoCo "
        "brought to rest by its own dynamics; `polished` and tensions: after Newton's method on "
        f"its inverse dynamics. Times are per pose, on one processor. {worst_pose}",
    ]
    parts += _section(run, "Failures", failure_lines)
    parts += _section(run, "Findings", finding_lines)
    parts += _section(run, "Widened thresholds", widened_lines)
    return parts


def _effects(run: Run) -> list[str]:
    """How the effects ended, which failed, and a folded table of all."""
    heads = EFFECT_HEADS
    rule = ["---", "---", *["---:"] * (len(heads) - 4), "---", "---"]
    table = "\n".join(_row(row) for row in [heads, rule, *map(effect_cells, run.effects)])
    failed = [f"- {line}" for line in effect_failures(run.effects)]
    return [
        "## Effects",
        effects_line(run.effects),
        against_line(run.effects),
        *(["\n".join(failed)] if failed else []),
        f"<details><summary>All {len(run.effects)}</summary>\n\n{table}\n\n</details>",
    ]


def _table(run: Run) -> str:
    heads = TABLE_HEADS
    rule = ["---", *["---:"] * (len(heads) - 3), "---", "---"]
    rows = [heads, rule, *(case_cells(r) for r in run.results), threshold_cells(run)]
    return "\n".join(_row(row) for row in rows)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _section(run: Run, title: str, lines: Callable[[CaseResult], list[str]]) -> list[str]:
    """A heading and, case by case, folded lists; empty if there are no items."""
    found = [(result, lines(result)) for result in run.results]
    blocks = [
        f"<details><summary>{result.case.name}: {len(items)}</summary>\n\n"
        + "\n".join(f"- {item}" for item in items)
        + "\n\n</details>"
        for result, items in found
        if items
    ]
    return [f"## {title}", *blocks] if blocks else []
