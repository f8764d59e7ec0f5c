"""Where a laboratory may send a robot: inside its frame, level, and with tensions near the usual.

Poses that are chosen or proposed are run as they are, so these are defaults; what is asked for
replaces them one by one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from crosscheck.planning.planned import NEAR_SLACK, Planned
from seecr.arguments import finite, numbers
from seecr.counted import between
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, pose_difference, transform_points
from seecr.units import millimetres, short

# Part of the frame's width that is kept free at each face: exit points carry pulleys and winches,
# and cables that leave along a face barely hold the platform away from it.
_MARGIN = 0.1
# Where nothing is known below home, poses go down by this part of the height above it.
_BELOW = 0.25
# A robot that carries a payload of its own weight pulls twice as much at the same poses: winches
# that cannot are too weak for any work.
_MOST = 2.0
# Twice the band in which a cable may switch, so that the way between two poses stays outside it.
_LEAST = 2.0 * NEAR_SLACK
# Points are in a plane, or on a line, if the others' directions extend by no more of the largest.
_FLAT = 1e-3
# A smaller rotation [rad] is no tilt, and needs no words: a degree.
_TURNED = np.radians(1.0)

Limits = tuple[float | None, float | None]
"""The lowest and the highest tension [N]; None for what follows from the usual tensions."""


@dataclass(frozen=True, eq=False)
class Room:
    """Where a robot may be sent.

    Attributes:
        robot: of any kind.
        points: (p, 3) [m] of the frame, which is their convex hull.
        normals: (k, 3) of its faces, outwards. most: (k,) [m] how far out anchor points go.
        limits: tensions that are asked for.
        tilt: [rad] of chosen poses; 0 for level ones.
        box: (2, 3) [m] lowest and highest position, if asked for.
    """

    robot: Robot
    points: Array
    normals: Array
    most: Array
    limits: Limits = (None, None)
    tilt: float = 0.0
    box: Array | None = None

    @classmethod
    def of(
        cls, robot: Robot, *, limits: ArrayLike | None = None, box: ArrayLike | None = None,
        tilt: float = 0.0, floor: float | None = None,
    ) -> Room:  # fmt: skip
        """The room of a robot, from what callers ask for.

        Args:
            robot: any.
            limits: lowest and highest tension [N]; None, also for one of them, for those that are
                near the usual ones.
            box: (2, 3) [m] lowest and highest position; then the frame has no margin.
            tilt: [rad] of poses, besides level ones.
            floor: [m] height along the direction against gravity; None for that of the file.

        Raises:
            InputError: other arguments, or that leave no room.
        """
        place, least = box_given(box), _floor_given(floor, robot)
        turn = finite(tilt, "tilt")
        if turn.shape or not 0.0 <= turn <= 0.5 * np.pi:
            raise InputError(f"tilt must be an angle from 0 to pi/2 [rad], got {tilt!r}")
        margin = _MARGIN if place is None else 0.0
        points = _frame(robot, least, margin)
        normals = _normals(points)
        out = points @ normals.T
        room = cls(
            robot, points, normals, out.max(axis=0), limits_given(limits), float(turn), place
        )
        home = room._out(robot.reference_pose[None])[0]
        # a face outside of which the platform is anyway does not confine it
        most = np.where(home > room.most, np.inf, room.most - margin * np.ptp(out, axis=0))
        return replace(room, most=np.maximum(most, home))

    def around(self, poses: Array, turning: bool = False) -> Room:
        """The room that has place for some poses (n, 7), too: where the robot goes anyway.

        If ``turning``, new ones may be tilted as far as these are.
        """
        there = np.max(self._out(poses), axis=0, initial=-np.inf)
        tilt = self.tilt
        if turning and len(poses):
            level = np.tile(self.robot.reference_pose, (len(poses), 1))
            turned = np.linalg.norm(pose_difference(poses, level)[:, 3:], axis=1).max()
            tilt = max(tilt, turned if turned > _TURNED else 0.0)
        return replace(self, most=np.maximum(self.most, there), tilt=float(tilt))

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """(n,) the poses (n, 7) that are inside, with all anchor points; NaN is not."""
        inside = self._out(poses) <= self.most + 1e-9 * self.robot.reach
        return np.asarray(inside.all(axis=1) & np.isfinite(poses).all(axis=1))

    def extent(self, axes: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Lowest and highest position (3,) [m] of the level platform inside, between two others.

        Args:
            axes: (3, 3) as columns, along which all these are.
        """
        from scipy import optimize  # takes a while to import

        level = np.append(np.zeros(3), self.robot.reference_pose[3:])
        ends = np.isfinite(self.most)
        upper = (self.most - self._out(level[None])[0])[ends]
        edges = list(zip(low, high, strict=True))
        out = [
            optimize.linprog(sign * way, self.normals[ends] @ axes, upper, bounds=edges)
            for sign in (1.0, -1.0) for way in np.eye(3)
        ]  # fmt: skip
        if not all(found.success for found in out):  # nothing is inside
            return low, high
        first, last = np.array([found.x[k % 3] for k, found in enumerate(out)]).reshape(2, 3)
        inward = 1e-6 * (last - first)  # rounding must not lose the outermost
        return first + inward, last - inward

    def _out(self, poses: Array) -> Array:
        """(n, k) how far out the platform is along each normal."""
        points = transform_points(poses, self.robot.anchor_points)
        return np.asarray((points @ self.normals.T).max(axis=1))

    def may_run(
        self, found: Planned, good: NDArray[np.bool_], usual: float, enough: int
    ) -> NDArray[np.bool_]:
        """(n,) the good rows at which the robot may rest: in the room, with tensions within limits.

        Args:
            found: candidates. good: (n,) of them. usual: tension [N], see :func:`usual_tension`.
            enough: if so many are left, they are those at which all cables pull with a margin. A
                lowest tension that was asked for holds for all.
        """
        rest, (low, high) = found.base.prediction, self.limits
        pulls = rest.tensions[:, self.robot.driven]
        least, most = pulls.min(axis=1, initial=np.inf), pulls.max(axis=1, initial=0.0)
        good = good & found.problem.use & self.holds(rest.pose)
        good &= most <= (_MOST * usual if high is None else high)
        if low is not None:
            return np.asarray(good & (least >= low))
        taut = good & (least >= _LEAST * usual)
        return np.asarray(taut if taut.sum() >= enough else good)

    def allows(self, added: Planned) -> bool:
        """Whether no row exceeds the highest tension that was asked for, as a payload may do."""
        high, use = self.limits[1], added.problem.use
        pulls = added.base.prediction.tensions[use][:, self.robot.driven]
        return high is None or bool((pulls <= high).all())

    @property
    def bounds(self) -> tuple[float, float]:
        """The lowest and highest tension that balance may use: those asked for."""
        low, high = self.limits
        return low or 0.0, np.inf if high is None else high


