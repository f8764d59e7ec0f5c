"""Waypoints solved in order: what a lost one means for the others."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.prediction.experiment import Experiment

LASTING = {"hysteresis": {"amplitude_N": 0.1}, "creep": {"amount": 0.1, "time_s": 50.0}}


@pytest.mark.parametrize("name", LASTING)
def test_a_row_without_rest_ends_its_run_and_no_other(name: str) -> None:
    """A pull of a giganewton in the second row of six; the third could rest by itself."""
    robot = load_robot("planar_vertical")
    poses = np.tile(robot.reference_pose, (6, 1))
    poses[:, 0] += [0.01, 0.02, 0.03, -0.01, 0.04, 0.0]
    wrench = np.zeros((6, 6))
    wrench[1, 0] = 1e9
    commands = Commands(
        poses, run=np.repeat([0, 1], 3), time=10.0 * np.arange(6), loads=Loads.of(6, wrench=wrench)
    )
    lasts = [Term.of(robot, name, **LASTING[name]).effect()]
    found = Experiment(robot, commands).predict(lasts)
    assert found.solved.tolist() == [True, False, False, True, True, True]
    assert Experiment(robot, commands).predict().solved[2]
    # nor is anything looked for behind the first waypoint that is lost
    assert found.walk is not None
    lost = np.flatnonzero(~found.walk.solved)
    assert found.walk.count[lost[0]] > 0 and not found.walk.count[lost[1:]].any()
    if name == "hysteresis":  # creep goes on through runs
        alone = Experiment(robot, commands.rows(np.arange(3, 6))).predict(lasts)
        np.testing.assert_array_equal(found.pose[3:], alone.pose)
