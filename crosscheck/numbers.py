"""Numbers as people read them: millimetres, degrees, and no more digits than are known."""

from __future__ import annotations

import numpy as np

# Factor and unit for people; other units stay as they are.
_SHOWN = {
    "m": (1e3, "mm"),
    "rad": (180.0 / np.pi, "deg"),
    "m_per_N": (1e3, "mm/N"),
    "N_per_m": (1.0, "N/m"),
    "1_per_K": (1e6, "µm/(m K)"),
    "C": (1.0, "°C"),
    "Nm": (1.0, "N m"),
}
# Larger numbers are written with an exponent.
_MOST_DIGITS = 6


def in_unit(unit: str) -> tuple[float, str]:
    """Factor from SI and the unit's name, for a parameter's unit."""
    return _SHOWN.get(unit, (1.0, unit.replace("_per_", "/")))


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
