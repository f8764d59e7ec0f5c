"""The catalogue of effects on the terminal."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from crosscheck.fit.words import belongs
from crosscheck.show.blocks import Block, Items, Line, TextTable
from crosscheck.show.texts import printed
from seecr.description.robot import Robot
from seecr.effects import BUILT_IN, PLACES, Effect, known, layout_of
from seecr.result import Record, rows_of
from seecr.units import in_unit, parameter_name, shown

EACH = {
    "one": "", "cable": ", one per cable", "spring": ", one per cable", "vector": ", x y z",
    "point": ", x y z per cable",
}  # fmt: skip
"""What a parameter's size says in words."""


def effect_record(effect: type[Effect], robot: Robot | None) -> Record:
    """An effect as JSON, SI; the parameters' limits and expected sizes where there is a robot."""
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
    return rows_of({
        "name": layout.names, "unit": layout.units, "absent": layout.null, "lower": layout.lower,
        "upper": layout.upper, "plausible_size": layout.scale, "shapes_the_others": layout.shape,
        "plausible_size_words": words,
    })  # fmt: skip


def _parameter(name: str, metadata: Mapping[str, Any]) -> Record:
    """A parameter of any robot; no number where its expected size depends on the robot."""
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
    """A parameter's expected size in words: a number with its unit, or a formula of the robot."""
    scale = metadata["scale"]
    if callable(scale):
        return str(getattr(scale, "words", "depends on the robot"))
    factor, unit = in_unit(metadata["unit"])
    return f"{factor * scale:.3g} {unit}".strip()


def parameter_lines(name: str, values: Mapping[str, float]) -> list[str]:
    """An effect's values by its parameters' names, SI, in the units that people read."""
    effect = known().get(name)
    if effect is None:  # of a file that was not named
        return [f"{key} = {shown(value, '')}" for key, value in values.items()]
    own = [(f.name, f.metadata["unit"]) for f in fields(effect)]
    out = []
    for key, value in values.items():
        unit = next(unit for field, unit in own if belongs(key, field, unit))
        out.append(f"{parameter_name(key, unit)} = {shown(value, unit)}")
    return out


@printed
def print_effects(effects: list[type[Effect]]) -> Iterator[Block]:
    """A table of effects: name, place, what each is."""
    rows = [
        [effect.name, place, effect.title + ("" if effect in BUILT_IN else " (own)")]
        for place in PLACES
        for effect in effects
        if effect.place == place
    ]
    yield TextTable(["effect", "where", "what it is"], rows)


@printed
def print_effect(effect: type[Effect], robot: Robot | None) -> Iterator[Block]:
    """One effect: formula, parameters, what it needs, how to check it by hand."""
    own = "" if effect in BUILT_IN else ", your own"
    record = effect_record(effect, robot)
    rows = record["parameters"]
    yield Line(f"{effect.name}: {effect.title} ({effect.place}{own})", "bold")
    yield Items(record["formula"].splitlines())
    yield Items([_parameter_words(row) for row in rows], "  ")
    sizes = [row["plausible_size"] for row in rows if not row["shapes_the_others"]]
    if None in sizes:
        yield Line("  expected sizes depend on the robot: --robot ROBOT.xml gives their numbers")
    if effect.needs:
        yield Line(f"needs: {', '.join(effect.needs)}")
    yield Line(f"check by hand: {effect.by_hand()}")


def _parameter_words(row: Record) -> str:
    """A parameter of any robot, or of one, with its expected size."""
    factor, unit = in_unit(row["unit"])
    of_one = "each" not in row
    words = f"absent at {factor * row['absent']:.4g}, expected size "
    words += (
        f"{factor * row['plausible_size']:.3g} {unit}" if of_one else row["plausible_size_words"]
    )
    if np.isfinite(row.get("upper", np.inf)):
        words = f"{words.rstrip()}, at most {factor * row['upper']:.4g} {unit}"
    if row["shapes_the_others"]:
        words = f"modifies the others, starts at {factor * row['absent']:.4g} {unit * of_one}"
    if of_one:
        return f"{parameter_name(row['name'], row['unit'])}: {words}".rstrip()
    return f"{row['name']} [{unit or 'no unit'}]{EACH[row['each']]}: {words}".rstrip()
