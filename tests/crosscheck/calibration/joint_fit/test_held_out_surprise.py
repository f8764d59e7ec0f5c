"""How surprising held-out runs are: what happens by chance is no surprise."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.calibration.joint_fit.leave_out import _by_chance
from crosscheck.calibration.judgement.verdict import SURPRISE


@pytest.mark.parametrize("readings", [1, 3, 14, 40, 300])
def test_few_readings_are_hardly_ever_a_surprise_by_chance(readings: int) -> None:
    """A run of one row, 2.6 times as far off as expected, had made a lone effect an unknown one."""
    power = np.random.default_rng(readings).chisquare(readings, 200_000)
    assert np.mean(power / _by_chance(readings) > SURPRISE) < 3e-4
    assert 36.3 / _by_chance(14) < SURPRISE < 500.0 / _by_chance(200)
