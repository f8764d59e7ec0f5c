"""Effects with values of their own for each file or run, laid out one after the other."""

from __future__ import annotations

import numpy as np
import pytest

import seecr
from seecr.effects.terms import Apart, Own, apart

BASE = seecr.layout_of("cable_length_offset", "demobot_cogiro")
DAYS = apart(BASE, "file", ("monday", "tuesday"), BASE.null + 0.001)


def test_parameters_of_a_part_stand_together_under_its_name() -> None:
    assert len(DAYS) == 16 and DAYS.part("tuesday") == slice(8, 16)
    assert DAYS.names[8] == f"tuesday: {BASE.names[0]}"
    assert [group.tolist() for group in DAYS.cable_by_cable] == [list(range(8)), list(range(8, 16))]
    assert list(DAYS.groups) == ["monday: offset_m", "tuesday: offset_m"]


def test_each_part_is_the_effect_with_its_values_and_others_are_the_rest() -> None:
    found = DAYS.build(np.arange(16.0))
    assert isinstance(found, Apart)
    assert found.at("tuesday").offset == pytest.approx(np.arange(8.0, 16.0))  # type: ignore[attr-defined]
    assert found.at("friday").offset == pytest.approx(np.full(8, 0.001))  # type: ignore[attr-defined]
    robot = seecr.load_robot("demobot_cogiro")
    totals = found.totals(robot)
    assert totals["monday: offset_2_m"].value == pytest.approx(robot.rest_lengths[1] + 1.0)


def test_values_are_per_file_or_per_run() -> None:
    with pytest.raises(seecr.InputError, match="are per 'file' or 'run', got 'day'"):
        Own("day", {})
