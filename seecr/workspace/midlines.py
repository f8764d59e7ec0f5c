"""The paper's points V and H of a robot on two pairs of parallel cables (Figs 7 to 9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.planar import midline_point
from seecr.pose import Array, transform_points
from seecr.result import Record, Result, named, rows_of
from seecr.statics.solution import Solution, check_solution

__all__ = ["Midlines", "midline_points"]

# Points are in a plane, and cables parallel, to within this part of the robot's length, or sine.
_OFF = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Midlines(Result):
    """Where the midlines of both pairs of cables meet, at n poses.

    Attributes:
        name: "V" if the cables of each pair are one above the other, "H" if they are side by side,
            "" otherwise.
        axes: names of the two axes of the robot's plane, such as "xz".
        points: (n, 3) [m] in the base frame; infinite where the midlines are parallel, NaN where
            the platform does not rest.
        beside: (n,) [m] how far the point is beside the vertical through the centre of mass,
            towards the first horizontal axis. Equal tensions in each pair need zero.
    """

    name: str
    axes: str
    points: Array
    beside: Array

    def lines(self) -> list[str]:
        """One line: where the point is, and how far beside the line of the weight."""
        known = np.isfinite(self.beside)
        of = f"point {self.name}" if self.name else "the point where midlines meet"
        if not known.any():
            return [f"{of} is nowhere: the midlines of both pairs of cables do not meet"]
        first, *_, last = (self._place(k) for k in np.flatnonzero(known)[[0, 0, -1]])
        where = f"is at {first}" if first == last else f"goes from {first} to {last}"
        beside = 1e3 * self.beside[known]
        low, high = (round(float(end), 6) + 0.0 for end in (beside.min(), beside.max()))
        if high - low > 0.01:  # the extremes need not be at the ends
            far = f"; on the way it is between {low:+.2f} and {high:+.2f} mm"
        else:
            far = f", {high:+.2f} mm"
        return [f"{of} {where} mm{far} beside the line of the weight"]

    def _place(self, row: int) -> str:
        point = [self.points[row]["xyz".index(axis)] for axis in self.axes]
        return f"{' '.join(self.axes)} {' '.join(f'{1e3 * part + 0.0:.2f}' for part in point)}"

    def records(self) -> Sequence[Record]:
        """One row per pose."""
        return rows_of({**named("{}_m", "xyz", self.points), "beside_m": self.beside})


def midline_points(solution: Solution) -> Midlines | None:
    """The point V or H at each pose of a planar robot on two pairs of parallel cables (Fig 9).

    Cables 1 and 2 are one pair, 3 and 4 the other; the cables of a pair are parallel at the
    reference pose. The points are those of the robot as described, without effects.

    Args:
        solution: n poses.

    Returns:
        the points, or None for any other robot.

    Raises:
        InputError: not a solution.
    """
    check_solution(solution)
    robot = solution.robot
    plane = _plane(robot)
    if plane is None:
        return None
    anchors = transform_points(solution.pose, robot.anchor_points)
    exits = np.broadcast_to(robot.exit_points, anchors.shape)
    met = midline_point(exits[..., plane], anchors[..., plane])
    out = np.zeros((len(met), 3))
    out[:] = robot.exit_points[0]
    out[:, plane] = met
    along = int(plane[np.argmin(np.abs(robot.up[plane]))])
    centre = transform_points(solution.pose, robot.centre_of_mass[None])[:, 0]
    with np.errstate(invalid="ignore"):
        beside = (out - centre)[:, along]
    return Midlines(_name(robot), "".join("xyz"[k] for k in plane), out, beside)


def _plane(robot: Robot) -> NDArray[np.intp] | None:
    """The two axes of the robot's plane, if it is upright and its cables are parallel in pairs."""
    if robot.n_cables != 4:
        return None
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    points = np.concatenate([robot.exit_points, anchors])
    plane = np.flatnonzero(np.ptp(points, axis=0) > _OFF * robot.length)
    if len(plane) != 2 or np.abs(robot.up[plane]).max() < 1.0 - _OFF or _turns_out(robot, plane):
        return None
    ways = (anchors - robot.exit_points)[:, plane]
    size = np.linalg.norm(ways, axis=1, keepdims=True)
    if np.any(size == 0.0):
        return None
    ways /= size
    return plane if np.abs(ways[0::2] - ways[1::2]).max() <= _OFF else None


def _turns_out(robot: Robot, plane: NDArray[np.intp]) -> bool:
    """Whether the platform can leave the plane: only joints keep it there."""
    off = np.setdiff1d(np.arange(3), plane)[0]
    slides = [abs(j.axis[off]) for j in robot.joints if j.kind == "slide"]
    hinges = [1.0 - abs(j.axis[off]) for j in robot.joints if j.kind == "hinge"]
    return not robot.joints or max([*slides, *hinges]) > _OFF


def _name(robot: Robot) -> str:
    apart = robot.exit_points[0::2] - robot.exit_points[1::2]
    upright = np.abs(apart @ robot.up)
    size = np.linalg.norm(apart, axis=1)
    if np.all(upright > (1.0 - _OFF) * size):
        return "V"
    return "H" if np.all(upright < _OFF * size) else ""
