"""A robot of round numbers: its sizes can be told by hand."""

from __future__ import annotations

import numpy as np

from seecr.description.robot import Robot

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