def usual_tension(found: Planned, some: NDArray[np.bool_] | None = None) -> float:
    """The usual tension [N]: the median over (some) poses of that of the tightest driven cable."""
    use = found.problem.use if some is None else found.problem.use & some
    pulls = found.base.prediction.tensions[use][:, found.problem.robot.driven]
    return float(np.median(pulls.max(axis=1, initial=0.0))) if len(pulls) else 0.0


def _frame(robot: Robot, floor: float | None, margin: float) -> Array:
    """Points (p, 3) [m] of the frame: the exit points, and those straight below them.

    These are on the floor, as low as the lowest exit point, or a little below home if all exit
    points are above that.
    """
    exits, up = robot.exit_points, robot.up
    heights, home = exits @ up, float(robot.reference_pose[:3] @ up)
    bottom, above = float(heights.min()), float(heights.max()) - home
    if floor is not None:
        bottom = max(floor, bottom) if bottom < home else floor
    elif bottom > home:  # so that _BELOW is left of it within the margin
        bottom = home - (_BELOW + margin) / (1.0 - margin) * above
    under = exits + np.outer(bottom - heights, up)
    return np.concatenate([np.where((heights > bottom)[:, None], exits, under), under])


def _normals(points: Array) -> Array:
    """Normals (k, 3) of the faces of the convex hull of points.

    Where that has no extent, as the thickness of a planar robot, it has no faces: there joints or
    cables decide.
    """
    _left, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    axes = axes[spread > _FLAT * spread[0]]
    if len(axes) > 1:
        flat = points @ axes.T
        return np.asarray(np.unique(ConvexHull(flat).equations[:, :-1].round(9), axis=0) @ axes)
    return np.concatenate([axes, -axes])


