"""A planar robot with as many cables as freedoms, two above and one straight below its platform."""

from __future__ import annotations

import numpy as np

from seecr.description.robot import Joint, Robot

_HOME = np.array([0.75, 0.0, 0.5])
_TURNS = (("slide", "x", 0), ("slide", "z", 2), ("hinge", "ry", 1))

THREE = Robot(
    name="three", mass=2.0, ea=np.full(3, 7520.0), rest_lengths=np.array([0.94, 0.94, 0.765]),
    exit_points=np.array([[0, 0, 1.2], [1.5, 0, 1.2], [0.75, 0, -0.3]]),
    anchor_points=np.array([[-0.08, 0, 0.03], [0.08, 0, 0.03], [0, 0, -0.03]]),
    reference_pose=np.array([*_HOME, 1, 0, 0, 0]), inertia=0.01 * np.eye(3),
    joints=tuple(Joint(kind, name, np.eye(3)[k], _HOME) for kind, name, k in _TURNS),
)  # fmt: skip
