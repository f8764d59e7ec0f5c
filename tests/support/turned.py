"""A robot and the same one in another base frame: answers must turn along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.description.robot import Robot
from seecr.pose import quat_from_rotvec, quat_multiply, quat_to_matrix


def turned(robot: Robot, rotvec: list[float]) -> tuple[Robot, np.ndarray]:
    """The robot in a frame turned by a rotation vector [rad]; the rotation (3, 3), rounded to be
    exact where axes become axes. The floor is left out: it is along z.
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
