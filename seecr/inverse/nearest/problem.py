"""The balance about poses, as the search for the nearest pose that can be held needs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.holding.balance import straight_balance
from seecr.holding.distribution import balanced, distribute, nearly_balanced
from seecr.holding.inside import can_balance
from seecr.inverse.nearest.motion import Directions, PlatformMotion
from seecr.pose import Array, pose_add, pose_difference
from seecr.statics.tables import Tables

Rows = NDArray[np.intp]


class Balance(Protocol):
    """The balance at poses (k, 7) of some rows: matrices (k, d, m) and loads (k, d).

    It is linearised in the tensions at ``about`` (k, m), which matters for heavy cables; by default
    at tensions that come near to balance. A row may occur several times.
    """

    def __call__(
        self, poses: Array, rows: Rows, about: Array | None = None, /
    ) -> tuple[Array, Array]: ...


Stays = Callable[[Array, Rows], NDArray[np.bool_]]
"""Whether the platform is stable at poses (k, 7) of some rows, with the lengths that hold it there.
"""
Holds = Callable[[Array, Rows], NDArray[np.bool_]]
"""Whether poses (k, 7) of some rows can be held, by the balance as it is and not linearised."""

# Tensions of a pose this close to the limit still have some margin [load].
_INSIDE = 1e-6
# Weight of a tension of one load, as a displacement [robot's length]: hardly any.
_WEIGHT = 1e-3
# Step of finite differences [robot's length].
_DIFFERENCE = 1e-4


@dataclass(frozen=True, eq=False)
class Reaching:
    """The search for the poses nearest to wanted ones (n, 7) that can be held.

    ``away`` (k, d) is the displacement of poses from the wanted ones along the coordinates [m];
    ``rows`` (k,) says which wanted pose each of them belongs to. A row may occur several times.
    """

    robot: Robot
    wanted: Array
    values: Array | None  # (n, d) joint values at the wanted poses, None for a free platform
    balance: Balance
    stays: Stays
    least: Array  # (n, m) [N]
    most: Array  # (n, m) [N]
    scale: Array  # (n,) [N] load
    motion: PlatformMotion  # from the wanted poses
    straight: Tables | None = None  # (n,) of the wanted poses; None if cables are not straight
    holds: Holds | None = None  # None if the balance is linear

    @classmethod
    def within(
        cls,
        robot: Robot,
        wanted: Array,
        balance: Balance,
        stays: Stays,
        limits: tuple[Array, Array],
        scale: Array,
        *,
        fix_position: bool = False,
        straight: Tables | None = None,
        holds: Holds | None = None,
    ) -> Reaching:
        """The problem of wanted poses (n, 7).

        Args:
            limits: (m,) smallest and largest tensions [N]. scale: (n,) [N] load.
            fix_position: keep the position and change only the orientation.
            straight: of the wanted poses, if they are :func:`seecr.holding.balance.is_straight`:
                their balance then needs neither ``balance`` nor poses.
            holds: for a balance that is not linear in the tensions.
        """
        low, high = limits
        inside = _INSIDE * scale[:, None]
        least = np.minimum(low + inside, 0.5 * (low + np.minimum(high, 1e300)))
        most = np.maximum(high - inside, least)
        values, screws = None, np.zeros((len(wanted), 0, 7))
        if robot.joints:
            values, screws = values_of_pose(robot, wanted)
        motion = PlatformMotion.about(robot, wanted, screws, fix_position)
        return cls(
            robot, wanted, values, balance, stays, least, most, scale, motion, straight, holds
        )

    @property
    def is_in_place(self) -> bool:
        """Whether positions are kept."""
        return self.motion.is_in_place

    @property
    def home(self) -> Array:
        """The coordinates (1, 7) or (1, d) of the reference pose, see :meth:`coordinates`."""
        return (
            self.robot.reference_pose[None]
            if self.values is None
            else np.zeros((1, self.robot.n_dof))
        )

    def coordinates(self, poses: Array) -> Array:
        """Joint values (k, d) at poses (k, 7), which take a search; of free platforms the poses."""
        return poses if self.values is None else values_of_pose(self.robot, poses)[0]

    def moved(self, away: Array, rows: Rows) -> Array:
        """The coordinates with displacements ``away`` from the wanted poses of rows."""
        change = away * np.where(self.robot.hinges, 1.0 / self.robot.length, 1.0)
        if self.values is None:
            return pose_add(self.wanted[rows], change)
        return np.asarray(self.values[rows] + change)

    def placed(self, away: Array, rows: Rows) -> Array:
        """Poses (k, 7) with displacements ``away`` from the wanted ones of rows."""
        there = self.moved(away, rows)
        return there if self.values is None else pose_of_values(self.robot, there)[0]

    def to(self, there: Array, rows: Rows) -> Array:
        """(k, d) displacements from the wanted poses of rows to coordinates (k, 7) or (k, d)."""
        if self.values is None:
            change = pose_difference(there, self.wanted[rows])
        else:
            change = there - self.values[rows]
            shorter = np.mod(change + np.pi, 2.0 * np.pi) - np.pi  # the shorter way about a hinge
            change = np.where(self.robot.hinges, shorter, change)
        return change * np.where(self.robot.hinges, self.robot.length, 1.0)

    def at(self, away: Array, rows: Rows, about: Array | None = None) -> tuple[Array, Array]:
        """Balance (k, d, m) and (k, d) there, linearised in the tensions ``about`` (k, m)."""
        if self.straight is not None:
            return straight_balance(self.straight, rows, away)
        return self.balance(self.placed(away, rows), rows, about)

    def seems_held(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
        """Whether the poses with these displacements can be held, by the linearised balance."""
        if len(rows) == 0:
            return np.zeros(0, dtype=bool)
        limits = self.least[rows], self.most[rows]
        held = can_balance(*self.at(away, rows), *limits, self.scale[rows])
        return np.asarray(held & self.motion.are_allowed(away, rows))

    def held(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
        """Whether the poses with these displacements can be held."""
        out = self.seems_held(away, rows)
        if self.holds is not None and len(some := np.flatnonzero(out)):
            # level heavy cables seem to hold anything up, if only they are tight enough
            out[some] = self.holds(self.placed(away[some], rows[some]), rows[some])
        return out

    def firm(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
        """Whether the platform is held and stable at these displacements, checked exactly."""
        out = self.held(away, rows)
        some = np.flatnonzero(out)
        if len(some):
            out[some] = self.rests(away[some], rows[some])
        return out

    def rests(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
        """Whether the platform is stable, at poses that are in balance or nearly so."""
        return self.stays(self.placed(away, rows), rows)

    def lack(self, away: Array, rows: Rows) -> tuple[Array, NDArray[np.bool_]]:
        """(k,) approximate residual of the balance [load]; and whether the pose can be held."""
        least, most, (matrix, load) = self.least[rows], self.most[rows], self.at(away, rows)
        if matrix.shape[2] < matrix.shape[1]:
            tensions, held = nearly_balanced(matrix, load, least, most), np.zeros(len(rows), bool)
        else:
            tensions, held = distribute(matrix, load, least, least, most)
        left = np.abs(np.einsum("ndm,nm->nd", matrix, tensions) - load).max(axis=1)
        return left / self.scale[rows], held

    def size(self, spots: Spots) -> Array:
        """(k,) [m] distance from the wanted poses."""
        return self.motion.far(spots.away, spots.rows)

    def start(self, away: Array, rows: Rows) -> Spots:
        """Starting points, held or not, with the tensions that come nearest to balance."""
        if len(rows) == 0:
            return Spots(away, rows, np.empty((0, self.least.shape[1])), np.empty(0))
        tensions, (matrices, loads) = self.least[rows], self.at(away, rows)
        # an anchor point on the pulley itself has no cable to it, and its pose no balance
        for i in np.flatnonzero(np.isfinite(loads).all(axis=1)):
            limits = tensions[i], self.most[rows[i]]
            tensions[i] = balanced(matrices[i], loads[i], *limits)[0]
        # the balance linearised at these tensions
        matrix, load = self.at(away, rows, tensions)
        left = np.abs(np.einsum("ndm,nm->nd", matrix, tensions) - load).max(axis=1)
        return Spots(away, rows, tensions, left / self.scale[rows])

    def unit(self, rows: Rows) -> Array:
        """(k, 1) [m/N] weight of tensions relative to displacements."""
        return np.asarray((_WEIGHT * self.robot.length / self.scale[rows])[:, None])

    def project(
        self,
        matrix: Array,
        load: Array,
        turn: Array,
        near: tuple[Array, Array],
        rows: Rows,
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """The step and tensions nearest to ``near``, (k, d) and (k, m), in linearised balance.

        Args:
            matrix: (k, d, m), load: (k, d) where the step begins. turn: (k, d, d) [N/m] derivative
                of the residual by steps along the :class:`PlatformMotion`'s directions.

        Returns:
            Steps (k, d), tensions (k, m), and (k,) whether there are any.
        """
        unit, m = self.unit(rows), matrix.shape[2]
        whole = np.concatenate([matrix / unit[:, None], turn], axis=2)
        ends = np.broadcast_to(self.motion.free, near[0].shape)
        low = np.concatenate([self.least[rows] * unit, -ends], axis=1)
        high = np.concatenate([self.most[rows] * unit, ends], axis=1)
        goal = np.concatenate([near[1] * unit, near[0]], axis=1)
        answer, possible = distribute(whole, load, goal, low, high)
        return answer[:, m:], answer[:, :m] / unit, possible


@dataclass(frozen=True, eq=False)
class Spots:
    """The points of k searches.

    Attributes:
        away: (k, d) [m]. rows: (k,). tensions: (k, m) [N]. left: (k,) residual [load].
    """

    away: Array
    rows: Rows
    tensions: Array
    left: Array

    def only(self, some: NDArray[np.intp] | NDArray[np.bool_]) -> Spots:
        return Spots(self.away[some], self.rows[some], self.tensions[some], self.left[some])

    def and_more(self, other: Spots) -> Spots:
        """All points of both."""
        both = zip(
            (self.away, self.rows, self.tensions, self.left),
            (other.away, other.rows, other.tensions, other.left),
            strict=True,
        )
        return Spots(*(np.concatenate(pair) for pair in both))

    def only_tight(self, most: float) -> Spots:
        return self.only(self.left <= most)

    def put(self, some: NDArray[np.intp], other: Spots) -> None:
        """Overwrite some points in place."""
        self.away[some], self.tensions[some] = other.away, other.tensions
        self.left[some] = other.left

    def copy(self) -> Spots:
        return Spots(self.away.copy(), self.rows, self.tensions.copy(), self.left.copy())


@dataclass(frozen=True, eq=False)
class Curved:
    """The balance and the distance about k poses to second order, at the tensions of a search.

    All derivatives are by steps along the directions of the :class:`PlatformMotion`.

    Attributes:
        matrix: (k, d, m). load, left: (k, d) [N]; left is the residual.
        turn: (k, d, d) [N/m] derivative of the residual.
        along: the directions.
        bend: (k, d, d) second derivative of half the squared distance, less one along each.
    """

    matrix: Array
    load: Array
    left: Array
    turn: Array
    along: Directions
    bend: Array
    _all: Array
    _matrices: Array
    _step: float

    @classmethod
    def about(cls, problem: Reaching, away: Array, tensions: Array, rows: Rows) -> Curved:
        """By finite differences: central along each direction, and one step along each pair."""
        (k, d), step = away.shape, _DIFFERENCE * problem.robot.length
        along = problem.motion.directions(away, rows)
        eye, (i, j) = np.eye(d), np.triu_indices(d, 1)
        sides = step * np.concatenate([np.zeros((1, d)), eye, -eye, eye[i] + eye[j]])
        count = len(sides)
        each, pulls = np.repeat(rows, count), np.repeat(tensions, count, axis=0)
        moved = problem.motion.stepped(
            np.repeat(away, count, axis=0), each,
            None if along.basis is None else np.repeat(along.basis, count, axis=0),
            np.tile(sides, (k, 1)),
        )  # fmt: skip
        matrix, load = problem.at(moved, each, pulls)
        every, load = matrix.reshape(k, count, d, -1), load.reshape(k, count, d)
        left = np.einsum("nsdm,nm->nsd", every, tensions) - load
        plus, minus = left[:, 1 : 1 + d], left[:, 1 + d : 1 + 2 * d]
        turn = np.swapaxes(plus - minus, 1, 2) / (2.0 * step)
        bend = np.zeros_like(turn)
        if along.squares is not None:
            half = 0.5 * (problem.motion.far(moved, each) ** 2).reshape(k, count)
            bend = _second_differences(half, d) / step**2 - along.squares
        first = every[:, 0], load[:, 0], left[:, 0]
        return cls(*first, turn, along, bend, left, every, step)

    def bends(self, dual: Array) -> tuple[Array, Array]:
        """Second derivatives of dual . left: (k, d, d) and, mixed with tensions, (k, d, m)."""
        d = self.load.shape[1]
        value = np.einsum("nsd,nd->ns", self._all, dual)
        sides = self._matrices[:, 1 : 1 + d] - self._matrices[:, 1 + d : 1 + 2 * d]
        by_tension = np.einsum("nsdm,nd->nsm", sides, dual) / (2.0 * self._step)
        return _second_differences(value, d) / self._step**2, by_tension


def _second_differences(value: Array, d: int) -> Array:
    """(k, d, d) of values (k, s) at no step, steps along each of d directions, back, and pairs."""
    first, plus, minus = value[:, :1], value[:, 1 : 1 + d], value[:, 1 + d : 1 + 2 * d]
    i, j = np.triu_indices(d, 1)
    own = np.zeros((len(value), d, d))
    own[:, i, j] = value[:, 1 + 2 * d :] - plus[:, i] - plus[:, j] + first
    own += np.swapaxes(own, 1, 2)
    own[:, np.arange(d), np.arange(d)] = plus + minus - 2.0 * first
    return own
