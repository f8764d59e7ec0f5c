"""Residual and stability of a solution, computed again with plain NumPy and SciPy.

This shares no code with the solver: forces from the points and rest lengths of straight cables, the
stiffness by differences of them, joints as a product of their motions. Points, lengths and loads
are those of the solution's own set-up, as effects edited it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from seecr.compiled import columns as at
from seecr.counted import counted, rows_words
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array
from seecr.result import Record, Result, rows_of

if TYPE_CHECKING:
    from seecr.statics.solution import Solution

# Unbalanced force of an equilibrium relative to the largest force: what ten digits of a pose leave
# on a stiff robot.
_BALANCED = 1e-7
# Steps of differences, in lengths of the robot and radians: a tenth of a micrometre to micrometres.
_STEP = 1e-5
# A stiffness below this part of the largest is what differences leave of zero.
_NOTHING = 1e-6
# What a cable may have besides a straight law, by column, and what that is called.
_MORE = {
    at.RADIUS: "pulleys", at.COMPLIANCE: "yielding exit points", at.LIFT: "yielding exit points",
    at.WINCH_SIDE: "cable behind the exit point", at.WEIGHT: "cable weight", at.CREEP: "creep",
    at.CREEP_RATE: "creep", at.HYSTERESIS: "hysteresis", at.FRICTION: "friction",
    at.EXTRA: "a law of its own", at.EXTRA_SLOPE: "a law of its own",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Result):
    """What plain NumPy finds at the poses of a solution.

    Attributes:
        residual: (n,) unbalanced force, or torque over the robot's length, along what the joints
            allow, relative to the largest tension, weight or external force; NaN if not computed.
        smallest_eigenvalue: (n,) [N/m] of the stiffness, as that of the solution.
        holds: (n,) bool, in balance and stable.
        why_not: (n,) what keeps a row from being verified; "" if nothing does.
        line: (n,) line of each command in its file; None without a file.
    """

    residual: Array
    smallest_eigenvalue: Array
    holds: NDArray[np.bool_]
    why_not: tuple[str, ...]
    line: NDArray[np.int64] | None = None

    @property
    def verified(self) -> NDArray[np.bool_]:
        """(n,) bool, the row was computed again."""
        return np.array([not why for why in self.why_not], dtype=bool)

    def lines(self) -> list[str]:
        """How many poses hold, the numbers, which do not, and which could not be verified."""
        n, done = len(self.holds), self.verified
        out = [f"{int(self.holds.sum())} of {counted(n, 'pose')} verified: at rest and stable"]
        if done.any():
            out.append(
                f"forces balance to {self.residual[done].max():.1g} of the largest; smallest "
                f"stiffness {self.smallest_eigenvalue[done].min():.4g} N/m"
            )
        for k in np.flatnonzero(done & ~self.holds):
            out.append(
                f"{rows_words([int(k)], self.line)} does not hold: unbalanced "
                f"{self.residual[k]:.2g}, smallest stiffness {self.smallest_eigenvalue[k]:.4g} N/m"
            )
        for why in dict.fromkeys(filter(None, self.why_not)):
            rows = [k for k, one in enumerate(self.why_not) if one == why]
            out.append(f"{rows_words(rows, self.line)} not verified: {why}")
        return out

    def records(self) -> list[Record]:
        """One row per pose."""
        return rows_of({
            "residual": self.residual, "smallest_eigenvalue_N_per_m": self.smallest_eigenvalue,
            "holds": self.holds, "why_not": self.why_not,
        })  # fmt: skip


def verification_of(solution: Solution) -> Verification:
    """Compute residual and smallest stiffness of each row again; see :class:`Verification`."""
    n, robot = len(solution), solution.robot
    residual, least, why_not = np.full(n, np.nan), np.full(n, np.nan), [""] * n
    stable = np.zeros(n, dtype=bool)
    for k in range(n):
        cables, load, pose = solution.tables.cables[k], solution.tables.load[k], solution.pose[k]
        more = dict.fromkeys(name for column, name in _MORE.items() if np.any(cables[:, column]))
        if not np.isfinite(pose).all():
            why_not[k] = "it has no pose"
        elif more:
            why_not[k] = f"cables with {', '.join(more)}; only straight ones are computed again"
        else:
            try:
                residual[k], least[k], stable[k] = _checked(robot, cables, load, pose)
            except InputError as error:
                why_not[k] = str(error)
    return Verification(
        residual, least, (residual < _BALANCED) & stable, tuple(why_not), solution.line
    )


def _checked(robot: Robot, cables: Array, load: Array, pose: Array) -> tuple[float, float, bool]:
    """Residual, smallest eigenvalue [N/m] and stability at a pose (7,)."""
    frame_at = _motion_of(robot, pose)
    d, size = len(robot.joints) or 6, np.repeat([1.0, robot.length], 3)
    unit = np.where(robot.hinges, robot.length, 1.0) if robot.joints else size
    step = _STEP * robot.length / unit

    def motions(q: Array) -> Array:
        """(d, 6) motion of the platform by each coordinate: of its origin, and rotation."""
        out = []
        for k in range(d):
            ends = [frame_at(q + sign * step[k] * np.eye(d)[k]) for sign in (1.0, -1.0)]
            spin = Rotation.from_matrix(ends[0][0] @ ends[1][0].T).as_rotvec()
            out.append(np.append(ends[0][1] - ends[1][1], spin) / (2.0 * step[k]))
        return np.array(out)

    def force(q: Array) -> Array:
        return (motions(q) @ _wrench(*frame_at(q), cables, load)[0]) / unit

    zero = np.zeros(d)
    scale = _wrench(*frame_at(zero), cables, load)[1]
    rows = [force(step[k] * one) - force(-step[k] * one) for k, one in enumerate(np.eye(d))]
    stiffness = -np.array(rows) / (2.0 * step * unit)[:, None]
    scaled = motions(zero) * size / unit[:, None]
    half = np.linalg.inv(np.linalg.cholesky(scaled @ scaled.T))
    values = np.linalg.eigvalsh(half @ (0.5 * (stiffness + stiffness.T)) @ half.T)
    off = float(np.abs(force(zero)).max())
    return off / scale, float(values[0]), bool(values[0] > _NOTHING * values[-1])


def _wrench(turn: Array, place: Array, cables: Array, load: Array) -> tuple[Array, float]:
    """Force and moment (6,) about the platform's origin, and the largest single force [N]."""
    arms = cables[:, at.ANCHOR : at.ANCHOR + 3] @ turn.T
    way = cables[:, at.EXIT : at.EXIT + 3] - (place + arms)
    length, rest = np.linalg.norm(way, axis=1), cables[:, at.REST]
    strain = np.maximum(length - rest, 0.0) / rest
    law = strain + cables[:, at.QUADRATIC] * strain**2 + cables[:, at.CUBIC] * strain**3
    pulls = (cables[:, at.EA] * law / length)[:, None] * way
    weight, centre, outer, moment = (
        load[first : first + 3]
        for first in (at.FORCE_OF_WEIGHT, at.CENTRE_OF_MASS, at.EXTERNAL_FORCE, at.EXTERNAL_MOMENT)
    )
    torque = np.cross(arms, pulls).sum(axis=0) + np.cross(turn @ centre, weight) + moment
    forces = [*pulls, weight, outer]
    return np.append(sum(forces), torque), max(float(np.linalg.norm(one)) for one in forces)


