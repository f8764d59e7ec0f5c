"""Margins of robots whose cables weigh more than their lowest tension."""

from __future__ import annotations

import numpy as np
import pytest

from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.workspace.zones import tension_margin

ROBOT = load_robot("demobot_cogiro")
HEAVY = [Term.of(ROBOT, "cable_weight", weight_N_per_m=0.1 * ROBOT.weight)]


@pytest.mark.parametrize("part", [0.3, 0.9])
def test_limits_that_close_in_take_as_much_from_the_margin(part: float) -> None:
    """It is counted from the limits asked for, not from what the cables weigh."""
    random = np.random.default_rng(3)
    poses = np.tile(ROBOT.reference_pose, (8, 1))
    poses[:, :3] += random.uniform(-0.06, 0.06, (8, 3))
    high = 1.5 * ROBOT.weight
    margin = tension_margin(ROBOT, poses, highest=high, effects=HEAVY)
    assert np.sum(margin > 0.0) > 4
    for pose, own in zip(poses[margin > 0.0], margin[margin > 0.0], strict=True):
        less = part * own
        there = tension_margin(ROBOT, pose, lowest=less, highest=high - less, effects=HEAVY)
        assert there[0] == pytest.approx(own - less, abs=1e-5 * ROBOT.weight)
