"""Robots that are a bar on two cables, and the paper's points V and H of parallel pairs.

They are one tilt, or a few, for each place of the bar's middle: the paper's solution manifold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate, transform_points
from seecr.result import COORDINATES, Record, Result, named, rows_of
from seecr.statics.solution import Solution, check_solution
from seecr.statics.starts import commanded_poses
from seecr.workspace.planar import BarRest, bar_equilibria, bar_tilt, midline_point

# Points are in a plane, and the weight in the bar's middle, to this part of the robot's length.
_OFF = 1e-9
# A pose is one of the equilibria if its tilt is within this of it [rad].
_ALIKE = 1e-7
_POSITIVE = "positive: the second cable's end is up"
# Tilts that differ by less than this are alike but for rounding [deg].
_ROUNDED = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class BarBalance(Result):
    """An equilibrium of a robot that is a bar on two cables, with its middle at a given place.

    Attributes:
        pose: (7,) of the platform.
        theta: tilt [rad] from the horizontal, upwards towards the end of the second cable.
        tensions: (2,) [N]; negative for a cable that would have to push.
        stable: as :class:`BarRest` says: for cables that do not stretch.
        here: whether it is the pose that was asked about.
    """

    pose: Array
    theta: float
    tensions: Array
    stable: bool
    here: bool

    def lines(self) -> list[str]:
        """One line: tilt, tensions and stability."""
        pulls = " and ".join(f"{value:.4g}" for value in self.tensions)
        pushes = " (a cable would have to push)" if np.any(self.tensions < 0.0) else ""
        return [
            f"tilt {np.degrees(self.theta):+.4f} deg: {'stable' if self.stable else 'not stable'}, "
            f"tensions {pulls} N{pushes}{', as it rests here' if self.here else ''}"
        ]

    def as_json(self) -> Record:
        """One entry of ``bar`` in ``pose.json``."""
        return {
            "theta_rad": self.theta,
            "pose": self.pose,
            "tensions_N": self.tensions,
            "stable": self.stable,
            "here": self.here,
        }

    def records(self) -> Sequence[Record]:
        """One row."""
        return [
            {
                "theta_rad": self.theta,
                **named("{}", COORDINATES, self.pose),
                **named("tension_{}_N", ("1", "2"), self.tensions),
                "stable": self.stable,
                "here": self.here,
            }
        ]


def bar_balances(robot: GivenRobot, pose: ArrayLike) -> tuple[BarBalance, ...] | None:
    """All equilibria of a bar on two cables with its middle where it is at a pose.

    They are those of :func:`seecr.bar_equilibria`, for cables that do not stretch. How cables
    stretch only decides which rest lengths lead to a place: elastic cables hold it with the same
    tilt and tensions.

    Args:
        robot: as described, or its MJCF.
        pose: (7,); only the place of the bar's middle counts.

    Returns:
        the equilibria by ascending tilt; None for a robot that is no such bar: it needs two cables,
        joints that keep it in an upright plane, and its centre of mass half way between its anchor
        points.

    Raises:
        InputError: a wrong shape, or a quaternion that is no rotation.

    Example:
        ``seecr.bar_balances("planar_two_cable", solution.pose[0])``
    """
    robot = robot_of(robot)
    places = commanded_poses(pose, robot=robot)
    if len(places) != 1:
        raise InputError(f"bar_balances needs one pose (7,), got {len(places)}")
    across = _across(robot)
    if across is None:
        return None
    exits, (middle,), half, (now,) = _in_plane(robot, places, across)
    ends = transform_points(places, robot.anchor_points)[0]
    rests = bar_equilibria(exits, middle, half)
    return tuple(_balance(robot, r, places[0], ends.mean(axis=0), now, across) for r in rests)


@dataclass(frozen=True, eq=False, repr=False)
class BarManifold(Result):
    """A bar on two cables beside the paper's manifold, at n poses (Figs 3 and 4).

    Tilts are from the horizontal, upwards towards the end of the second cable [rad], and NaN where
    the bar does not rest, or where no tilt is stable.

    Attributes:
        tilt: (n,) with which the bar rests.
        there: (n,) of the manifold where its middle rests: of the stable tilts the nearest.
        at_command: (n,) of the manifold where its middle was commanded to: the most level one; NaN
            where lengths were commanded.
    """

    tilt: Array
    there: Array
    at_command: Array

    def lines(self) -> list[str]:
        """The tilts and how far they are off the manifold; and those of it at the commands."""
        out, known = [], np.isfinite(self.tilt)
        if known.any():
            out.append(f"the bar is tilted by {_range(self.tilt[known])} deg ({_POSITIVE})")
            off = _apart(self.tilt, self.there)[known]
            if np.isfinite(off).any():
                most = float(np.degrees(np.nanmax(off)))
                near = "to rounding" if most < _ROUNDED else f"to within {most:.2g} deg"
                out[0] += f", on the manifold of its equilibria {near}"
        asked = self.at_command[np.isfinite(self.at_command)]
        if len(asked):
            out.append(f"to rest where it was commanded to it would tilt by {_range(asked)} deg")
        return out

    def records(self) -> Sequence[Record]:
        """One row per pose."""
        return rows_of(
            {
                "tilt_rad": self.tilt,
                "manifold_there_rad": self.there,
                "manifold_at_command_rad": self.at_command,
            }
        )


def bar_manifold(solution: Solution, commanded: bool = True) -> BarManifold | None:
    """How a bar on two cables rests beside the tilts at which it is in balance (Figs 3 and 4).

    The manifold is that of the robot as described, see :func:`bar_balances`.

    Args:
        solution: n poses.
        commanded: whether poses were commanded, and not lengths.

    Returns:
        the tilts, or None for a robot that is no such bar.

    Raises:
        InputError: not a solution.

    Example:
        ``seecr.bar_manifold(seecr.solve("planar_two_cable", bars))``
    """
    check_solution(solution)
    robot = solution.robot
    across = _across(robot)
    if across is None:
        return None
    poses = np.where(solution.converged[:, None], solution.pose, np.nan)
    exits, middles, half, tilt = _in_plane(robot, poses, across)
    there = np.full(len(tilt), np.nan)
    for k in np.flatnonzero(np.isfinite(tilt)):
        rests = bar_equilibria(exits, middles[k], half)
        stable = np.array([rest.theta for rest in rests if rest.stable])
        if len(stable):
            there[k] = stable[np.argmin(_apart(stable, tilt[k]))]
    asked = np.full(len(tilt), np.nan)
    known = np.isfinite(solution.command).all(axis=1) & commanded
    places = _in_plane(robot, solution.command[known], across)[1]
    asked[known] = bar_tilt(exits, places, half)
    return BarManifold(tilt, there, asked)


def _in_plane(robot: Robot, poses: Array, across: Array) -> tuple[Array, Array, float, Array]:
    """Exit points (2, 2), the bar's middles (n, 2), half its length, and its tilts (n,) at poses.

    The plane's axes are ``across`` and up.
    """
    plane = np.stack([across, robot.up])
    ends = transform_points(poses, robot.anchor_points) @ plane.T
    half = 0.5 * float(np.linalg.norm(np.diff(robot.anchor_points, axis=0)))
    along = ends[:, 1] - ends[:, 0]
    return (
        robot.exit_points @ plane.T,
        ends.mean(axis=1),
        half,
        np.arctan2(along[:, 1], along[:, 0]),
    )


def _apart(one: Array, other: Array) -> Array:
    """How far tilts [rad] are apart, the short way round."""
    return np.asarray(np.abs(np.angle(np.exp(1j * (one - other)))))


def _range(angles: Array) -> str:
    """The smallest and largest of angles [rad] in degrees, or the one that they all are."""
    low, high = (round(float(end), 2) + 0.0 for end in np.degrees([angles.min(), angles.max()]))
    return f"{low:+.2f} to {high:+.2f}" if high > low else f"{high:+.2f}"


def _balance(
    robot: Robot, rest: BarRest, pose: Array, middle: Array, now: float, across: Array
) -> BarBalance:
    turn = float(np.arctan2(np.sin(rest.theta - now), np.cos(rest.theta - now)))
    rotation = quat_from_rotvec(turn * np.cross(across, robot.up))
    place = middle + quat_rotate(rotation, pose[:3] - middle)
    turned = np.concatenate([place, quat_multiply(rotation, pose[3:])])
    pulls = robot.weight * np.array(rest.tensions)
    return BarBalance(turned, rest.theta, pulls, rest.stable, abs(turn) < _ALIKE)


def _across(robot: Robot) -> Array | None:
    """The horizontal (3,) of the bar's plane, towards its second end; None if it is no bar."""
    if robot.n_cables != 2 or not robot.all_driven or robot.weight == 0.0 or not robot.joints:
        return None
    ends = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    hinges = [joint.axis for joint in robot.joints if joint.kind == "hinge"]
    slides = [joint.axis for joint in robot.joints if joint.kind == "slide"]
    room = _OFF * robot.length
    if len(hinges) != 1 or abs(float(hinges[0] @ robot.up)) > _OFF:
        return None
    normal = hinges[0]
    across = np.cross(robot.up, normal)
    if (ends[1] - ends[0]) @ across < 0.0:
        across = -across
    points = np.concatenate([robot.exit_points, ends])
    flat = np.ptp(points @ normal) <= room and all(abs(s @ normal) <= _OFF for s in slides)
    apart = [np.linalg.norm(np.diff(pair, axis=0)) for pair in (robot.exit_points, ends)]
    centred = np.linalg.norm(robot.centre_of_mass - robot.anchor_points.mean(axis=0)) <= room
    free = np.linalg.matrix_rank(np.array(slides)) == 2 if slides else False
    return across if flat and free and centred and min(apart) > room else None


