"""MuJoCo's side takes the files that SEECR reads: loose and welded bodies, actuators, balls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hall import EXITS, SITES, hall

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler
from seecr.description.mjcf import load_robot
from seecr.equilibrium.solving import solve
from seecr.pose import pose_difference

LOOSE = '<body name="box" pos="2 0 0"><freejoint/><geom size="0.1"/></body>'
KEY = '<keyframe><key qpos="0 0 0 1 0 0 0 0 0 0 1 0 0 0"/></keyframe>'
SERVO = '<actuator><position name="m" tendon="rope0" kp="500"/></actuator>'
LUGS = f'<body name="lugs" pos="0.01 0.02 0.03" euler="5 0 20">{SITES}</body>'


@pytest.mark.parametrize(
    ("parts", "freedoms"),
    [
        ({"world": EXITS + LOOSE, "rest": KEY}, 6),
        ({"world": LOOSE + EXITS, "rest": SERVO}, 6),
        ({"rest": SERVO}, 6),
        ({"inside": LUGS}, 6),
        ({"joint": '<joint name="knee" type="ball" pos="0 0 0.3"/>'}, 3),
        ({"joint": '<joint type="slide" axis="0 0 1"/><joint type="ball" pos="0 0 0.3"/>'}, 4),
    ],
)
def test_both_sides_bring_the_same_file_to_the_same_rest(
    parts: dict[str, str], freedoms: int, tmp_path: Path
) -> None:
    path = hall(tmp_path / "robot.xml", **parts)
    assert Physics.of(path).n_dof == freedoms
    robot = load_robot(path)
    ours = solve(robot, robot.reference_pose)
    theirs = Settler(path).settle(robot.reference_pose, ours.rest_lengths[0])
    assert np.abs(pose_difference(ours.pose, theirs.pose[None])).max() < 1e-6
    assert ours.tensions[0] == pytest.approx(theirs.tensions, abs=1e-3)
