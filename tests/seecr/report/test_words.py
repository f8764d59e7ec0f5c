"""A pose in words."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

import seecr
from seecr.report.words import pose_lines
from seecr.shipped import model_path


def test_rounding_is_no_turn() -> None:
    robot = seecr.load_robot(model_path("demobot_cogiro"))
    found = seecr.solve(robot, [robot.reference_pose])
    rounding = np.array([[1e-17, 0.0, -2e-4, 1e-19, 2e-19, 0.0]])
    text = "\n".join(pose_lines(replace(found, deviation=rounding)))
    assert re.search(r"\(0\.2 mm\), turned by 0 deg \(", text), text
