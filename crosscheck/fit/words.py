"""Errors and fitted values in words, and as records for a data frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import KINDS, Rms
from crosscheck.model.fitted import Fitted
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.result import Record
from seecr.units import measured, parameter_name, short, shown


def rms_words(rms: Rms) -> str:
    """The rms errors in a few words, such as "0.0309 mm, 0.0202 deg"."""
    parts = [
        f"{short(value * kind.factor)} {kind.unit}"
        for kind in KINDS
        if (value := rms.get(kind.key)) is not None
    ]
    return ", ".join(parts)


def belongs(key: str, name: str, unit: str) -> bool:
    """Whether a parameter, such as ``gain_3``, belongs to an effect's field with that unit."""
    stem = key.removesuffix(f"_{unit}") if unit else key
    return stem == name or (stem.startswith(f"{name}_") and len(stem) > len(name) + 1)


def value_lines(
    layout: Layout, values: Array, stderr: Array, at_bound: NDArray[np.bool_]
) -> Iterator[str]:
    """A line for each parameter (p,) of an effect: its name, value and standard error."""
    rows = zip(layout.names, layout.units, values, stderr, at_bound, strict=True)
    for name, unit, value, error, bound in rows:
        stop = " (at its bound)" if bound else ""
        # what is at its bound is known to be there, without an error
        known = shown(value, unit) if bound and np.isinf(error) else measured(value, error, unit)
        yield f"{parameter_name(name, unit)} = {known}{stop}"


def value_records(
    layout: Layout, values: Array, stderr: Array, at_bound: NDArray[np.bool_]
) -> Iterator[Record]:
    """A record for each parameter (p,) of an effect, SI; ``stderr`` None if unidentifiable."""
    rows = zip(layout.names, layout.units, values, stderr, at_bound, strict=True)
    for name, unit, value, error, bound in rows:
        seen: Any = float(error) if np.isfinite(error) else None
        yield {
            "effect": layout.name,
            "parameter": name,
            "value": float(value),
            "stderr": seen,
            "unit": unit,
            "at_bound": bool(bound),
        }


def fitted_lines(fitted: Iterable[Fitted]) -> list[str]:
    """A line for each parameter of effects that were fitted together, under their names."""
    return [
        f"{one.term.name}: {line}"
        for one in fitted
        for line in value_lines(one.term.layout, one.term.vector, one.stderr, one.at_bound)
    ]


def fitted_records(fitted: Iterable[Fitted]) -> list[Record]:
    """A record for each parameter of effects that were fitted together: value, error, SI."""
    return [
        record
        for one in fitted
        for record in value_records(one.term.layout, one.term.vector, one.stderr, one.at_bound)
    ]
