"""The platform's motion from wanted poses: how far it is, and steps that are measured like that.

A distance is the norm of the displacement of the platform's origin and of its rotation vector times
the robot's length. The coordinates of a free platform are just these. Those of a platform on joints
are not: a hinge beside the origin also moves it, and slides behind a hinge turn. So searches for
those make steps along directions that are orthonormal as motions of the platform.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr.description.joints import freedoms
from seecr.description.robot import Robot
from seecr.parallel import in_parts
from seecr.pose import Array

Rows = NDArray[np.intp]

# Squared motion of a combination of joints, relative to the largest, that counts as none.
_IDLE = 1e-12
# A position that is kept may be off by this [robot's length].
_KEPT = 1e-8


@dataclass(frozen=True, eq=False)
class Directions:
    """Orthonormal directions of the platform's motion at k displacements.

    Attributes:
        basis: (k, d, d) displacements per step along each, in their columns; None for a free
            platform, whose coordinates they are.
        squares: (k, d, d) products of their motions: one along each, but where joints can be moved
            without the platform; None likewise.
        slope: (k, d) [m] derivative of half the squared distance along each.
    """

    basis: Array | None
    squares: Array | None
    slope: Array


@dataclass(frozen=True, eq=False)
class PlatformMotion:
    """Motions from n wanted poses; ``away`` (k, d) [m] are displacements along the coordinates.

    Attributes:
        poses: (n, 7) wanted. screws: (n, d, 7) the joints there; (n, 0, 7) for a free platform.
        free: (d,) how far each direction may be followed, 0 or infinity; those that move the
            origin come first.
        turns: independent rotations that keep the origin.
        steady: whether any rotation can keep the origin.
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
        return self._brought(away, rows, np.zeros((len(rows), 3)))[0]

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
        return self._brought(away, rows, places)[0] if self.steady else away

    def turned(self, away: Array, rows: Rows) -> Array:
        """(k, 3) [m] rotation vectors times the length; displacements if nothing can turn."""
        return self.apart(away, rows)[:, slice(3, 6) if self.robot.turns else slice(0, 3)]

    def _apart_and_columns(self, away: Array, rows: Rows) -> tuple[Array, Array]:
        """(k, 6) [m] from the wanted poses, and (k, d, 6) motion per step of each joint."""
        from seecr.compiled.joint_kinematics import apart_batch  # takes a while to import

        k, d = away.shape
        apart, columns = np.empty((k, 6)), np.empty((k, d, 6))
        moves, places = np.ascontiguousarray(away), np.ascontiguousarray(rows)

        def run(part: slice) -> None:
            apart_batch(
                self.screws, self.poses, places[part], moves[part], self.robot.length, apart[part],
                columns[part],
            )  # fmt: skip

        in_parts(run, k)
        return apart, columns

    def _brought(self, away: Array, rows: Rows, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Displacements (k, d) with origins at places (k, 3) [m], and whether they are there."""
        from seecr.compiled.joint_kinematics import bring_batch  # takes a while to import

        out, there = np.array(away, order="C"), np.empty(len(rows), dtype=np.bool_)
        of, to = np.ascontiguousarray(rows), np.ascontiguousarray(places)

        def run(part: slice) -> None:
            bring_batch(
                self.screws, self.poses, of[part], out[part], self.robot.length, to[part],
                there[part],
            )  # fmt: skip

        in_parts(run, len(rows))
        return out, there
