"""One planar robot on different joints: the same platform, motions and cables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.description.robot import Robot

# Order of the joints (x, z, tilt), and how far beside the origin the hinge is [robot's length].
WAYS = {"hinge first": ((2, 0, 1), 0.0), "hinge beside": ((0, 1, 2), 0.7), "both": ((0, 2, 1), 1.3)}


def rejointed(robot: Robot, way: str) -> Robot:
    """The robot with its slides and hinge in another order and place."""
    order, beside = WAYS[way]
    joints = list(robot.joints)
    there = joints[2].point + beside * robot.length * np.array([0.6, 0.0, 0.8])
    joints[2] = replace(joints[2], point=there)
    return replace(robot, joints=tuple(joints[k] for k in order))
