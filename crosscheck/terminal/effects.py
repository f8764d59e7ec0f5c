"""The catalogue of effects on the terminal."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from rich.table import Table

from crosscheck.fit.words import belongs, shown
from crosscheck.terminal.lines import console_for, say
from seecr.description.robot import Robot
from seecr.effects import BUILT_IN, PLACES, Effect, effect_named, layout_of
from seecr.result import Record
from seecr.units import in_unit, parameter_name

EACH = {"one": "", "cable": ", one per cable", "vector": ", x y z", "point": ", x y z per cable"}
"""What a parameter's size says in words."""


def effect_record(effect: type[Effect], robot: Robot | None) -> Record:
    """An effect as JSON, SI; the parameters' limits and plausible sizes where there is a robot."""
    return {
        "effect": effect.name,
        "place": effect.place,
        "title": effect.title,
        "own": effect not in BUILT_IN,
        "needs": list(effect.needs),
        "formula": inspect.getdoc(effect) or "",
        "check": effect.by_hand(),
        "parameters": _parameters(effect, robot),
    }


def _parameters(effect: type[Effect], robot: Robot | None) -> list[Record]:
    if robot is None:
        return [_parameter(f.name, f.metadata) for f in fields(effect)]
    layout = layout_of(effect, robot)
    words = [size_words(f.metadata) for f in fields(effect) for _ in range(layout.count(f.name))]
    rows = zip(
        layout.names, layout.units, layout.null.tolist(), layout.lower.tolist(),
        layout.upper.tolist(), layout.scale.tolist(), layout.shape.tolist(), words, strict=True,
    )  # fmt: skip
    keys = (
        "name", "unit", "absent", "lower", "upper", "plausible_size", "shapes_the_others",
        "plausible_size_words",
    )  # fmt: skip
    return [dict(zip(keys, row, strict=True)) for row in rows]


def _parameter(name: str, metadata: Mapping[str, Any]) -> Record:
    """A parameter of any robot; no number where its plausible size depends on the robot."""
    scale = metadata["scale"]
    return {
        "name": name,
        "unit": metadata["unit"],
        "each": metadata["size"],
        "absent": metadata["null"],
        "plausible_size": None if callable(scale) else scale,
        "shapes_the_others": metadata["shape"],
        "plausible_size_words": size_words(metadata),
    }


def size_words(metadata: Mapping[str, Any]) -> str:
    """A parameter's plausible size in words: a number with its unit, or a formula of the robot."""
    scale = metadata["scale"]
    if callable(scale):
        return str(getattr(scale, "words", "depends on the robot"))
    factor, unit = in_unit(metadata["unit"])
    return f"{factor * scale:.3g} {unit}".strip()


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
    own = "" if effect in BUILT_IN else ", your own"
    say(console, f"{effect.name}: {effect.title} ({effect.place}{own})", "bold")
    for line in (inspect.getdoc(effect) or "").splitlines():
        say(console, line)
    for line in _plain_sizes(effect) if robot is None else _sizes_for(effect, robot):
        say(console, f"  {line}")
    if effect.needs:
        say(console, f"needs: {', '.join(effect.needs)}")
    say(console, f"check by hand: {effect.by_hand()}")


def _plain_sizes(effect: type[Effect]) -> Iterator[str]:
    """A line for each parameter of any robot, with its plausible size or a formula of that."""
    of_robot = False
    for item in fields(effect):
        meta = item.metadata
        factor, unit = in_unit(meta["unit"])
        null = f"{factor * meta['null']:.4g}"
        words = f"absent at {null}, plausible size {size_words(meta)}"
        if meta["shape"]:
            words = f"modifies the others, starts at {null}"
        of_robot |= callable(meta["scale"]) and not meta["shape"]
        yield f"{item.name} [{unit or 'no unit'}]{EACH[meta['size']]}: {words}"
    if of_robot:
        yield "plausible sizes depend on the robot: --robot ROBOT.xml gives their numbers"


def _sizes_for(effect: type[Effect], robot: Robot) -> Iterator[str]:
    """A line for each parameter of a robot, with its plausible size."""
    layout = layout_of(effect, robot)
    for name, si, null, scale, upper, shape in zip(
        layout.names, layout.units, layout.null, layout.scale, layout.upper, layout.shape,
        strict=True,
    ):  # fmt: skip
        factor, unit = in_unit(si)
        size, absent = factor * scale, factor * null
        words = f"absent at {absent:.4g}, plausible size {size:.3g} {unit}"
        if np.isfinite(upper):
            words = f"{words.rstrip()}, at most {factor * upper:.4g} {unit}"
        if shape:
            words = f"modifies the others, starts at {absent:.3g} {unit}"
        yield f"{parameter_name(name, si)}: {words}".rstrip()
