"""A plan on the terminal and as JSON."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from crosscheck.fit.words import shown
from crosscheck.planning.design import Plan, Visible
from crosscheck.planning.proposer import Gain, Suggestion
from crosscheck.planning.visibility import LEVEL, POWER
from crosscheck.terminal.lines import console_for, say
from seecr.pose import rotvec_from_quat

_MOST_GAINS, _MOST_NAMES, _MOST_SLACK = 3, 4, 5


def size_words(found: Visible, factor: float) -> str:
    """Parameters at a multiple of their plausible sizes, such as "radius 0.3 mm"."""
    if not np.isfinite(factor):
        return "none"
    layout = found.signal.layout
    sizes = found.sizes(factor)
    parts = []
    for field in fields(layout.effect):
        unit = field.metadata["unit"]
        keys = [key for key in sizes if _belongs(key, field.name, unit)]
        if not keys or field.metadata["shape"]:
            continue
        null = float(field.metadata["null"])
        size = shown(sizes[keys[0]], unit)
        start = f"{null:g} +- " if null else ""
        parts.append(f"{field.name} {start}{size}{' each' if len(keys) > 1 else ''}")
    return ", ".join(parts)


def _belongs(key: str, name: str, unit: str) -> bool:
    stem = key.removesuffix(f"_{unit}") if unit else key
    return stem == name or (stem.startswith(f"{name}_") and len(stem) > len(name) + 1)


def print_plan(plan: Plan, out: Path, console: Console | None = None) -> None:
    """Print what will show, what cannot be told apart, and what to add."""
    console = console_for(console)
    for note in plan.notes:
        say(console, f"note: {note}", "dim")
    if plan.effects:
        console.print(_table(plan))
    for name, why in plan.missing.items():
        say(console, f"{name}: not with these data: {why.words}", "dim")
    _print_slack(console, plan)
    say(console, plan.sentence, "bold")
    for suggestion in plan.suggestions:
        _print_suggestion(console, suggestion)
    say(console, f"Results in {out}/", "dim")


def _table(plan: Plan) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in ("effect", "smallest size that shows", "and can be named", "cannot be told from"):
        table.add_column(head)
    for found in plan.effects:
        named = "-" if found.twins else size_words(found, found.identifiable)
        style = "" if found.visible else "dim"
        table.add_row(found.name, size_words(found, found.factor), named, alike(found), style=style)
    return table


def alike(found: Visible) -> str:
    """Effects that it cannot be told from, exact ones first."""
    names = [f"{name} (exactly)" for name in found.twins]
    names += [name for name, _left in found.confused]
    if not found.visible and not found.twins:
        return "(a plausible size does not show)"
    rest = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + rest


def _print_slack(console: Console, plan: Plan) -> None:
    if not plan.slack:
        return
    some = ", ".join(f"line {line} ({cable})" for line, cable in plan.slack[:_MOST_SLACK])
    rest = len(plan.slack) - _MOST_SLACK
    more = f" and {rest} more" if rest > 0 else ""
    say(
        console,
        f"About to go slack or taut: {some}{more}. Small errors change which cables pull there, "
        "and what is said here of such poses is less sure.",
        "bold yellow",
    )


def _print_suggestion(console: Console, item: Suggestion) -> None:
    reached = item.reached
    if not reached:
        return
    words = "; ".join(gain_words(g) for g in reached[:_MOST_GAINS])
    more = f"; and {len(reached) - _MOST_GAINS} more" if len(reached) > _MOST_GAINS else ""
    say(console, f"add: {item.words}: {words}{more}")
    for pose in item.poses if item.poses is not None else ():
        turn = np.degrees(rotvec_from_quat(pose[3:]))
        x, y, z = pose[:3]
        say(
            console,
            f"     ({x:.4g} {y:.4g} {z:.4g}) m, turned by ({turn[0]:.3g} {turn[1]:.3g} "
            f"{turn[2]:.3g}) deg",
        )


def gain_words(gain: Gain) -> str:
    """What a measurement would bring, with numbers."""
    numbers = f"(signal now {gain.now:.2g}, then {gain.then:.2g}, needs {gain.needed:.2g})"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"shows {gain.effect} {numbers}"


def plan_json(plan: Plan) -> dict[str, Any]:
    """The content of ``plan.json``, SI."""
    problem = plan.planned.problem
    names, table = plan.confusion
    return {
        "sentence": plan.sentence,
        "robot": problem.robot.name,
        "poses": str(problem.data.path),
        "rows": {"all": problem.data.n_rows, "used": int(problem.use.sum())},
        "sigma": vars(problem.sigma),
        "level": LEVEL,
        "power": POWER,
        "effects": [_effect(v) for v in plan.effects],
        "not_with_these_data": {name: why.words for name, why in plan.missing.items()},
        "confusion": {"effects": list(names), "containment": table},
        "add": [_suggestion(s) for s in plan.suggestions],
        "near_slack": [{"line": line, "cable": cable} for line, cable in plan.slack],
        "notes": list(plan.notes),
    }


def _effect(found: Visible) -> dict[str, Any]:
    return {
        "effect": found.name,
        "visible": found.visible,
        "plausible": found.sizes(1.0),
        "smallest_visible": found.sizes(found.factor),
        "smallest_visible_in_plausible_sizes": found.factor,
        "words": size_words(found, found.factor),
        "smallest_identifiable": None if found.twins else found.sizes(found.identifiable),
        "best_imitator": found.imitator or None,
        "cannot_be_told_from": [
            *({"effect": name, "exact": True, "signal": 0.0} for name in found.twins),
            *({"effect": n, "exact": False, "signal": left} for n, left in found.confused),
        ],
        "signal": found.signal.power,
        "needed": found.needed,
        "shape": found.signal.shape,
    }


def _suggestion(item: Suggestion) -> dict[str, Any]:
    return {
        "kind": item.kind,
        "words": item.words,
        "poses": item.poses,
        "gains": [{**vars(g), "enough": g.then >= g.needed} for g in item.gains],
    }
