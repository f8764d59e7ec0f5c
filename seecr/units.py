"""Units: as files spell them, as people type and read them, and what they are in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from seecr.pose import Array

__all__ = ["UNITS", "Unit", "of_columns"]

Numbers = TypeVar("Numbers", float, Array)


@dataclass(frozen=True)
class Unit:
    """One unit.

    A factor is a product and a quotient, each exact, so that 103 mm is the double 0.103, which
    103 * 1e-3 is not.

    Attributes:
        suffix: as a column's or a parameter's name ends. si: the SI's for the same quantity.
        times, over: x of this unit are ``x * times / over`` in SI.
        symbol: as people read it. also: other ways to type it.
        column: whether a column of measurements may be in it.
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
        """Numbers of this unit in SI."""
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
    Unit("um_per_m_K", "1_per_K", over=1e6, symbol="µm/(m K)", shown=True),
)
"""Every unit that files, people and results use."""


def of_columns(si: str) -> dict[str, Unit]:
    """Units, by suffix, of columns of measurements that hold a quantity of this SI unit."""
    return {unit.suffix: unit for unit in UNITS if unit.si == si and unit.column}
