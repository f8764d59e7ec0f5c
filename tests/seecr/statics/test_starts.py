"""Commands as callers give them: poses, commands, or what holds commands among other things."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crosscheck
import seecr
from seecr.statics.starts import commands_from

ROBOT = seecr.load_robot("demobot_cogiro")
POSES = np.array([[0.4, 0.25, 0.1, 1, 0, 0, 0], [0.0, 0.1, 0.2, 1, 0, 0, 0]])


def measured() -> crosscheck.Measurements:
    return crosscheck.Measurements(
        Path("here.csv"), ROBOT.n_cables, np.array(["one", "two"]), command_pose=POSES
    )


def test_measurements_stand_for_their_commands() -> None:
    found = commands_from(measured(), ROBOT)
    assert np.array_equal(found.pose, POSES)
    assert found.starts.tolist() == [True, True]


def test_commands_stay_as_they_are() -> None:
    commands = seecr.Commands(POSES)
    assert commands_from(commands, ROBOT) is commands


@pytest.mark.parametrize(
    "rests",
    [
        lambda given: seecr.predict(ROBOT, given).pose,
        lambda given: seecr.solve(ROBOT, given).pose,
        lambda given: seecr.correct(ROBOT, given).lengths,
    ],
    ids=["predict", "solve", "correct"],
)
def test_what_takes_poses_takes_measurements(rests: Callable[[Any], np.ndarray]) -> None:
    apart = seecr.Commands(POSES, run=np.array([0, 1]))
    assert np.array_equal(rests(measured()), rests(apart))


def test_something_else_is_refused() -> None:
    with pytest.raises(seecr.InputError, match="poses: expected numbers, got a Robot"):
        seecr.predict(ROBOT, ROBOT)  # type: ignore[arg-type]
