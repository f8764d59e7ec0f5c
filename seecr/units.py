"""Units: as files spell them, as people type and read them, and their SI equivalents.

Inside the packages all numbers are in SI. People read them in the units of this table, with no more
digits than are known.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from seecr.counted import figures
from seecr.pose import Array

Numbers = TypeVar("Numbers", float, Array)

# Digits before the point from which on numbers have an exponent, and those with an error.
_MOST_DIGITS, _MOST_KNOWN = 6, 9
# Numbers in units of people that are no larger are what rounding leaves.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Unit:
    """One unit.

    The factor is a product and a quotient of exact numbers, so that 103 mm is the double 0.103,
    which 103 * 1e-3 is not.

    Attributes:
        suffix: with which a column's or a parameter's name ends. si: the SI unit of the quantity.
        times, over: x of this unit are ``x * times / over`` in SI.
        symbol: as people read it. also: other ways to type it.
        column: whether a column of measurements may use it.
        shown: whether results in ``si`` are printed in it.
    """

    suffix: str
    si: str
    times: float = 1.0
    over: float = 1.0
    symbol: str = ""
    also: tuple[str, ...] = ()
    column: bool = False
    shown: bool = False

    def to_si(self, values: Numbers) -> Numbers:
        """Numbers of this unit, in SI."""
        return values * self.times / self.over


UNITS = (
    Unit("", "", column=True),
    Unit("m", "m", column=True),
    Unit("cm", "m", over=100.0, column=True),
    Unit("mm", "m", over=1000.0, column=True, shown=True),
    Unit("um", "m", over=1e6, also=("µm",), column=True),
    Unit("rad", "rad", column=True),
    Unit("mrad", "rad", over=1000.0),
    Unit("deg", "rad", times=math.pi / 180.0, also=("°",), column=True, shown=True),
    Unit("N", "N", column=True),
    Unit("mN", "N", over=1000.0),
    Unit("kN", "N", times=1000.0, column=True),
    Unit("kg", "kg", column=True),
    Unit("g", "kg", over=1000.0, column=True),
    Unit("s", "s", column=True),
    Unit("ms", "s", over=1000.0, column=True),
    Unit("C", "C", symbol="°C", column=True, shown=True),
    Unit("Nm", "Nm", symbol="N m", column=True, shown=True),
    Unit("mm_per_N", "m_per_N", over=1000.0, symbol="mm/N", shown=True),
    Unit("N_m", "N_per_m", also=("N/m",), column=True),
    Unit("N_mm", "N_per_m", times=1000.0, also=("N/mm",), column=True),
    Unit("kN_m", "N_per_m", times=1000.0, also=("kN/m",), column=True),
    Unit("um_per_m_K", "1_per_K", over=1e6, symbol="µm/(m K)", shown=True),
)
"""Every unit that files, people and results use."""


_SHOWN = {unit.si: unit for unit in UNITS if unit.shown}
_TYPED = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(\S*)")


def number_and_unit(text: str) -> tuple[float, str] | None:
    """A number as people type it, and what stands behind it; None if it does not begin with one."""
    match = _TYPED.fullmatch(text.strip())
    return None if match is None else (float(match[1]), match[2])


def in_si(text: str, si: str) -> float | None:
    """A number with its unit, such as ``25kg``, in SI; one without is in SI. None if it is neither.

    Args:
        text: as people type it. si: the SI unit of the quantity.
    """
    names = {name: unit for unit in UNITS if unit.si == si for name in (unit.suffix, *unit.also)}
    typed = number_and_unit(text)
    if typed is None or typed[1] not in (*names, ""):
        return None
    value, name = typed
    return names[name].to_si(value) if name else value


def in_unit(si: str) -> tuple[float, str]:
    """Factor from SI and the name of the unit that people read; of a parameter's unit."""
    unit = _SHOWN.get(si)
    if unit is None:
        return 1.0, si.replace("_per_", "/")
    return unit.over / unit.times, unit.symbol or unit.suffix


def parameter_name(name: str, unit: str) -> str:
    """A parameter's name without its unit."""
    return name.removesuffix(f"_{unit}") if unit else name


def of_columns(si: str) -> dict[str, Unit]:
    """Units, by suffix, that columns of measurements may use for a quantity of this SI unit."""
    return {unit.suffix: unit for unit in UNITS if unit.si == si and unit.column}


def without_rounding(value: float) -> float:
    """A number in a unit of people, or 0 where it is no more than what rounding leaves of that."""
    return 0.0 if abs(value) <= _ROUNDING else value


def short(value: float | None, digits: int = 3) -> str:
    """A number in a unit of people with so many digits; what rounding leaves of 0 is 0."""
    return significant(None if value is None else without_rounding(value), digits)


def significant(value: float | None, digits: int = 3) -> str:
    """A number with so many digits, however small, without an exponent if that is readable.

    Its minus sign is a hyphen, as in every text that the programs print: people copy numbers.
    """
    if value is None or not np.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    size = int(np.floor(np.log10(abs(value)))) + 1
    if not -4 < size <= _MOST_DIGITS:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(power)}"
    decimals = max(digits - size, 0)
    return f"{value:.{decimals}f}"


def chance(p: float) -> str:
    """A probability."""
    return "< 1e-12" if p < 1e-12 else significant(p, 2)


def millimetres(length: float | np.floating[Any], digits: int = 4) -> str:
    """A length [m] in mm with so many digits, and no exponent however many metres it is."""
    value = without_rounding(1e3 * float(length))
    form = ".0f" if abs(value) >= 10.0**digits - 0.5 else f".{digits}g"
    return f"{value:{form}} mm"


def newtons(force: float) -> str:
    """A force [N] with three digits, without an exponent: 6000 N, not 6e+03 N."""
    return f"{force:.3g} N" if abs(force) < 1e3 else f"{force:.0f} N"


def joules(energy: float, form: str = ".3g") -> str:
    """An energy [J] in mJ, or from 1 J on in J."""
    return f"{energy:{form}} J" if abs(energy) >= 1.0 else f"{1e3 * energy:{form}} mJ"


def with_error(value: float, error: float, digits: int = 2) -> tuple[str, str]:
    """A value and its standard error, to so many digits of the error.

    Without an error, what only rounding leaves of a value is 0.
    """
    if not np.isfinite(error):
        return short(value), "undetermined"
    large = abs(value) >= 10.0**_MOST_DIGITS
    endless = abs(value) >= 10.0**_MOST_KNOWN
    if error <= 0.0:
        return (f"{value:.0f}" if large and not endless else short(value, 6)), "0"
    decimals = digits - 1 - int(np.floor(np.log10(error)))
    if decimals > 9 or endless:
        return significant(value, 6), significant(error, 2)
    # of errors of hundreds too, no more digits than so many are known
    value, error, decimals = round(value, decimals), round(error, decimals), max(decimals, 0)
    return figures(value, f".{decimals}f"), f"{error:.{decimals}f}"


def shown(value: float, unit: str) -> str:
    """A number with its unit, as people read it."""
    factor, word = in_unit(unit)
    return f"{factor * value:.4g} {word}".strip()


def measured(value: float, error: float, unit: str) -> str:
    """A value with its standard error, to the digits that are known: 8.369 ± 0.013 mm.

    None of it is known without a finite error: the value is where the fit happened to begin.
    """
    if not np.isfinite(error):
        return "not determined by these data"
    factor, word = in_unit(unit)
    number, spread = with_error(factor * value, factor * error)
    known = 0.0 if number == "0" else value
    if error == 0.0:
        return f"{shown(known, unit)} (fixed)"
    return f"{number} ± {spread} {word}".strip()
