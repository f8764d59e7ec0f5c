"""An effect with values of its own for each file or run.

A tracker that is set up anew every day, a platform that is placed by hand before each run: one
set of values would be wrong for all. In a model's file such an effect says ``per_file = true`` or
``per_run = true``; its own values stand with the names of the files or runs that they are of, and
those of no file in particular are what a further one is expected to have.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.effects.base import Effect, Layout, Readings
from seecr.effects.knowledge import Knowledge
from seecr.effects.setup import Setup
from seecr.effects.totals import Total
from seecr.errors import InputError
from seecr.pose import Array

KINDS = ("file", "run")
"""What an effect may have values of its own for."""


@dataclass(frozen=True, eq=False)
class Values:
    """An effect's parameters (p,) for one file or run, their standard errors and what is known."""

    vector: Array
    stderr: Array
    knowledge: Knowledge


@dataclass(frozen=True, eq=False)
class Own:
    """Values of an effect for each file or run that a model knows.

    Attributes:
        kind: "file" or "run". values: by their names.

    Raises:
        InputError: another kind.
    """

    kind: str
    values: Mapping[str, Values]

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            words = " or ".join(map(repr, KINDS))
            raise InputError(f"values of an effect's own are per {words}, got {self.kind!r}")


@dataclass(frozen=True, eq=False)
class Apart(Effect):
    """Effects of one kind for several files or runs.

    Where nobody takes rows apart it is what it is in ``rest``, which has no file in particular.
    """

    rest: Effect = field(default_factory=Effect)
    kind: str = "file"
    parts: Mapping[str, Effect] = field(default_factory=dict)

    def at(self, name: str) -> Effect:
        """The effect in a file or run."""
        return self.parts.get(name, self.rest)

    def edit_setup(self, setup: Setup) -> None:
        self.rest.edit_setup(setup)

    def edit_readings(self, readings: Readings, setup: Setup) -> None:
        self.rest.edit_readings(readings, setup)

    def totals(self, robot: Robot) -> dict[str, Total]:
        return {
            f"{name}: {key}": total
            for name, part in self.parts.items()
            for key, total in part.totals(robot).items()
        }


@dataclass(frozen=True, eq=False)
class ApartLayout(Layout):
    """The parameters of an effect for several files or runs, one after the other.

    Attributes:
        base: those of one. kind: "file" or "run". parts: names of the files or runs.
        rest: (p,) values wherever else.
    """

    base: Layout
    kind: str
    parts: tuple[str, ...]
    rest: Array

    @property
    def cable_by_cable(self) -> list[NDArray[np.intp]]:
        own = self.base.cable_by_cable
        return [k * len(self.base) + group for k in range(len(self.parts)) for group in own]

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        return {
            f"{part}: {whole}": tuple(f"{part}: {key}" for key in keys)
            for part in self.parts
            for whole, keys in self.base.groups.items()
        }

    def part(self, name: str) -> slice:
        """Where the parameters of a file or run stand."""
        first = self.parts.index(name) * len(self.base)
        return slice(first, first + len(self.base))

    def build(self, vector: Array) -> Effect:
        parts = {name: self.base.build(vector[self.part(name)]) for name in self.parts}
        return Apart(self.base.build(self.rest), self.kind, parts)

    def start(self, shape: dict[str, float]) -> Array:
        return np.tile(self.base.start(shape), len(self.parts))


def apart(base: Layout, kind: str, parts: tuple[str, ...], rest: Array) -> ApartLayout:
    """A layout for several files or runs; names of parameters begin with those of these."""

    def times(values: Any) -> Any:
        return np.tile(values, len(parts))

    return ApartLayout(
        base.effect,
        tuple(f"{part}: {key}" for part in parts for key in base.names),
        base.units * len(parts),
        times(base.null), times(base.lower), times(base.upper), times(base.scale),
        times(base.shape), (), base, kind, parts, rest,
    )  # fmt: skip
