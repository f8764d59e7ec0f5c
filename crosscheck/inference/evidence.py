"""The evidence of sets of effects in a linear model, where it is a sum of squares.

With y = r + X z in white noise and z ~ N(0, lambda_g^2), one width for each group g of columns (an
effect or a field), the evidence of a set of groups needs only X^T X and X^T y. With its posterior
covariance V = (X^T X + L^-2)^-1 and z* = V X^T y,

    ln Z = -1/2 (y^T y - y^T X z*) + 1/2 ln det V - sum ln lambda

Beside a set, a further group has the normal matrix C = N_gg - N_gS V N_Sg and gradient b, and gains

    ln gain = 1/2 sum lambda^2 b_i^2/(1 + lambda^2 e_i) - 1/2 sum ln(1 + lambda^2 e_i)

in the axes of C = U diag(e) U^T. Z is averaged over the widths of each group, so that a badly
wrong expected size does not decide. A parameter that cannot be negative has half a Gaussian as its
prior, which multiplies Z by twice the probability that it is positive, given the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from crosscheck.fit.algebra import inverse_of
from seecr.pose import Array

Widths = Mapping[str, float]
"""A set of groups: the prior width of each of its members."""

# Rounds through the members when their widths are chosen.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class MemberColumns:
    """The columns of one effect or field.

    Attributes:
        columns: (k,) their indices. widths: prior widths over which its evidence is averaged.
        one_sided: (k,) which of its parameters cannot be negative; none by default.
    """

    columns: NDArray[np.intp]
    widths: Array
    one_sided: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, bool))

    @property
    def middle(self) -> float:
        """The width nearest to one expected size."""
        return float(self.widths[np.argmin(np.abs(np.log(self.widths)))])


@dataclass(frozen=True, eq=False)
class Linear:
    """Normal equations of all groups.

    Attributes:
        normal: (p, p) X^T X. gradient: (p,) X^T y. power: y^T y. groups: the columns of each.
    """

    normal: Array
    gradient: Array
    power: float
    groups: Mapping[str, MemberColumns]

    @classmethod
    def of(cls, x: Array, y: Array, groups: Mapping[str, MemberColumns]) -> Linear:
        """The normal equations of whitened columns (N, p) and readings (N,)."""
        return cls(x.T @ x, x.T @ y, float(y @ y), groups)

    def with_readings(self, x: Array, y: Array) -> Linear:
        """The same with further whitened columns (n, p) and readings (n,)."""
        more = Linear.of(x, y, self.groups)
        normal, gradient = self.normal + more.normal, self.gradient + more.gradient
        return Linear(normal, gradient, self.power + more.power, self.groups)

    def solved(self, chosen: Widths) -> Solved:
        """The normal equations of one set, solved."""
        none = np.zeros(0, dtype=np.intp)
        columns = np.concatenate([none, *(self.groups[n].columns for n in chosen)])
        width = np.concatenate([
            np.zeros(0), *(np.full(len(self.groups[n].columns), w) for n, w in chosen.items())
        ])  # fmt: skip
        matrix = self.normal[np.ix_(columns, columns)] + np.diag(width**-2.0)
        return Solved(self, dict(chosen), columns, width, inverse_of(matrix))


@dataclass(frozen=True, eq=False)
class Solved:
    """One set, with one prior width for each member.

    Attributes:
        linear: normal equations of all groups. chosen: the set, with its widths.
        columns: (k,) indices of its columns. width: (k,) their prior widths.
        inverse: (k, k) posterior covariance of its values z.
    """

    linear: Linear
    chosen: dict[str, float]
    columns: NDArray[np.intp]
    width: Array
    inverse: Array

    @cached_property
    def values(self) -> Array:
        """(k,) most probable values z."""
        return np.asarray(self.inverse @ self.linear.gradient[self.columns])

    @cached_property
    def log_evidence(self) -> float:
        """ln Z with these widths, up to a constant: noise alone has -power/2."""
        gained = float(self.linear.gradient[self.columns] @ self.values)
        volume = float(np.linalg.slogdet(self.inverse)[1]) - 2.0 * float(np.sum(np.log(self.width)))
        at = np.flatnonzero(self._bounded)
        positive = float(log_positive(self.values[at], self.inverse[at, at]))
        return -0.5 * (self.linear.power - gained) + 0.5 * volume + positive

    def left_to_gain(self, z: Array) -> float:
        """How much ln posterior is lost at other values z (of all columns) than the best ones."""
        away = self.values - z[self.columns]
        normal = self.linear.normal[np.ix_(self.columns, self.columns)]
        return 0.5 * float(away @ normal @ away + np.sum((away / self.width) ** 2))

    def place(self, name: str) -> NDArray[np.intp]:
        """Where a member's values stand among those of the set."""
        first = 0
        for other in self.chosen:
            count = len(self.linear.groups[other].columns)
            if other == name:
                return np.arange(first, first + count)
            first += count
        raise KeyError(name)

    def gain(self, name: str) -> float:
        """ln evidence that a group gains beside the (other) members, averaged over its widths."""
        return averaged(self.gains(name))

    def gains(self, name: str) -> Array:
        """(widths,) the same for each of its widths.

        Of a member, less what its width costs others that cannot be negative: a narrow member may
        be replaced by others, in the linear model also by negative ones.
        """
        if name not in self._gains:
            self._gains[name] = self._of_member(name) if name in self.chosen else self._of(name)
        return self._gains[name]

    @cached_property
    def _gains(self) -> dict[str, Array]:
        return {}

    def _of(self, name: str) -> Array:
        group = self.linear.groups[name]
        own = group.columns
        left = self.linear.normal[np.ix_(own, own)]
        gradient = self.linear.gradient[own]
        if len(self.columns):
            cross = self._cross[:, own]
            left = left - cross.T @ (self.inverse @ cross)
            gradient = gradient - cross.T @ self.values
        return _Axes.of(left, gradient, group.widths).gains(group.one_sided)

    @cached_property
    def _cross(self) -> Array:
        return self.linear.normal[self.columns]

    def _of_member(self, name: str) -> Array:
        group, own = self.linear.groups[name], self.place(name)
        precise = inverse_of(self.inverse[np.ix_(own, own)])
        left = precise - np.eye(len(own)) / self.chosen[name] ** 2
        axes = _Axes.of(left, precise @ self.values[own], group.widths)
        gains = axes.gains(group.one_sided)
        others = np.setdiff1d(np.flatnonzero(self._bounded), own)
        if len(others) == 0:
            return gains
        # the others follow the member by their covariance with it
        with_own = self.inverse[np.ix_(others, own)]
        rate = with_own @ precise
        values, variance = axes.seen(rate)
        alone = self.inverse[others, others] - np.sum(rate * with_own, axis=1)
        values = values + self.values[others] - rate @ self.values[own]
        return np.asarray(gains + log_positive(values, variance + np.maximum(alone, 1e-300)))

    @cached_property
    def _bounded(self) -> NDArray[np.bool_]:
        """(k,) columns that cannot be negative."""
        groups = (self.linear.groups[name] for name in self.chosen)
        each = (np.broadcast_to(g.one_sided, len(g.columns)) for g in groups)
        return np.concatenate([np.zeros(0, bool), *each])


