"""Commanded poses of the suite: along lines, rotated on the way, and at random."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from seecr.pose import Array, pose_add, quat_from_rotvec

if TYPE_CHECKING:
    from seecr.description.robot import Robot

N_SWEEP = 24
# The paper's trajectories (Fig 12): x from 0.17 to 0.63 m in the middle of the frame.
_SWEEP_X = (0.17, 0.63)
_SWEEP_Y = 0.25
SWEEP_Z = (0.1, 0.2)
# Inside DemoBot's frame of 0.80 x 0.50 x 0.50 m, with the platform clear of posts and exit points
# [m].
_FRAME = ((0.10, 0.10, 0.05), (0.70, 0.40, 0.35))
# Rotated sweeps: by up to this about each axis.
_SWEEP_TURN = np.deg2rad(6.0)
# Commands of the parallel DemoBot with two equilibria, 16 mm and 26 degrees or 5 mm and 19 degrees
# apart, by cable: these two were found among some 1,900 tilted by up to 40 degrees.
_TILTED = {
    "vectran": (0.351, 0.216, 0.109, 0.943, 0.163, -0.288, -0.038),
    "fishing": (0.189, 0.410, 0.143, 0.956, -0.218, 0.196, -0.001),
}
# Part of the distance from the reference position to the exit points that a user's robot covers.
_USER_REACH = 0.6
_USER_TURN = np.deg2rad(10.0)


def demobot_sweep(z: float, n: int = N_SWEEP) -> Array:
    """The paper's trajectory at height z [m], (n, 7): level, x from 0.17 to 0.63 m."""
    poses = np.zeros((n, 7))
    poses[:, 0] = np.linspace(*_SWEEP_X, n)
    poses[:, 1], poses[:, 2], poses[:, 3] = _SWEEP_Y, z, 1.0
    return poses


def demobot_turned_sweep() -> Array:
    """The same line between the two heights, (N_SWEEP, 7), with rotations commanded on the way."""
    poses = demobot_sweep(0.5 * sum(SWEEP_Z))
    angle = np.linspace(0.0, 2.0 * np.pi, len(poses))
    parts = [np.sin(angle), np.sin(angle + 1.0), np.cos(2.0 * angle)]
    poses[:, 3:] = quat_from_rotvec(_SWEEP_TURN * np.stack(parts, axis=1))
    return poses


def demobot_random(random: np.random.Generator, n: int, turn: float) -> Array:
    """Poses (n, 7) in DemoBot's frame, rotated by up to ``turn`` [rad]."""
    poses = np.zeros((n, 7))
    poses[:, :3] = random.uniform(*_FRAME, (n, 3))
    poses[:, 3:] = quat_from_rotvec(_turns(random, n, turn))
    return poses


def demobot_tilted(cable: str) -> Array:
    """The command (7,) at which the parallel DemoBot on that cable has two equilibria."""
    pose = np.array(_TILTED[cable])
    pose[3:] /= np.linalg.norm(pose[3:])
    return pose


def robot_sweep(robot: Robot, n: int = N_SWEEP) -> Array:
    """A level line (n, 7) through the reference pose, along the robot's widest direction."""
    exits, middle = robot.exit_points, robot.reference_pose[:3]
    spread = np.linalg.svd(_level(robot, exits - exits.mean(axis=0)), full_matrices=False)[2][0]
    along = (exits - middle) @ spread
    steps = np.linspace(_USER_REACH * min(along.min(), 0.0), _USER_REACH * max(along.max(), 0.0), n)
    poses = np.tile(robot.reference_pose, (n, 1))
    poses[:, :3] += steps[:, None] * spread
    return _reachable(robot, poses)


def robot_random(robot: Robot, random: np.random.Generator, n: int) -> Array:
    """Poses (n, 7) between the reference position and the exit points, slightly rotated.

    A convex combination of exit points lies in their hull, flat or not, and so does any point
    between it and the reference position if that does.
    """
    weights = random.dirichlet(np.full(robot.n_cables, 0.5), n)
    towards = weights @ robot.exit_points - robot.reference_pose[:3]
    change = np.zeros((n, 6))
    change[:, :3] = random.uniform(0.0, _USER_REACH, (n, 1)) * towards
    change[:, 3:] = _turns(random, n, _USER_TURN)
    poses = pose_add(np.tile(robot.reference_pose, (n, 1)), change)
    return _reachable(robot, poses)


def _turns(random: np.random.Generator, n: int, largest: float) -> Array:
    """Rotation vectors (n, 3) [rad] of random axes and angles up to the largest."""
    axes = random.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    # adding zero turns -0.0, which nobody wants to read, into 0.0
    return np.asarray(axes * random.uniform(0.0, largest, (n, 1))) + 0.0


def _level(robot: Robot, vectors: Array) -> Array:
    """Vectors (k, 3) without their component along gravity."""
    if not np.any(robot.gravity):
        return vectors
    return np.asarray(vectors - np.outer(vectors @ robot.up, robot.up))


def _reachable(robot: Robot, poses: Array) -> Array:
    """The poses (n, 7), or for a robot on joints the nearest that one Gauss-Newton step gives."""
    if not robot.joints:
        return poses
    from seecr.description.joints import motion_columns, pose_of_values
    from seecr.pose import pose_difference

    start, screws = pose_of_values(robot, np.zeros((1, len(robot.joints))))
    columns = motion_columns(screws, start[:, :3])[0]
    values = pose_difference(poses, start) @ np.linalg.pinv(columns).T
    return pose_of_values(robot, values)[0]
