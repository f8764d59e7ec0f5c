"""A soft robot and what is measured of it, and a stiffer one than described, as files."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_data import case, measured, soft_cogiro

from crosscheck.measurements.data import Measurements
from seecr.description.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return soft_cogiro()


@pytest.fixture(scope="module")
def data(robot: Robot) -> Measurements:
    return measured(robot, points=4)


@pytest.fixture(scope="session")
def stiff(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return case(tmp_path_factory.mktemp("stiff"), {"stiffness": {"factor": 1.4}})
