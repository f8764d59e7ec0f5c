"""All equilibria of a robot that is a bar on two cables, in closed form (paper, Figs 2 to 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seecr.description.given import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.planar import BarRest, bar_equilibria
from seecr.pose import Array, quat_from_rotvec, quat_multiply, quat_rotate, transform_points
from seecr.result import COORDINATES, Record, Result, named
from seecr.statics.starts import commanded_poses

__all__ = ["BarBalance", "bar_balances"]

# Points are in a plane, and the weight in the bar's middle, to this part of the robot's length.
_OFF = 1e-9
# A pose is one of the equilibria if its tilt is within this of it [rad].
_ALIKE = 1e-7


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
    """
    robot = robot_of(robot)
    places = commanded_poses(pose)
    if len(places) != 1:
        raise InputError(f"bar_balances needs one pose (7,), got {len(places)}")
    across = _across(robot)
    if across is None:
        return None
    plane = np.stack([across, robot.up])
    ends = transform_points(places, robot.anchor_points)[0]
    middle, bar = 0.5 * (ends[0] + ends[1]), ends[1] - ends[0]
    half = 0.5 * float(np.linalg.norm(bar))
    now = float(np.arctan2(bar @ robot.up, bar @ across))
    rests = bar_equilibria(robot.exit_points @ plane.T, plane @ middle, half)
    return tuple(_balance(robot, rest, places[0], middle, now, across) for rest in rests)


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
    if robot.n_cables != 2 or robot.weight == 0.0 or not robot.joints:
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
