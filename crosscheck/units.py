"""Units as people type and read them, and numbers as they read them.

Inside the package all numbers are in SI. People read them in the units of this table, with no
more digits than are known.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from crosscheck.errors import CrosscheckError
from seecr.units import UNITS

__all__ = [
    "EXAMPLE",
    "SI",
    "chance",
    "in_unit",
    "parameter_name",
    "parse_kind",
    "parse_quantity",
    "short",
    "with_error",
]

SI = {"position": "m", "orientation": "rad", "tension": "N", "length": "m"}
"""The SI unit of each kind of reading, and of commanded lengths."""

EXAMPLE = {"position": "0.5mm", "orientation": "0.2deg", "tension": "1N", "length": "0.2mm"}
"""What a person may type for each of them."""

_SHOWN = {unit.si: unit for unit in UNITS if unit.shown}
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")
# Larger numbers are written with an exponent.
_MOST_DIGITS = 6


def in_unit(si: str) -> tuple[float, str]:
    """Factor from SI and the name of the unit that people read; of a parameter's unit."""
    unit = _SHOWN.get(si)
    if unit is None:
        return 1.0, si.replace("_per_", "/")
    return unit.over / unit.times, unit.symbol or unit.suffix


def parse_quantity(label: str, kind: str, text: str) -> float:
    """A positive number with its unit, in SI.

    Args:
        label: the option or key, to say where.
        kind: one of :data:`SI`.
        text: such as ``0.5mm``.

    Raises:
        CrosscheckError: no number above zero with a unit of that kind.
    """
    return parse_kind(label, (kind,), text)[1]


def parse_kind(label: str, kinds: Sequence[str], text: str) -> tuple[str, float]:
    """A positive number with the unit of one of some kinds: which kind, and the number in SI.

    Raises:
        CrosscheckError: no number above zero with a unit of those kinds.
    """
    units = {
        name: (kind, unit)
        for kind in kinds for unit in UNITS if unit.si == SI[kind]
        for name in (unit.suffix, *unit.also)
    }  # fmt: skip
    examples = " or ".join(EXAMPLE[kind] for kind in kinds)
    words = f"{label}: expected a number with its unit ({', '.join(units)}) such as {examples}"
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise CrosscheckError(f"{words}, got {text!r}")
    value, name = float(match.group(1)), match.group(2)
    if name not in units:
        got = f"unit {name!r}" if name else "no unit"
        raise CrosscheckError(f"{words}, got {got} in {text!r}")
    if not (value > 0 and math.isfinite(value)):
        raise CrosscheckError(f"{label}: expected more than zero, got {text!r}")
    kind, unit = units[name]
    return kind, unit.to_si(value)


def short(value: float | None, digits: int = 3) -> str:
    """A number of so many digits, without an exponent where that is readable."""
    if value is None or not np.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = int(np.floor(np.log10(abs(value)))) + 1
    if not -4 < size <= _MOST_DIGITS:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(power)}".replace("-", "−")
    decimals = max(digits - size, 0)
    return f"{value:.{decimals}f}".replace("-", "−")


def with_error(value: float, error: float) -> tuple[str, str]:
    """A value and its standard error, to two digits of the error."""
    if not np.isfinite(error):
        return short(value), "not seen"
    if error <= 0.0:
        return short(value, 6), "0"
    decimals = 1 - int(np.floor(np.log10(error)))
    if decimals > 9 or abs(value) >= 10.0**_MOST_DIGITS:
        return short(value, 6), short(error, 2)
    decimals = max(decimals, 0)
    return f"{value:.{decimals}f}".replace("-", "−"), f"{error:.{decimals}f}"


def chance(p: float) -> str:
    """A probability."""
    return "< 1e−12" if p < 1e-12 else short(p, 2)


def parameter_name(name: str, unit: str) -> str:
    """A parameter's name without its unit."""
    return name.removesuffix(f"_{unit}") if unit else name
