"""Evaluates sets of effects in the model linearised about an optimum, by normal equations alone.

With y = r + X z in white noise and the prior z ~ N(0, width^2), one width for each effect (a group
of columns), the evidence of a set needs only X^T X and X^T y, which are computed once. The inverse
of the normal matrix of one set tells what each member is worth beside the others, and each other
effect beside the set, for every width at once
(:mod:`crosscheck.calibration.linear_evidence.worth`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.linear_evidence.worth import ByWidth, log_positive
from crosscheck.fit.least_squares.definite import inverse_of
from seecr.pose import Array

# A set: the prior width of each effect in it.
Widths = Mapping[str, float]

# Most rounds through the members when their widths are chosen.
_ROUNDS = 3
# How many of the sets solved last are kept: searches come back to them.
_KEPT = 8


@dataclass(frozen=True, eq=False)
class ColumnGroup:
    """The columns of one effect.

    Attributes:
        columns: (k,) their indices. widths: prior widths over which its evidence is averaged.
        one_sided: (k,) which of its parameters cannot be negative; none by default.
    """

    columns: NDArray[np.intp]
    widths: Array
    one_sided: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, bool))


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
    _last: dict[tuple[tuple[str, float], ...], Solved] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all effects."""
        return tuple(self.groups)

    def solved(self, chosen: Widths) -> Solved:
        """Solve the normal equations of one set, unless it is among the last ones."""
        key = tuple(chosen.items())  # with the order, which is that of the columns
        found = self._last.pop(key, None) or self._solve(chosen)
        self._last[key] = found
        if len(self._last) > _KEPT:
            del self._last[next(iter(self._last))]
        return found

    def _solve(self, chosen: Widths) -> Solved:
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
    _worth: dict[str, Array] = field(default_factory=dict, init=False, repr=False)

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

    def left_to_gain(self, z: Array) -> float:
        """How much ln posterior is lost at other values z than the most probable ones.

        Args:
            z: values of all columns.
        """
        away = self.values - z[self.columns]
        normal = self.gram.normal[np.ix_(self.columns, self.columns)]
        return 0.5 * float(away @ normal @ away + np.sum((away / self.width) ** 2))

    @property
    def _one_sided(self) -> float:
        """ln of the change of Z for parameters that cannot be negative, each treated by itself."""
        at = np.flatnonzero(self._bounded)
        return float(log_positive(self.values[at], self.inverse[at, at]))

    @cached_property
    def _bounded(self) -> NDArray[np.bool_]:
        """(k,) columns that cannot be negative."""
        groups = (self.gram.groups[name] for name in self.chosen)
        each = (np.broadcast_to(g.one_sided, len(g.columns)) for g in groups)
        return np.concatenate([np.zeros(0, bool), *each])

    def beside(self, name: str) -> tuple[Array, Array]:
        """An effect's normal matrix and gradient after the (other) members are eliminated."""
        gram, own = self.gram, self.gram.groups[name].columns
        if name in self.chosen:
            at = self._place(name)
            return self._beside_others(name, at, inverse_of(self.inverse[np.ix_(at, at)]))
        cross = gram.normal[np.ix_(self.columns, own)]
        left = gram.normal[np.ix_(own, own)] - cross.T @ self.inverse @ cross
        return left, gram.gradient[own] - cross.T @ self.values

    def gains(self, name: str) -> Array:
        """ln evidence that an effect gains beside the (other) members, for each of its widths."""
        group = self.gram.groups[name]
        return ByWidth.of(*self.beside(name), group.widths).gains_if(group.one_sided)

    def gain(self, name: str) -> float:
        """The ln evidence that an effect gains beside the (other) members, averaged over widths."""
        gains = self.gains(name)
        return float(np.logaddexp.reduce(gains) - np.log(len(gains)))

    def gains_of_member(self, name: str) -> Array:
        """The same of a member, less what its width costs others that cannot be negative.

        A narrow member may be replaced by others, in the linear model also by negative ones.
        """
        if name not in self._worth:
            self._worth[name] = self._gains_of_member(name)
        return self._worth[name]

    def _gains_of_member(self, name: str) -> Array:
        member, own = self.gram.groups[name], self._place(name)
        precise = inverse_of(self.inverse[np.ix_(own, own)])
        group = ByWidth.of(*self._beside_others(name, own, precise), member.widths)
        gains = group.gains_if(member.one_sided)
        others = np.setdiff1d(np.flatnonzero(self._bounded), own)
        if len(others) == 0:
            return gains
        # the others follow the member by its covariance with them
        with_own = self.inverse[np.ix_(others, own)]
        rate = with_own @ precise
        values, variance = group.seen(rate)
        alone = self.inverse[others, others] - np.sum(rate * with_own, axis=1)
        values = values + self.values[others] - rate @ self.values[own]
        return np.asarray(gains + log_positive(values, variance + np.maximum(alone, 1e-300)))

    def _beside_others(
        self, name: str, own: NDArray[np.intp], precise: Array
    ) -> tuple[Array, Array]:
        """`beside` of a member, from its places and the inverse of its own covariance."""
        left = precise - np.eye(len(own)) / self.chosen[name] ** 2
        return left, precise @ self.values[own]

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
    solved = gram.solved(start)
    for _ in range(_ROUNDS):
        before = solved.chosen
        for name, width in before.items():
            widths = gram.groups[name].widths
            gains = solved.gains_of_member(name) - price * (widths != width)
            best = float(widths[int(np.argmax(gains))])
            if best != width:
                solved = gram.solved({**solved.chosen, name: best})
        if solved.chosen == before:
            break
    return solved.chosen


def averaged(gram: Gram, chosen: Widths) -> float:
    """ln Z of a set, averaged over the width of each member about the chosen widths.

    These may be far from the best ones, if what others promise is far from the fit. That is no
    evidence: a fit with those others either finds it, and is scored itself, or it is not there.
    """
    solved = gram.solved(chosen)
    return solved.log_evidence + sum(min(averaging(solved, name), 0.0) for name in chosen)


def averaging(solved: Solved, name: str) -> float:
    """How much averaging over the widths of one member changes ln Z, beside the others."""
    gains = solved.gains_of_member(name)
    at = int(np.argmin(np.abs(solved.gram.groups[name].widths - solved.chosen[name])))
    return float(np.logaddexp.reduce(gains) - np.log(len(gains)) - gains[at])
