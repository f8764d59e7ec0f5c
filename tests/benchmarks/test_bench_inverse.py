"""How fast commands are corrected and poses tested: ``pytest -m benchmark -s``."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

import seecr

pytestmark = [pytest.mark.benchmark, pytest.mark.slow]


def microseconds(run: Callable[[], object], count: int) -> float:
    """Of processor time, by the best of three."""
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        run()
        best = min(best, time.process_time() - start)
    return 1e6 * best / count


def test_corrections_and_margins(capsys: pytest.CaptureFixture[str]) -> None:
    robot = seecr.load_robot(seecr.model_path("demobot_cogiro"))
    poses = np.zeros((4000, 7))
    poses[:, 0] = np.linspace(0.17, 0.63, len(poses))
    poses[:, 1], poses[:, 2], poses[:, 3] = 0.25, 0.1, 1.0
    seecr.correct(robot, poses[:300])
    seecr.tension_margin(robot, poses[:300])
    corrected = microseconds(lambda: seecr.correct(robot, poses), len(poses))
    tested = microseconds(lambda: seecr.tension_margin(robot, poses), len(poses))
    with capsys.disabled():
        print(f"\ncorrect {corrected:.1f} µs per pose, tension_margin {tested:.1f} µs per pose")
    assert corrected < 100.0 and tested < 10.0
