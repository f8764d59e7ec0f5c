"""Units as people type and read them, and numbers as they read them.

Inside the package all numbers are in SI. People read them in the units of this table, with no
more digits than are known.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from crosscheck.errors import CrosscheckError
from seecr.units import UNITS, short, significant, with_error, without_rounding

__all__ = [
    "EXAMPLE",
    "LEAST",
    "LEAST_NOISE",
    "MOST",
    "SI",
    "chance",
    "in_unit",
    "parameter_name",
    "parse_kind",
    "parse_quantity",
    "short",
    "with_error",
    "without_rounding",
]

SI = {"position": "m", "orientation": "rad", "tension": "N", "length": "m"}
"""The SI unit of each kind of reading, and of commanded lengths."""

EXAMPLE = {"position": "0.5mm", "orientation": "0.2deg", "tension": "1N", "length": "0.2mm"}
"""What a person may type for each of them."""

# In SI; beyond them squares, which fits and noise are made of, are lost in rounding.
LEAST, MOST = 1e-15, 1e15
# Of noise: beside less, what effects do is so large that rounding leaves nothing of the rest.
LEAST_NOISE = 1e-9

_SHOWN = {unit.si: unit for unit in UNITS if unit.shown}
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def in_unit(si: str) -> tuple[float, str]:
    """Factor from SI and the name of the unit that people read; of a parameter's unit."""
    unit = _SHOWN.get(si)
    if unit is None:
        return 1.0, si.replace("_per_", "/")
    return unit.over / unit.times, unit.symbol or unit.suffix


def parse_quantity(label: str, kind: str, text: str, least: float = LEAST) -> float:
    """A positive number with its unit, in SI.

    Args:
        label: the option or key, to say where.
        kind: one of :data:`SI`.
        text: such as ``0.5mm``.
        least: in SI; less is none.

    Raises:
        CrosscheckError: no number above zero with a unit of that kind.
    """
    return parse_kind(label, (kind,), text, least)[1]


def parse_kind(
    label: str, kinds: Sequence[str], text: str, least: float = LEAST
) -> tuple[str, float]:
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
    if not least < unit.to_si(value) < MOST:
        raise CrosscheckError(f"{label}: expected a size that can be measured, got {text!r}")
    return kind, unit.to_si(value)


def chance(p: float) -> str:
    """A probability."""
    return "< 1e-12" if p < 1e-12 else significant(p, 2)


def parameter_name(name: str, unit: str) -> str:
    """A parameter's name without its unit."""
    return name.removesuffix(f"_{unit}") if unit else name
