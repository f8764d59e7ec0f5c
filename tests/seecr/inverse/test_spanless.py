"""Wanted and commanded poses at which an anchor point is at its exit point, or in its pulley."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.inverse.correction import correct
from seecr.pose import quat_to_matrix
from seecr.prediction.experiment import predict
from seecr.statics.solution import Status

ROBOT = load_robot("demobot_off_centre")


def at_exit(robot: Robot, cable: int = 0, beside: float = 0.0) -> np.ndarray:
    """The pose (7,) that puts an anchor point so far [m] along x beside its exit point."""
    pose = robot.reference_pose.copy()
    turned = quat_to_matrix(pose[None, 3:])[0] @ robot.anchor_points[cable]
    pose[:3] = robot.exit_points[cable] - turned + [beside, 0.0, 0.0]
    return pose


@pytest.mark.parametrize("highest", [np.inf, 800.0])
@pytest.mark.slow
def test_a_row_without_a_length_has_its_reason_and_others_are_corrected(highest: float) -> None:
    wanted = np.stack([ROBOT.reference_pose, at_exit(ROBOT), ROBOT.reference_pose])
    found = correct(ROBOT, wanted, highest=highest)
    assert found.held.tolist() == [True, False, True] and found.reached[[0, 2]].all()
    name = ROBOT.cable_names[0]
    assert found.why_not[1] == f"{name} would have no length, its anchor point at its exit point"
    assert not found.found[1] or found.lengths[1].min() > 0.0


@pytest.mark.parametrize("beside", [0.0, 0.002])
@pytest.mark.slow
def test_within_a_pulley_the_missing_length_is_named(beside: float) -> None:
    pulleys = [Term.of(ROBOT, "pulley_radius", radius_m=0.01)]
    pose = at_exit(ROBOT, beside=beside)
    assert predict(ROBOT, pose[None], pulleys).solution().status[0] is Status.NO_LENGTH
    assert "within its pulley" in correct(ROBOT, pose[None], effects=pulleys).why_not[0]