@dataclass(frozen=True, eq=False)
class _Axes:
    """A group beside others in the axes of its normal matrix, for each of k widths."""

    power: Array
    axes: Array
    along: Array
    widths: Array

    @classmethod
    def of(cls, normal: Array, gradient: Array, widths: ArrayLike) -> _Axes:
        power, axes = np.linalg.eigh(normal)
        return cls(np.maximum(power, 0.0), axes, axes.T @ gradient, np.asarray(widths, float))

    def gains(self, one_sided: NDArray[np.bool_]) -> Array:
        square = self.widths[:, None] ** 2
        grown = 1.0 + square * self.power
        out = 0.5 * np.sum(square * self.along**2 / grown - np.log(grown), axis=1)
        bounded = np.broadcast_to(one_sided, len(self.power))
        if bounded.any():
            out = out + log_positive(*self.seen(np.eye(len(self.power))[bounded]))
        return np.asarray(out)

    def seen(self, rate: Array) -> tuple[Array, Array]:
        """Most probable values and variances (k, q) of rate @ z, for rate (q, p)."""
        square, rate = self.widths[:, None] ** 2, rate @ self.axes
        share = square / (1.0 + square * self.power)
        return (share * self.along) @ rate.T, share @ (rate**2).T


def log_positive(values: Array, variance: Array) -> Array:
    """ln of what half a Gaussian as prior changes, by values (..., q) without the bound."""
    chance = special.log_ndtr(values / np.sqrt(variance))
    return np.asarray(np.sum(np.log(2.0) + chance, axis=-1))


def log_gain(
    normal: Array, gradient: Array, widths: ArrayLike, one_sided: ArrayLike = False
) -> float:
    """ln evidence, averaged over widths (k,), from what others leave of a group's equations."""
    return averaged(_Axes.of(normal, gradient, widths).gains(np.asarray(one_sided, bool)))


def averaged(gains: Array) -> float:
    """ln of the mean of exp."""
    return float(np.logaddexp.reduce(gains) - np.log(len(gains)))


def best_widths(linear: Linear, start: Widths, price: float = 0.0) -> Solved:
    """The set with the widths of greatest evidence; a change must gain more than ``price``."""
    solved = linear.solved(start)
    for _ in range(_ROUNDS):
        before = solved.chosen
        for name, width in before.items():
            widths = linear.groups[name].widths
            if len(widths) == 1:
                continue
            gains = solved.gains(name) - price * (widths != width)
            best = float(widths[int(np.argmax(gains))])
            if best != width:
                solved = linear.solved({**solved.chosen, name: best})
        if solved.chosen == before:
            break
    return solved


def log_evidence(solved: Solved) -> float:
    """ln Z of a set, averaged over the width of each member about the chosen widths.

    These may be far from the best ones, if what others promise is far from the fit. That is no
    evidence: a fit with those others either finds it, and is scored itself, or it is not there.
    """
    return solved.log_evidence + sum(min(_averaging(solved, n), 0.0) for n in solved.chosen)


def _averaging(solved: Solved, name: str) -> float:
    """How much averaging over the widths of one member changes ln Z, beside the others."""
    gains = solved.gains(name)
    at = int(np.argmin(np.abs(solved.linear.groups[name].widths - solved.chosen[name])))
    return averaged(gains) - float(gains[at])
