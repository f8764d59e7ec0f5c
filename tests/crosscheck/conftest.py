"""A soft robot and what is measured of it, for tests of fits and of what goes before them."""

from __future__ import annotations

import pytest
from made_data import measured, soft_cogiro

from crosscheck.measurements.data import Measurements
from seecr.description.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return soft_cogiro()


@pytest.fixture(scope="module")
def data(robot: Robot) -> Measurements:
    return measured(robot, points=4)
