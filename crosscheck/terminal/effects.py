"""The catalogue of effects on the terminal."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from rich.table import Table

from crosscheck.fit.words import belongs, shown
from crosscheck.terminal.lines import console_for, say
from crosscheck.units import in_unit, parameter_name
from seecr.effects import BUILT_IN, PLACES, Effect, effect_named, layout_of
from seecr.robot import Robot


def effect_record(effect: type[Effect], robot: Robot | None) -> dict[str, Any]:
    """An effect as JSON, SI; the parameters' limits and plausible sizes where there is a robot."""
    return {
        "effect": effect.name,
        "place": effect.place,
        "title": effect.title,
        "own": effect not in BUILT_IN,
        "needs": list(effect.needs),
        "formula": inspect.getdoc(effect) or "",
        "check": effect.advice.split(":")[0],
        "parameters": _parameters(effect, robot),
    }


def _parameters(effect: type[Effect], robot: Robot | None) -> list[dict[str, Any]]:
    if robot is None:
        return [
            {"name": f.name, "unit": f.metadata["unit"], "each": f.metadata["size"]}
            for f in fields(effect)
        ]
    layout = layout_of(effect, robot)
    rows = zip(
        layout.names, layout.units, layout.null.tolist(), layout.lower.tolist(),
        layout.upper.tolist(), layout.scale.tolist(), layout.shape.tolist(), strict=True,
    )  # fmt: skip
    keys = ("name", "unit", "absent", "lower", "upper", "plausible_size", "shapes_the_others")
    return [dict(zip(keys, row, strict=True)) for row in rows]


def parameter_lines(name: str, values: Mapping[str, float]) -> list[str]:
    """An effect's values by its parameters' names, SI, in the units that people read."""
    own = [(f.name, f.metadata["unit"]) for f in fields(effect_named(name))]
    out = []
    for key, value in values.items():
        unit = next(unit for field, unit in own if belongs(key, field, unit))
        out.append(f"{parameter_name(key, unit)} = {shown(value, unit)}")
    return out


def print_effects(effects: list[type[Effect]]) -> None:
    """A table of effects: name, place, what each is."""
    console = console_for(None)
    table = Table(box=None, pad_edge=False)
    for heading in ("effect", "where", "what it is"):
        table.add_column(heading)
    for place in PLACES:
        for effect in effects:
            if effect.place == place:
                own = "" if effect in BUILT_IN else " (own)"
                table.add_row(effect.name, place, effect.title + own)
    console.print(table)


def print_effect(effect: type[Effect], robot: Robot | None) -> None:
    """One effect: formula, parameters, what it needs, how to check it by hand."""
    console = console_for(None)
    about = effect_record(effect, robot)
    own = ", of your own" if about["own"] else ""
    say(console, f"{effect.name}: {effect.title} ({effect.place}{own})", "bold")
    for line in about["formula"].splitlines():
        say(console, line)
    for row in about["parameters"]:
        if robot is None:
            each = {"one": "", "cable": ", one a cable", "vector": ", x y z"}.get(
                row["each"], ", x y z a cable"
            )
            say(console, f"  {row['name']} [{row['unit'] or 'no unit'}]{each}")
            continue
        factor, unit = in_unit(row["unit"])
        size, absent = factor * row["plausible_size"], factor * row["absent"]
        words = f"absent at {absent:.4g}, plausible size {size:.3g} {unit}"
        if row["shapes_the_others"]:
            words = f"shapes the others, from {absent:.3g} {unit}"
        say(console, f"  {parameter_name(row['name'], row['unit'])}: {words}".rstrip())
    if about["needs"]:
        say(console, f"needs: {', '.join(about['needs'])}")
    say(console, f"check by hand: {about['check']}")
