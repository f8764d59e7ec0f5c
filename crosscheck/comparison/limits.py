"""Limits on a model's errors, with units, from the command line or a TOML file."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.comparison.residuals import Comparison
from crosscheck.errors import CrosscheckError
from crosscheck.files import read_toml
from crosscheck.fit.problem import BY_NAME
from crosscheck.units import EXAMPLE, parse_quantity


@dataclass(frozen=True)
class Limits:
    """Largest errors allowed, in SI; None where there is no limit.

    Attributes:
        max_position, max_orientation, max_tension: rms over all rows compared and the components
            read in them, as reported everywhere.
        max_position_worst, max_orientation_worst, max_tension_worst: length of the error vector
            (largest tension error) of the worst row.
    """

    max_position: float | None = None
    max_orientation: float | None = None
    max_tension: float | None = None
    max_position_worst: float | None = None
    max_orientation_worst: float | None = None
    max_tension_worst: float | None = None


NAMES = tuple(field.name for field in fields(Limits))


@dataclass(frozen=True)
class Exceeded:
    """A limit that does not hold.

    Attributes:
        name: of the limit. limit, value: in SI. words: a sentence with where.
    """

    name: str
    limit: float
    value: float
    words: str


def kind_of(name: str) -> str:
    """position, orientation or tension."""
    return name.split("_")[1]


def parse_limit(name: str, text: str) -> float:
    """A limit, one of NAMES, with its unit, in SI.

    Raises:
        CrosscheckError: no number above zero with a unit of that kind.
    """
    return parse_quantity(option(name), kind_of(name), text)


def option(name: str) -> str:
    """The name as on the command line."""
    return "--" + name.replace("_", "-")


def load_limits(path: str | Path) -> Limits:
    """Limits of a TOML file: ``max_position = "0.5mm"``, keys as on the command line.

    Raises:
        InputFileError: no TOML, an unknown key, a value without a unit.
    """
    expected = 'expected a TOML file with lines such as max_position = "0.5mm"'
    toml = read_toml(Path(path), expected)
    values: dict[str, float] = {}
    for key, value in toml.content.items():
        name = key.replace("-", "_")
        if name not in NAMES:
            near = difflib.get_close_matches(name, NAMES, n=len(NAMES), cutoff=0.0)
            raise toml.error(f"{key} is no limit; known, nearest first: {', '.join(near)}", key)
        if not isinstance(value, str):
            example = EXAMPLE[kind_of(name)]
            text = f'{key}: expected a text such as "{example}", got {value!r}'
            raise toml.error(text, key)
        try:
            values[name] = parse_limit(name, value)
        except CrosscheckError as error:
            raise toml.error(str(error), key) from None
    return Limits(**values)


def with_options(limits: Limits, options: dict[str, str | None]) -> Limits:
    """Limits with those of the command line in place of the file's."""
    given: dict[str, Any] = {k: parse_limit(k, v) for k, v in options.items() if v is not None}
    return replace(limits, **given)


def check(limits: Limits, found: Comparison) -> list[Exceeded]:
    """The limits that do not hold.

    Raises:
        CrosscheckError: a limit on what was not measured.
    """
    out = []
    for name in NAMES:
        limit = getattr(limits, name)
        if limit is None:
            continue
        kind = kind_of(name)
        if not _measured(found, kind):
            raise CrosscheckError(
                f"{option(name)}: {found.problem.data.path} holds no {kind} readings; expected "
                "limits on what was measured"
            )
        sizes = found.errors_of(kind)
        if not np.isfinite(sizes).any():
            continue
        value = found.rms[BY_NAME[kind].key]
        if name.endswith("_worst"):
            value = float(np.nanmax(sizes))
        if value is not None and value > limit:
            out.append(Exceeded(name, limit, value, _words(found, name, limit, value)))
    return out


def _measured(found: Comparison, kind: str) -> bool:
    data = found.problem.data
    return bool(getattr(data, f"has_{kind}"))


def _words(found: Comparison, name: str, limit: float, value: float) -> str:
    kind = kind_of(name)
    factor, unit = BY_NAME[kind].factor, BY_NAME[kind].unit
    sizes = found.errors_of(kind)
    k = int(np.nanargmax(sizes))
    data = found.problem.data
    what = f"worst {kind} error" if name.endswith("_worst") else f"{kind} error (rms)"
    return (
        f"{what} {factor * value:.4g} {unit} exceeds {factor * limit:.4g} {unit} by "
        f"{factor * (value - limit):.4g} {unit}; worst at line {data.line[k]}, run "
        f"{data.run[k]}, {place(found, k)}: {factor * float(sizes[k]):.4g} {unit}"
    )


def place(found: Comparison, row: int) -> str:
    """The commanded position of a row for people; of lengths, where the model rests."""
    x, y, z = found.way.pose[row, :3]
    word = "commanded" if found.problem.data.command_lengths is None else "predicted"
    return f"{word} ({x:.4g} {y:.4g} {z:.4g}) m"
