"""Terms with a parameter shifted up and down, for finite differences."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.effects.base import Effect, Layout
from seecr.effects.edits import is_built_in
from seecr.effects.setup import QUANTITIES, History, Setup
from seecr.effects.terms import Term, Terms
from seecr.pose import Array
from seecr.statics.tables import Tables, assemble, reassembled

# Steps of central and one-sided differences, in plausible sizes of a parameter.
_CENTRAL, _ONE_SIDED = 1e-4, 1e-5

# Quantities that affect the statics only through the rest lengths.
_PAID_OUT = {name for name, item in QUANTITIES.items() if item.paid_out}
# Quantities that say where cables begin and end.
_ENDS = {"exit_points", "anchor_points"}
# Quantities that also affect a row through the rows before it.
_OF_HISTORY = {name for name, item in QUANTITIES.items() if item.history is not History.NONE}
# Quantities that have no effect if no effect has a history.
OF_SHAPE = {name for name, item in QUANTITIES.items() if item.history is History.SHAPES}


@dataclass(frozen=True, eq=False)
class Shift:
    """Terms with a parameter, or several of one effect together, shifted up and down.

    ``apart`` is the difference between plus and minus: one number, or one for each parameter.
    """

    plus: Terms
    minus: Terms
    apart: Any
    layout: Layout

    @property
    def physical(self) -> bool:
        """Whether the shifted effect edits the setup."""
        return self.layout.effect.edit_setup is not Effect.edit_setup

    @property
    def sensing(self) -> bool:
        """Whether the shifted effect edits the readings."""
        return self.layout.effect.edit_readings is not Effect.edit_readings


@dataclass(frozen=True, eq=False)
class Sides:
    """Setups with a parameter shifted up and down, and the names of the quantities that differ."""

    plus: Setup
    minus: Setup
    differing: frozenset[str]

    @property
    def of_history(self) -> bool:
        """Whether the difference also affects a row through the rows before it."""
        return not self.differing.isdisjoint(_OF_HISTORY)

    @property
    def of_lengths(self) -> bool:
        """Whether only the cables' lengths differ."""
        return self.differing <= _PAID_OUT and not (self.plus.laws or self.minus.laws)

    @property
    def of_ends(self) -> bool:
        """Whether only the points differ between which cables run."""
        return self.differing <= _ENDS and not (self.plus.laws or self.minus.laws)

    def longer(self, apart: Any) -> Array:
        """Rest lengths (n, m) of plus minus those of minus, per unit of ``apart``."""
        return np.asarray((self.plus.rest_lengths() - self.minus.rest_lengths()) / apart)

    def tables(self, base: Tables, strains: Array) -> tuple[Tables, Tables]:
        """Tables of both sides, from ``base`` without a shift; the strains are for users' laws."""
        both = (self.plus, self.minus)
        if self.plus.laws or self.minus.laws:
            ahead, behind = (assemble(one, strains).with_past(base) for one in both)
        else:
            ahead, behind = (reassembled(base, one, self.differing) for one in both)
        return ahead, behind


def shifted(terms: Terms, term: Term, k: Any, part: float | None = None) -> Shift:
    """Shift parameter ``k`` of a term (or, with an index array, several together)."""
    up, down = (
        _up_and_down(term, k, part)
        if np.ndim(k) == 0
        else np.array([_up_and_down(term, one, part) for one in k.tolist()]).T
    )

    def with_value(numbers: Any) -> Terms:
        vector = term.vector.copy()
        vector[k] = numbers
        return terms.with_term(term.with_vector(vector))

    return Shift(with_value(up), with_value(down), up - down, term.layout)


def _up_and_down(term: Term, k: int, part: float | None) -> tuple[float, float]:
    """Values of parameter ``k`` on both sides of its own, or its own where the other is a bound."""
    layout, value = term.layout, float(term.vector[k])
    lower, upper = float(layout.lower[k]), float(layout.upper[k])
    size = float(layout.scale[k])
    # a time constant or radius counts by its relative change. The step is small, since a drum of
    # this radius may have turned many times, but above the residual of a solved path
    if layout.shape[k] and lower > 0.0:
        size = value * (0.1 if part is None else 1.0)
    step = (_CENTRAL if part is None else part) * size
    small = (_ONE_SIDED if part is None else part) * size
    if value - step < lower:
        return value + small, value
    if value + step > upper:
        return value, value - small
    return value + step, value - step


def positions(terms: Terms, wanted: list[int]) -> list[tuple[Term, int]]:
    """The term of each wanted parameter, and its index in that term."""
    every = [(term, k) for term in terms for k in range(len(term.layout))]
    return [every[c] for c in wanted]


def blocks_of_cables(
    terms: Terms, todo: Container[tuple[Term, int]]
) -> list[tuple[Term, NDArray[np.intp]]]:
    """Groups of parameters with one per cable, which can be shifted together.

    The effect of each is told apart by the cable that it acts on. This holds for built-in effects
    only: a user's effect may change other cables too.
    """
    return [
        (term, group)
        for term in terms
        if is_built_in(term.layout.effect)
        for group in term.layout.cable_by_cable
        if all((term, k) in todo for k in group.tolist())
    ]
