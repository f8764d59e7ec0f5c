"""What docs/diagnosis.md says of corrections, on some of its twins: ``pytest -m sweep``."""

from __future__ import annotations

import re

import pytest
from score_corrections import score, score_aligned

pytestmark = [pytest.mark.sweep, pytest.mark.slow]


@pytest.mark.parametrize("seed", [1, 4])
def test_with_the_model_of_the_diagnosis_platforms_come_35_times_nearer(seed: int) -> None:
    found = re.search(r"; ([0-9]+) of ([0-9]+) reached; .* factor ([0-9]+)$", score(seed))
    assert found is not None
    reached, every, factor = map(int, found.groups())
    assert reached > 0.8 * every and factor >= 35


@pytest.mark.parametrize("seed", [1, 2])
def test_with_a_calibrated_model_and_a_tracker_that_is_right_20_times(seed: int) -> None:
    found = re.search(r"in the base frame: is .* factor ([0-9.]+);", score_aligned(seed))
    assert found is not None and float(found[1]) >= 19.5