def box_given(box: ArrayLike | None) -> Array | None:
    """A box (2, 3) [m], the lowest position first, or None."""
    if box is None:
        return None
    array = finite(box, "box")
    if array.shape != (2, 3):
        raise InputError(
            f"box must be (2, 3) [m], the lowest and the highest x y z, got {array.shape}"
        )
    if np.any(array[0] > array[1]):
        k = int(np.argmax(array[0] > array[1]))
        raise InputError(
            f"box: expected the lowest position first, got {'xyz'[k]} from {array[0, k]:g} to "
            f"{array[1, k]:g} m"
        )
    return array


def limits_given(limits: ArrayLike | None) -> Limits:
    """The lowest and the highest tension [N], each None if it is not given."""
    if limits is None:
        return None, None
    own = np.array(limits, dtype=object)
    if own.shape != (2,):
        raise InputError(
            f"limits must be two numbers, the lowest and the highest tension [N], got {limits!r}"
        )
    missing = [one is None for one in own]
    low, high = numbers(np.where(missing, [0.0, np.inf], own).tolist(), "limits").tolist()
    if not 0.0 <= low <= high or low == np.inf:
        raise InputError(
            f"limits must be 0 <= lowest <= highest [N], lowest finite, got {low:g} and {high:g}"
        )
    return None if missing[0] else low, None if missing[1] else high


def _floor_given(floor: float | None, robot: Robot) -> float | None:
    """The height [m] of the floor; None if there is none."""
    if floor is None:
        return robot.floor if robot.up[2] == 1.0 else None  # it is a height along z
    height, home = finite(floor, "floor"), float(robot.reference_pose[:3] @ robot.up)
    if height.shape or height > home:
        raise InputError(
            f"floor must be a height below the reference pose, {home:g} m, got {floor!r}"
        )
    return float(height)


@dataclass(frozen=True)
class Demand:
    """What poses demand of the robot.

    Attributes:
        tensions_N: lowest and highest. off_m: largest distance from the command; None if lengths
            are commanded. turned_rad: largest rotation from it, likewise.
    """

    tensions_N: tuple[float, float]
    off_m: float | None = None
    turned_rad: float | None = None

    @classmethod
    def of(cls, found: Planned, rows: NDArray[Any] | slice = slice(None)) -> Demand | None:
        """That of some rows of a plan; None where none of them is at rest."""
        use, rest = found.problem.use[rows], found.base.prediction
        if not use.any():
            return None
        pulls, told = rest.tensions[rows][use], found.problem.data.command_pose
        limits = float(pulls.min()), float(pulls.max())
        if told is None:
            return cls(limits)
        away = pose_difference(rest.pose[rows][use], told[rows][use]).reshape(-1, 2, 3)
        off, turned = np.linalg.norm(away, axis=2).max(axis=0).tolist()
        return cls(limits, off, turned)

    @property
    def words(self) -> str:
        """One line."""
        words = f"tensions {between(*self.tensions_N)} N"
        if self.off_m is not None and self.turned_rad is not None:
            words += f", up to {millimetres(self.off_m, 2)} off the command"
            if self.turned_rad > _TURNED:
                words += f" and turned by up to {short(np.degrees(self.turned_rad), 2)} deg"
        return words
