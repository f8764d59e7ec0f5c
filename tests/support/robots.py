"""Small robots whose answers can be told by hand, and the same robot described in other ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.description.mjcf import load_robot
from seecr.description.robot import Joint, Robot
from seecr.pose import quat_from_rotvec, quat_multiply, quat_to_matrix

RECTANGLE = Robot(
    name="rectangle",
    exit_points=np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]]),
    anchor_points=np.array([[-0.3, -0.4, 0], [0.3, -0.4, 0], [0.3, 0.4, 0], [-0.3, 0.4, 0]]),
    ea=np.full(4, 1000.0),
    rest_lengths=np.full(4, 2.5),
    mass=2.0,
    gravity=np.array([0.0, 0.0, -10.0]),
    reference_pose=np.array([1.5, 2.0, -1.5, 1.0, 0.0, 0.0, 0.0]),
)
"""Four cables of 2.5 m from the corners of a ceiling of 3 m x 4 m to those of a platform.

The frame is 5 m across, its platform 1 m, which makes its characteristic length 0.5 m. It weighs
20 N.
"""

_HOME = np.array([0.75, 0.0, 0.5])
_TURNS = (("slide", "x", 0), ("slide", "z", 2), ("hinge", "ry", 1))

THREE = Robot(
    name="three", mass=2.0, ea=np.full(3, 7520.0), rest_lengths=np.array([0.94, 0.94, 0.765]),
    exit_points=np.array([[0, 0, 1.2], [1.5, 0, 1.2], [0.75, 0, -0.3]]),
    anchor_points=np.array([[-0.08, 0, 0.03], [0.08, 0, 0.03], [0, 0, -0.03]]),
    reference_pose=np.array([*_HOME, 1, 0, 0, 0]), inertia=0.01 * np.eye(3),
    joints=tuple(Joint(kind, name, np.eye(3)[k], _HOME) for kind, name, k in _TURNS),
)  # fmt: skip
"""A planar robot with as many cables as freedoms, two above and one straight below its platform."""

# Order of the joints (x, z, tilt), and how far beside the origin the hinge is [robot's length].
WAYS = {"hinge first": ((2, 0, 1), 0.0), "hinge beside": ((0, 1, 2), 0.7), "both": ((0, 2, 1), 1.3)}


def slides() -> Robot:
    """A platform that slides along x and z."""
    robot = load_robot("planar_vertical")
    home = robot.reference_pose[:3]
    joints = tuple(Joint("slide", name, np.eye(3)[k], home) for name, k in (("x", 0), ("z", 2)))
    return replace(robot, joints=joints)


def turned(robot: Robot, rotvec: list[float]) -> tuple[Robot, np.ndarray]:
    """The robot in a base frame turned by a rotation vector [rad]; the rotation (3, 3), rounded to
    be exact where axes become axes. The floor is left out: it is along z.
    """
    quat = quat_from_rotvec(np.array([rotvec]))
    turn = quat_to_matrix(quat)[0]
    turn = np.where(np.abs(turn - turn.round()) < 1e-12, turn.round(), turn)
    pose = np.concatenate([
        turn @ robot.reference_pose[:3], quat_multiply(quat, robot.reference_pose[None, 3:])[0],
    ])  # fmt: skip
    joints = tuple(
        replace(joint, axis=turn @ joint.axis, point=turn @ joint.point) for joint in robot.joints
    )
    other = replace(
        robot, exit_points=robot.exit_points @ turn.T, gravity=turn @ robot.gravity,
        reference_pose=pose, joints=joints, floor=None,
    )  # fmt: skip
    return other, turn


def rejointed(robot: Robot, way: str) -> Robot:
    """A planar robot with its slides and hinge in another order and place, which move it alike."""
    order, beside = WAYS[way]
    joints = list(robot.joints)
    there = joints[2].point + beside * robot.length * np.array([0.6, 0.0, 0.8])
    joints[2] = replace(joints[2], point=there)
    return replace(robot, joints=tuple(joints[k] for k in order))
