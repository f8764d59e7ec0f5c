"""The problem of the nearest pose that can be held: motion of the platform, and its balance.

A distance is the norm of the displacement of the platform's origin and of its rotation vector times
the robot's length. The coordinates of a free platform are just these. Those of a platform on joints
are not: a hinge beside the origin also moves it, and slides behind a hinge turn. So searches for
those make steps along directions that are orthonormal as motions of the platform.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import freedoms, pose_of_values, values_of_pose
from seecr.description.robot import Robot
from seecr.pose import Array, pose_add, pose_difference
from seecr.statics.tables import ByRow, Tables, by_row, take
from seecr.tensions.balance import straight_balance
from seecr.tensions.distribution import balanced, can_balance, distribute, nearly_balanced

Rows = NDArray[np.intp]

Balance = Callable[..., tuple[Array, Array]]
"""The balance at poses (k, 7) of some rows (k,): matrices (k, d, m) and loads (k, d).

It is linearised in the tensions (k, m), the third argument, which matters for heavy cables; by
default at tensions that come near to balance. A row may occur several times.
"""
Holds = Callable[[Array, Rows], NDArray[np.bool_]]
"""Whether something holds of poses (k, 7), or displacements (k, d), of some rows (k,)."""

# Squared motion of a combination of joints, relative to the largest, that counts as none.
_IDLE = 1e-12
# A position that is kept may be off by this [robot's length].
_KEPT = 1e-8
# Tensions of a pose this close to the limit still have some margin [load].
_INSIDE = 1e-6
# Weight of a tension of one load, as a displacement [robot's length]: hardly any.
_WEIGHT = 1e-3
# Step of finite differences [robot's length].
_DIFFERENCE = 1e-4


@dataclass(frozen=True, eq=False)
class Directions:
    """Orthonormal directions of the platform's motion at k displacements.

    Attributes:
        basis: (k, d, d) displacements per step along each, in their columns; None for a free
            platform, whose coordinates they are.
        squares: (k, d, d) products of their motions: one along each that moves the platform.
        slope: (k, d) [m] derivative of half the squared distance along each.
    """

    basis: Array | None
    squares: Array | None
    slope: Array


@dataclass(frozen=True, eq=False)
class PlatformMotion:
    """Motions from n wanted poses; ``away`` (k, d) [m] are displacements along the coordinates.

    Attributes:
        free: (d,) how far each direction may be followed, 0 or infinity; those that move the
            origin come first.
        turns, steady: independent rotations that keep the origin, and whether any can.
    """

    robot: Robot
    poses: Array
    screws: Array
    free: Array
    turns: int
    steady: bool

    @classmethod
    def about(cls, robot: Robot, poses: Array, screws: Array, fix_position: bool) -> PlatformMotion:
        """Motions from poses (n, 7), with ``fix_position`` only those that keep positions."""
        whole, turns, rotations = freedoms(robot)
        free = np.full(robot.n_dof, np.inf)
        if fix_position and turns < whole:
            free[: robot.n_dof - turns] = 0.0
        return cls(robot, poses, np.ascontiguousarray(screws), free, turns, turns == rotations)

    @property
    def is_in_place(self) -> bool:
        """Whether positions are kept."""
        return not np.all(self.free > 0.0)

    def part(self, rows: Rows) -> PlatformMotion:
        """The motions from some of the wanted poses."""
        return replace(self, poses=self.poses[rows], screws=self.screws[rows])

    def apart(self, away: Array, rows: Rows) -> Array:
        """(k, 6) [m] displacements of the origin, and rotation vectors times the length."""
        return self._apart_and_columns(away, rows)[0] if self.robot.joints else away

    def far(self, away: Array, rows: Rows) -> Array:
        """(k,) [m] distances from the wanted poses of rows."""
        return np.asarray(np.linalg.norm(self.apart(away, rows), axis=1))

    def directions(self, away: Array, rows: Rows) -> Directions:
        """Orthonormal directions to step along from displacements of rows."""
        if not self.robot.joints:
            return Directions(None, None, away)
        apart, columns = self._apart_and_columns(away, rows)
        squares, own = np.linalg.eigh(columns @ columns.swapaxes(1, 2))
        some = squares > _IDLE * squares[:, -1:]
        root = np.where(some, 1.0 / np.sqrt(np.where(some, squares, 1.0)), 0.0)
        # of all orthonormal directions those nearest to the joints' own
        basis = own * root[:, None] @ own.swapaxes(1, 2)
        moves = basis @ columns
        if self.is_in_place:
            # those that keep the origin last: they turn as much as they move at all
            linear, turned = moves[..., :3], moves[..., 3:]
            share = linear @ linear.swapaxes(1, 2) - turned @ turned.swapaxes(1, 2)
            order = np.linalg.eigh(share)[1][..., ::-1]
            basis, moves = basis @ order, order.swapaxes(1, 2) @ moves
        squares = moves @ moves.swapaxes(1, 2)
        return Directions(basis, squares, np.einsum("kir,kr->ki", moves, apart))

    def stepped(self, away: Array, rows: Rows, basis: Array | None, step: Array) -> Array:
        """Displacements (k, d) after steps (k, d) [m] along directions; kept positions are kept."""
        if basis is None:
            return np.asarray(away + step)
        return self.allowed(away + np.einsum("kij,kj->ki", basis, step), rows)

    def allowed(self, away: Array, rows: Rows) -> Array:
        """The displacements with positions brought back to the wanted ones if these are kept."""
        if not self.is_in_place:
            return away
        if not self.robot.joints:
            return np.where(self.free > 0.0, away, 0.0)
        return self._brought(away, rows, np.zeros((len(rows), 3)))

    def are_allowed(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
        """(k,) whether positions are the wanted ones, if these are kept."""
        if not (self.is_in_place and self.robot.joints):
            return np.ones(len(rows), dtype=bool)
        off = np.abs(self.apart(away, rows)[:, :3]).max(axis=1)
        return np.asarray(off <= _KEPT * self.robot.length)

    def brought(self, away: Array, rows: Rows, places: Array) -> Array:
        """The same rotations at displacements (k, 3) [m] of the origin.

        Joints that cannot turn the platform without moving its origin are left as they are.
        """
        if not self.robot.joints:
            return np.concatenate([places, away[:, 3:]], axis=1)
        return self._brought(away, rows, places) if self.steady else away

    def turned(self, away: Array, rows: Rows) -> Array:
        """(k, 3) [m] rotation vectors times the length; displacements if nothing can turn."""
        return self.apart(away, rows)[:, slice(3, 6) if self.robot.turns else slice(0, 3)]

    def _apart_and_columns(self, away: Array, rows: Rows) -> tuple[Array, Array]:
        """(k, 6) [m] from the wanted poses, and (k, d, 6) motion per step of each joint."""
        from seecr.compiled.joint_kinematics import apart_batch  # takes a while to import

        k, d = away.shape
        apart, columns = np.empty((k, 6)), np.empty((k, d, 6))
        given, length = (self.screws, self.poses), self.robot.length
        by_row(
            lambda of, by, *out: apart_batch(*given, of, by, length, *out),
            np.ascontiguousarray(rows), np.ascontiguousarray(away), apart, columns,
        )  # fmt: skip
        return apart, columns

    def _brought(self, away: Array, rows: Rows, places: Array) -> Array:
        """Displacements (k, d) with origins at places (k, 3) [m]."""
        from seecr.compiled.joint_kinematics import bring_batch  # takes a while to import

        out, there = np.array(away, order="C"), np.empty(len(rows), dtype=np.bool_)
        given, length = (self.screws, self.poses), self.robot.length
        by_row(
            lambda of, away, to, there: bring_batch(*given, of, away, length, to, there),
            np.ascontiguousarray(rows), out, np.ascontiguousarray(places), there,
        )  # fmt: skip
        return out


@dataclass(frozen=True, eq=False)
class NearestProblem:
    """The search for the poses nearest to wanted ones (n, 7) that can be held.

    ``away`` (k, d) is the displacement of poses from the wanted ones along the coordinates [m];
    ``rows`` (k,) says which wanted pose each of them belongs to. A row may occur several times.
    """

    robot: Robot
    wanted: Array
    values: Array | None  # (n, d) joint values at the wanted poses, None for a free platform
    balance: Balance
    stays: Holds  # whether the platform is stable, with the lengths that hold it there
    least: Array  # (n, m) [N]
    most: Array  # (n, m) [N]
    scale: Array  # (n,) [N] load
    motion: PlatformMotion  # from the wanted poses
    straight: Tables | None = None  # (n,) of the wanted poses; None if cables are not straight
    holds: Holds | None = None  # whether the balance itself holds; None if it is linear

    @classmethod
    def within(
        cls, robot: Robot, wanted: Array, balance: Balance, stays: Holds,
        limits: tuple[Array, Array], scale: Array, *, fix_position: bool = False,
        straight: Tables | None = None, holds: Holds | None = None,
    ) -> NearestProblem:  # fmt: skip
        """The problem of wanted poses (n, 7), with limits (m,) of tensions and loads (n,) [N].

        ``straight`` are their tables if they are :func:`seecr.tensions.balance.is_straight`;
        ``holds`` is for a balance that is not linear in the tensions.
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

    def part(self, rows: Rows) -> NearestProblem:
        """The problem for some of its rows."""
        holds = self.holds
        return replace(
            self, wanted=self.wanted[rows],
            values=None if self.values is None else self.values[rows],
            balance=lambda poses, some, about=None: self.balance(poses, rows[some], about),
            stays=lambda poses, some: self.stays(poses, rows[some]),
            holds=None if holds is None else lambda poses, some: holds(poses, rows[some]),
            least=self.least[rows], most=self.most[rows], scale=self.scale[rows],
            motion=self.motion.part(rows),
            straight=None if self.straight is None else take(self.straight, rows),
        )  # fmt: skip

    @property
    def home(self) -> Array:
        """The coordinates (1, 7) or (1, d) of the reference pose, see :meth:`coordinates`."""
        free = self.values is None
        return self.robot.reference_pose[None] if free else np.zeros((1, self.robot.n_dof))

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

    def stable(self, away: Array, rows: Rows) -> NDArray[np.bool_]:
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
        self, matrix: Array, load: Array, turn: Array, near: tuple[Array, Array], rows: Rows
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """The step (k, d) and tensions (k, m) nearest to ``near`` in balance, and whether any.

        It is linearised: ``matrix`` (k, d, m), ``load`` (k, d), and ``turn`` (k, d, d) [N/m], the
        derivative of the residual by steps along the directions.
        """
        unit, m = self.unit(rows), matrix.shape[2]
        whole = np.concatenate([matrix / unit[:, None], turn], axis=2)
        ends = np.broadcast_to(self.motion.free, near[0].shape)
        low = np.concatenate([self.least[rows] * unit, -ends], axis=1)
        high = np.concatenate([self.most[rows] * unit, ends], axis=1)
        goal = np.concatenate([near[1] * unit, near[0]], axis=1)
        answer, possible = distribute(whole, load, goal, low, high)
        # beside a pose without balance, derivatives may not be finite
        possible &= np.isfinite(answer).all(axis=1)
        answer = np.where(np.isfinite(answer), answer, goal)
        return answer[:, m:], answer[:, :m] / unit, possible


@dataclass(eq=False)
class Spots(ByRow):
    """The points of k searches.

    Attributes:
        away: (k, d) [m]. rows: (k,). tensions: (k, m) [N]. left: (k,) residual [load].
    """

    away: Array
    rows: Rows
    tensions: Array
    left: Array


@dataclass(frozen=True, eq=False)
class Curved:
    """The balance and the distance about k poses to second order, at the tensions of a search.

    All derivatives are by steps along the directions of the :class:`PlatformMotion`: ``turn`` (k,
    d, d) [N/m] of the residual ``left`` (k, d), ``bend`` (k, d, d) the second one of half the
    squared distance, less one along each.
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
    def about(cls, problem: NearestProblem, away: Array, tensions: Array, rows: Rows) -> Curved:
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
