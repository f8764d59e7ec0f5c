"""Quantities as people type them: ``0.5mm``, and the noise of readings: ``position=0.1mm``."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Sequence

from crosscheck.errors import CrosscheckError
from seecr.units import UNITS

__all__ = [
    "EXAMPLE",
    "LEAST",
    "LEAST_NOISE",
    "MOST",
    "SI",
    "parse_kind",
    "parse_quantity",
    "parsed",
]

SI = {"position": "m", "orientation": "rad", "tension": "N", "length": "m"}
"""The SI unit of each kind of reading, and of commanded lengths."""

EXAMPLE = {"position": "0.5mm", "orientation": "0.2deg", "tension": "1N", "length": "0.2mm"}
"""What a person may type for each of them."""

# In SI; beyond them squares, which fits and noise are made of, are lost in rounding.
LEAST, MOST = 1e-15, 1e15
# Of noise: beside less, what effects do is so large that rounding leaves nothing of the rest.
LEAST_NOISE = 1e-9

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


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


def parsed(texts: Iterable[str]) -> dict[str, float]:
    """Noise in SI by fields of :class:`crosscheck.Sigma`, such as ``tension_N``.

    Args:
        texts: each a kind of reading and a quantity, such as ``"tension=0.5N"``.

    Raises:
        CrosscheckError: an unknown kind, no quantity, one in another unit, or two for one kind.
    """
    values: dict[str, float] = {}
    for text in texts:
        kind, equals, quantity = text.partition("=")
        kind = kind.strip()
        if not equals or kind not in SI:
            near = difflib.get_close_matches(kind, SI, n=len(SI), cutoff=0.0)
            raise CrosscheckError(
                f"--sigma {text}: expected KIND=QUANTITY such as position=0.1mm, KIND one of "
                f"{', '.join(near)} (nearest first)"
            )
        key = f"{kind}_{SI[kind]}"
        if key in values:
            raise CrosscheckError(
                f"--sigma {text}: expected one for the {kind}, got two; leave one out"
            )
        values[key] = parse_quantity(f"--sigma {kind}", kind, quantity, LEAST_NOISE)
    return values
