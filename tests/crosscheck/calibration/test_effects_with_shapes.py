"""Effects with a shape in place of others: creep and a hall that warms up both go with time."""

from __future__ import annotations

import pytest
import score_chances

from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.reasons import DiagnosisVerdict


@pytest.mark.sweep
def test_what_goes_with_time_and_what_goes_with_temperature_are_named_together() -> None:
    robot, data, hidden, _owed = score_chances.make(5036, 1, "alike")
    assert [one.name for one in hidden] == ["thermal_expansion"]
    found = diagnose(robot, data)
    assert found.verdict is DiagnosisVerdict.EFFECTS_FOUND
    (one,) = found.missing
    assert {one.effect, *(r.name for r in one.rivals)} >= {"creep", "thermal_expansion"}
