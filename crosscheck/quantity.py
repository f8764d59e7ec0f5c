"""Numbers with their unit, as people give them on a command line."""

from __future__ import annotations

import math
import re

from crosscheck.errors import CrosscheckError

# Units of each kind, in SI.
UNITS = {
    "position": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "orientation": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "tension": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
EXAMPLE = {"position": "0.5mm", "orientation": "0.2deg", "tension": "1N"}
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def parse_quantity(label: str, kind: str, text: str) -> float:
    """A positive number with its unit, in SI.

    Args:
        label: the option or key, to say where.
        kind: "position", "orientation" or "tension".
        text: such as ``0.5mm``.

    Raises:
        CrosscheckError: no number above zero with a unit of that kind.
    """
    units = UNITS[kind]
    words = f"{label}: expected a number with its unit ({', '.join(units)}) such as {EXAMPLE[kind]}"
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise CrosscheckError(f"{words}, came {text!r}")
    value, unit = float(match.group(1)), match.group(2)
    if unit not in units:
        came = f"unit {unit!r}" if unit else "no unit"
        raise CrosscheckError(f"{words}, came {came} in {text!r}")
    if not (value > 0 and math.isfinite(value)):
        raise CrosscheckError(f"{label}: expected more than zero, came {text!r}")
    return value * units[unit]
