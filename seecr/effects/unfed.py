"""Effects that do nothing because commands lack what they depend on: their times, temperatures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from seecr.commands import Commands
from seecr.effects.base import Effect

__all__ = ["unfed"]

# What commands may lack: as an effect names it, and its column in a file.
_COLUMNS = {"time": "t_s", "temperature": "temperature_C"}


def unfed(effects: Iterable[Effect], commands: Commands) -> tuple[str, ...]:
    """A sentence for each of some effects that is left out for want of times or temperatures."""
    return tuple(
        f"{effect.name} is left out: it needs the {need} of every command "
        f"(Commands.{need}, or column {column} of a file), and there is none"
        for effect in effects
        for need, column in _COLUMNS.items()
        if need in effect.needs and getattr(commands, need) is None and not _absent(effect)
    )


def _absent(effect: Effect) -> bool:
    """Whether an effect's values are those at which it is none."""
    own = [f for f in fields(effect) if "null" in f.metadata and not f.metadata["shape"]]
    values = [(getattr(effect, f.name), f.metadata["null"]) for f in own]
    return all(value is None or bool(np.all(value == null)) for value, null in values)
