"""A pose in words."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

import seecr
from seecr.passes import Barrier
from seecr.report.words import other_lines, pose_lines
from seecr.shipped import model_path


def test_rounding_is_no_turn() -> None:
    robot = seecr.load_robot(model_path("demobot_cogiro"))
    found = seecr.solve(robot, [robot.reference_pose])
    rounding = np.array([[1e-17, 0.0, -2e-4, 1e-19, 2e-19, 0.0]])
    text = "\n".join(pose_lines(replace(found, deviation=rounding)))
    assert re.search(r"\(0\.2 mm\), turned by 0 deg \(", text), text


def test_a_platform_that_hangs_twisted_is_told_so() -> None:
    """It may rest where no way leads from the reference pose."""
    robot = seecr.load_robot(model_path("ipanema"))
    text = "\n".join(pose_lines(seecr.solve(robot, [[0.0, 0, 0, 1, 0, 0, 0]])))
    assert "hangs twisted, more than a right angle from its command" in text
    assert "twisted" not in "\n".join(pose_lines(seecr.solve(robot, [robot.reference_pose])))


def test_what_has_no_energy_gets_no_number() -> None:
    """A moment from outside has no energy: no nan is said, here or of what is between two rests."""
    robot = seecr.load_robot(model_path("demobot_parallel"))
    quat = np.array([0.943, 0.163, -0.288, -0.038])
    tilted = np.array([0.351, 0.216, 0.109, *(quat / np.linalg.norm(quat))])
    free = seecr.solve(robot, tilted, others=True)
    assert free.others is not None
    way = [Barrier(np.nan, np.nan, tilted, False, False)]
    rests = replace(free.others[0], energy=np.full(1, np.nan))
    (line,) = other_lines(free, rests, way)
    assert line.startswith("could also rest 15.7") and "nan" not in line
    assert "what it takes to get there has no number" in line
    (line,) = other_lines(free, free.others[0])
    assert " mJ, slack:" in line
    # a hall's energies are told in joules; a way that ends at its top takes nothing back
    hall = replace(free.others[0], energy=free.energy + 428.0)
    steep = Barrier(428.0, 1e-13, tilted, False, True)
    (line,) = other_lines(free, hall, [steep])
    assert ", +428 J, slack:" in line
    assert line.endswith("; twisted, at most 428 J to get there, next to nothing back")
