"""How fast commands are corrected and poses tested, beside SciPy: ``pytest -m benchmark -s``."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from margin_by_highs import margin_by_highs

import seecr
from seecr.workspace.zones import balance_equations

pytestmark = [pytest.mark.benchmark, pytest.mark.slow]

# SciPy takes so many times longer for a pose at least: its search for where the platform rests
# than a correction, its linear program than a margin.
_SEARCHES, _PROGRAMS = 20.0, 200.0


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
    some = poses[::40]
    equations = list(zip(*balance_equations(robot, some), strict=True))
    seecr.correct(robot, poses[:300])
    seecr.tension_margin(robot, poses[:300])
    corrected = microseconds(lambda: seecr.correct(robot, poses), len(poses))
    tested = microseconds(lambda: seecr.tension_margin(robot, poses), len(poses))
    searched = microseconds(lambda: seecr.solve(robot, some, method="fsolve"), len(some))
    programs = microseconds(lambda: [margin_by_highs(*e, 0.0, np.inf) for e in equations], 100)
    with capsys.disabled():
        print(
            f"\ncorrect {corrected:.1f} µs per pose, the paper's search {searched:.0f} µs; "
            f"tension_margin {tested:.1f} µs per pose, HiGHS {programs:.0f} µs"
        )
    assert searched > _SEARCHES * corrected and programs > _PROGRAMS * tested
