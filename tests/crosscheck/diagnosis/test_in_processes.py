"""What is tried in several processes is what one would have found."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest
from made_data import COGIRO, measured, term

from crosscheck import diagnose
from seecr import processes
from seecr.description.mjcf import load_robot

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux"),
]

ROBOT = load_robot(COGIRO)
FEW = (
    "pulley_radius", "gravity_tilt", "stiffness", "drum_gain", "tracker_frame", "length_scale",
    "cable_length_offset", "hysteresis",
)  # fmt: skip


def test_steps_with_rivals_are_the_same_to_the_last_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = [
        term(ROBOT, "pulley_radius", radius_m=0.006),
        term(ROBOT, "gravity_tilt", tilt_x_rad=0.03),
    ]
    data = measured(ROBOT, hidden, points=10)
    alone = diagnose(ROBOT, data, only=FEW).as_json()
    assert {one["effect"] for one in alone["missing"]} == {"pulley_radius", "gravity_tilt"}
    forked = list[int]()
    fork = processes._forked

    def counted(job: Callable[[], bytes]) -> tuple[int, int]:
        forked.append(1)
        return fork(job)

    monkeypatch.setattr(processes, "_forked", counted)
    monkeypatch.setenv(processes.MOST, "3")
    assert diagnose(ROBOT, data, only=FEW).as_json() == alone
    assert len(forked) > 5