# The paper's points V and H of a robot on two pairs of parallel cables (Figs 7 to 9).

# Points are in a plane, and cables parallel, to within this part of the robot's length, or sine.
_OFF_PLANE = 1e-9


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

    Example:
        ``seecr.midline_points(solution)``
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
    if robot.n_cables != 4 or not robot.all_driven:
        return None
    anchors = transform_points(robot.reference_pose[None], robot.anchor_points)[0]
    points = np.concatenate([robot.exit_points, anchors])
    plane = np.flatnonzero(np.ptp(points, axis=0) > _OFF_PLANE * robot.length)
    if (
        len(plane) != 2
        or np.abs(robot.up[plane]).max() < 1.0 - _OFF_PLANE
        or _turns_out(robot, plane)
    ):
        return None
    ways = (anchors - robot.exit_points)[:, plane]
    size = np.linalg.norm(ways, axis=1, keepdims=True)
    if np.any(size == 0.0):
        return None
    ways /= size
    return plane if np.abs(ways[0::2] - ways[1::2]).max() <= _OFF_PLANE else None


def _turns_out(robot: Robot, plane: NDArray[np.intp]) -> bool:
    """Whether the platform can leave the plane: only joints keep it there."""
    off = np.setdiff1d(np.arange(3), plane)[0]
    slides = [abs(j.axis[off]) for j in robot.joints if j.kind == "slide"]
    hinges = [1.0 - abs(j.axis[off]) for j in robot.joints if j.kind == "hinge"]
    return not robot.joints or max([*slides, *hinges]) > _OFF_PLANE


def _name(robot: Robot) -> str:
    apart = robot.exit_points[0::2] - robot.exit_points[1::2]
    upright = np.abs(apart @ robot.up)
    size = np.linalg.norm(apart, axis=1)
    if np.all(upright > (1.0 - _OFF_PLANE) * size):
        return "V"
    return "H" if np.all(upright < _OFF_PLANE * size) else ""
