"""The axes of --grid: of a map along the robot's own directions, of a sweep along x, y and z."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from turned import turned

from seecr.cli.arguments import axes_of
from seecr.description.mjcf import load_robot
from seecr.errors import InputError
from seecr.workspace.grid import own_directions


def test_a_grid_far_from_the_origin_is_checked_along_its_own_axes() -> None:
    """A sweep of an oblique robot had been checked as if it were a map."""
    robot = turned(load_robot("planar_vertical"), [0.0, 0.0, np.radians(30.0)])[0]
    away = robot.reference_pose + np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot = replace(robot, reference_pose=away, exit_points=robot.exit_points + away[:3])
    directions = own_directions(robot)
    assert directions is not None
    place = away[:3]
    assert np.concatenate(axes_of([str(one) for one in place], robot)) == pytest.approx(place)
    texts = [str(one) for one in directions @ place]
    assert len(axes_of(texts, robot, directions)) == 3
    with pytest.raises(InputError, match="expected metres, in the range of"):
        axes_of(texts, robot)
