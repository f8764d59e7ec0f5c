"""Evaluates sets of effects in the model linearised about an optimum, by normal equations alone.

With y = r + X z in white noise and the prior z ~ N(0, width^2), one width for each effect (a group
of columns), the evidence of a set needs only X^T X and X^T y, which are computed once. The inverse
of the normal matrix of one set tells what each member is worth beside the others, and each other
effect beside the set, for every width at once (:mod:`crosscheck.calibration.worth`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.calibration.worth import log_gains
from crosscheck.fit.definite import inverse_of
from seecr.effects.base import Layout
from seecr.pose import Array

# A set: the prior width of each effect in it.
Widths = Mapping[str, float]

# Most rounds through the members when their widths are chosen.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class ColumnGroup:
    """The columns of one effect.

    Attributes:
        columns: their indices. widths: prior widths over which its evidence is averaged.
        one_sided: whether the effect is a single parameter that cannot be negative.
    """

    columns: NDArray[np.intp]
    widths: Array
    one_sided: bool = False

    @classmethod
    def of(cls, columns: NDArray[np.intp], layout: Layout, widths: Array) -> ColumnGroup:
        """The columns of an effect with this layout."""
        return cls(columns, widths, len(columns) == 1 and bool(layout.lower[0] == layout.null[0]))


@dataclass(frozen=True, eq=False)
class Gram:
    """Normal equations of all effects.

    Attributes:
        normal: (p, p) X^T X. gradient: (p,) X^T y. power: y^T y.
        groups: the columns of each effect.
    """

    normal: Array
    gradient: Array
    power: float
    groups: dict[str, ColumnGroup]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all effects."""
        return tuple(self.groups)

    def solved(self, chosen: Widths) -> Solved:
        """Solve the normal equations of one set."""
        empty = np.zeros(0, dtype=np.intp)
        columns = np.concatenate([empty, *(self.groups[n].columns for n in chosen)])
        width = np.concatenate([np.zeros(0), *(
            np.full(len(self.groups[n].columns), w) for n, w in chosen.items()
        )])  # fmt: skip
        matrix = self.normal[np.ix_(columns, columns)] + np.diag(width**-2.0)
        return Solved(self, dict(chosen), columns, width, inverse_of(matrix))


def gram_of(x: Array, y: Array, groups: dict[str, ColumnGroup]) -> Gram:
    """The normal equations of whitened columns (N, p) and readings (N,)."""
    return Gram(x.T @ x, x.T @ y, float(y @ y), groups)


@dataclass(frozen=True, eq=False)
class Solved:
    """One set of effects, with one prior width for each.

    Attributes:
        gram: normal equations of all effects. chosen: the set.
        columns: (k,) indices of its columns. width: (k,) their prior widths.
        inverse: (k, k) posterior covariance of its values z.
    """

    gram: Gram
    chosen: dict[str, float]
    columns: NDArray[np.intp]
    width: Array
    inverse: Array

    @cached_property
    def values(self) -> Array:
        """(k,) most probable values z."""
        return np.asarray(self.inverse @ self.gram.gradient[self.columns])

    @cached_property
    def log_evidence(self) -> float:
        """ln Z with these widths, up to a constant: noise alone has -power/2."""
        gained = float(self.gram.gradient[self.columns] @ self.values)
        _sign, volume = np.linalg.slogdet(self.inverse)
        spread = float(volume) - 2.0 * float(np.sum(np.log(self.width)))
        return -0.5 * (self.gram.power - gained) + 0.5 * spread + self._one_sided

    @property
    def _one_sided(self) -> float:
        """ln of the change of Z for members that cannot be negative, each treated by itself."""
        total = 0.0
        for name in self.chosen:
            if self.gram.groups[name].one_sided:
                at = self._place(name)
                error = float(np.sqrt(self.inverse[at[0], at[0]]))
                total += np.log(2.0) + float(special.log_ndtr(self.values[at[0]] / error))
        return total

    def beside(self, name: str) -> tuple[Array, Array]:
        """An effect's normal matrix and gradient after the (other) members are eliminated."""
        gram, own = self.gram, self.gram.groups[name].columns
        if name in self.chosen:
            at = self._place(name)
            precise = inverse_of(self.inverse[np.ix_(at, at)])
            left = precise - np.eye(len(at)) / self.chosen[name] ** 2
            return left, precise @ self.values[at]
        cross = gram.normal[np.ix_(self.columns, own)]
        left = gram.normal[np.ix_(own, own)] - cross.T @ self.inverse @ cross
        return left, gram.gradient[own] - cross.T @ self.values

    def gains(self, name: str) -> Array:
        """ln evidence that an effect gains beside the (other) members, for each of its widths."""
        group = self.gram.groups[name]
        normal, gradient = self.beside(name)
        return log_gains(normal, gradient, group.widths, group.one_sided)

    def gain(self, name: str) -> float:
        """The ln evidence that an effect gains beside the (other) members, averaged over widths."""
        gains = self.gains(name)
        return float(special.logsumexp(gains) - np.log(len(gains)))

    def _place(self, name: str) -> NDArray[np.intp]:
        counts = [len(self.gram.groups[n].columns) for n in self.chosen]
        at = list(self.chosen).index(name)
        first = sum(counts[:at])
        return np.arange(first, first + counts[at])


def best_widths(gram: Gram, start: Widths, price: float = 0.0) -> dict[str, float]:
    """Widths of a set's members that maximise its evidence, by coordinate ascent.

    Args:
        gram: normal equations of all effects.
        start: the set with its initial widths.
        price: a width is only changed if that gains more than this ln evidence.
    """
    chosen = dict(start)
    for _ in range(_ROUNDS):
        before = dict(chosen)
        for name, width in before.items():
            widths = gram.groups[name].widths
            gains = gram.solved(chosen).gains(name) - price * (widths != width)
            chosen[name] = float(widths[int(np.argmax(gains))])
        if chosen == before:
            break
    return chosen


def averaged(gram: Gram, chosen: Widths) -> float:
    """ln Z of a set, averaged over the width of each member about the best widths."""
    solved = gram.solved(chosen)
    return solved.log_evidence + sum(averaging(solved, name) for name in chosen)


def averaging(solved: Solved, name: str) -> float:
    """How much averaging over the widths of one member changes ln Z, beside the others."""
    gains = solved.gains(name)
    at = int(np.argmin(np.abs(solved.gram.groups[name].widths - solved.chosen[name])))
    return float(special.logsumexp(gains) - np.log(len(gains)) - gains[at])
