"""Texts of a diagnosis's recording, in Markdown: the verdict, each model, each pose."""

from __future__ import annotations

import numpy as np

from crosscheck.diagnosis.path import Stage
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.words import removed
from crosscheck.recording import misfit, words
from crosscheck.recording.misfit import Misfit
from crosscheck.recording.words import plain
from seecr.units import in_unit, parameter_name, short, with_error

_MOST_PARAMETERS, _MOST_CANDIDATES, _MOST_LISTED = 9, 6, 6

_PLAY = """
**Scene.** {arrows} Blue box and cables: the model at the worst pose; orange edges: what was \
measured there.

**Play.** `model_step` goes from the model as it stood through the effects added. `pose` (choose \
it at the bottom left) goes through the measured poses: orange edges measured, blue the last \
model, pink edges the first.
"""


def verdict_words(found: Diagnosis, shown: Misfit | None) -> str:
    """The verdict, what to measure next, what was assumed, and how to read the views."""
    parts = [f"# {found.verdict.heading}\n{plain(found.reason)}\n"]
    if shown is not None:
        parts.append(_PLAY.format(arrows=misfit.misfit_words(shown)))
    parts += _listed("What to measure next", list(found.measure_further))
    parts += _listed("Notes", list(found.notes))
    return "\n".join(parts)


def _listed(title: str, lines: list[str]) -> list[str]:
    if not lines:
        return []
    shown = [f"- {plain(line)}" for line in lines[:_MOST_LISTED]]
    if len(lines) > _MOST_LISTED:
        shown.append(f"- and {len(lines) - _MOST_LISTED} more in diagnosis.json")
    return ["\n".join([f"## {title}", *shown, ""])]


def model_words(found: Diagnosis, stages: list[Stage], k: int, shown: Misfit, worst: int) -> str:
    """One model: its errors, and its last effect."""
    stage = stages[k]
    head = f"## Step {k} of {len(stages) - 1}: {plain(stage.label)}\n"
    parts = [head, _errors(found, stage, shown)]
    finding = next((f for f in found.missing if f.effect == stage.added), None)
    if finding is not None:
        parts.append(_finding(finding))
    elif found.candidates and len(stages) == 1:
        parts.append(_candidates(found))
    line = int(shown.problem.data.line[worst])
    parts.append(f"\nThe box shows the worst pose, line {line} of the data.")
    return "\n".join(parts)


def _errors(found: Diagnosis, stage: Stage, shown: Misfit) -> str:
    fitted = stage.rms
    values = [
        (stage.held_out.rms[kind.key], fitted[kind.key], found.floor.get(kind.key) or 0.0)
        for kind in shown.kinds
    ]
    return words.errors(shown.kinds, values, ("held-out runs", "fitted runs", "noise"))


def _finding(finding: MissingEffect) -> str:
    rows = []
    layout = finding.layout
    for name, unit, value, error in zip(
        layout.names, layout.units, finding.values, finding.stderr, strict=True
    ):
        factor, word = in_unit(unit)
        shown, spread = with_error(factor * float(value), factor * float(error))
        spread = f"± {spread}" if np.isfinite(error) else spread
        rows.append((plain(parameter_name(name, unit)), f"{shown} {spread} {word}".strip()))
    lines = [
        f"\nIt {removed(finding.share)}: {plain(finding.title)}.\n",
        words.table(rows[:_MOST_PARAMETERS], ("parameter", "value")),
    ]
    if len(rows) > _MOST_PARAMETERS:
        lines.append(f"\nand {len(rows) - _MOST_PARAMETERS} more in diagnosis.json")
    if finding.rivals:
        names = ", ".join(plain(rival.name) for rival in finding.rivals)
        lines.append(f"\nIndistinguishable from: {names}.")
    lines.append(f"\n**Check:** {plain(finding.check)}.")
    return "\n".join(lines)


def _candidates(found: Diagnosis) -> str:
    rows = [
        (plain(row.effect), plain(str(row.why_not))) for row in found.candidates[:_MOST_CANDIDATES]
    ]
    return "\n" + words.table(rows, ("tried", "why not listed"))


def pose_words(stages: list[Stage], shown: Misfit, k: int) -> str:
    """The numbers of one row under the first and the last model."""
    data = shown.problem.data
    head = words.row_heading(data, k)
    if not shown.problem.use[k]:
        return head + words.unused(data, k)
    ends = stages if len(stages) < 2 else [stages[0], stages[-1]]
    rows = []
    for kind in shown.kinds:
        values = [kind.factor * float(kind.sizes(shown.problem, s.state.raw)[k]) for s in ends]
        rows.append((f"{kind.name} error [{kind.unit}]", *(short(v) for v in values)))
    return head + "\n" + words.table(rows, ("", *(plain(s.label) for s in ends)))