def _motion_of(robot: Robot, pose: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Orientation (3, 3) and position (3,) as a function of coordinates (d,), zero at the pose."""
    home, (turn, place) = (
        (Rotation.from_quat(one[[4, 5, 6, 3]]).as_matrix(), one[:3])
        for one in (robot.reference_pose, pose)
    )
    if not robot.joints:
        return lambda q: (Rotation.from_rotvec(q[3:]).as_matrix() @ turn, place + q[:3])

    def chain(q: Array) -> tuple[Array, Array]:
        """The motions of the joints one after the other, the last one first (Brockett 1984)."""
        frame, origin = home
        for joint, value in zip(reversed(robot.joints), q[::-1], strict=True):
            if joint.kind == "slide":
                origin = origin + value * joint.axis
            else:
                about = Rotation.from_rotvec(value * joint.axis).as_matrix()
                frame, origin = about @ frame, joint.point + about @ (origin - joint.point)
        return frame, origin

    def off(q: Array) -> Array:
        frame, origin = chain(q)
        return np.append(origin - place, robot.length * (frame - turn).ravel())

    values = np.zeros(len(robot.joints))
    for _ in range(50):  # Gauss-Newton; a few rounds from home
        slope = np.array([off(values + 1e-6 * one) - off(values) for one in np.eye(len(values))])
        values = values - np.linalg.lstsq(slope.T / 1e-6, off(values), rcond=None)[0]
    if np.abs(off(values)).max() > 1e-9 * robot.reach:
        raise InputError("no joint values lead to its pose")
    return lambda q: chain(values + q)
