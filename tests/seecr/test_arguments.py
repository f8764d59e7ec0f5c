"""What is no number, no path, no name of an effect: one sentence for the caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import seecr
from seecr.arguments import whole
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import effect_named
from seecr.errors import InputError

ROBOT = load_robot(model_path("demobot_parallel"))
POSE = ROBOT.reference_pose[None]
BAD: dict[str, tuple[Callable[[Any], Any], Any, str]] = {
    "robot": (load_robot, None, "expected the path of an MJCF file, .* got NoneType"),
    "model": (lambda x: seecr.load_model(x, ROBOT), 3, "expected the path of a model, got int"),
    "shipped": (model_path, 3, "shipped robot 3: expected one of"),
    "effect": (effect_named, None, "expected the name of an effect, got None"),
    "value": (
        lambda x: seecr.Term.of(ROBOT, "stiffness", factor=x), "a",
        "factor: expected numbers, got 'a'",
    ),
    "digits": (
        lambda x: seecr.Term.of(ROBOT, "stiffness", factor=x), 10**400,
        "factor: expected numbers, got a int",
    ),
    "limit": (
        lambda x: seecr.correct(ROBOT, POSE, lowest=x), "a", "lowest: expected numbers, got 'a'",
    ),
    "poses": (
        lambda x: seecr.workspace.feasible(ROBOT, x), "x", "poses: expected numbers, got 'x'",
    ),
    "imaginary": (lambda x: seecr.solve(ROBOT, x), POSE + 1j, "expected numbers, got a ndarray"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_other_arguments_are_one_sentence(what: str) -> None:
    call, given, words = BAD[what]
    with pytest.raises(InputError, match=words):
        call(given)


def test_whole_numbers() -> None:
    assert whole(np.int64(3), "seed") == 3
    for wrong in (-1, 1.5, "a", None):
        with pytest.raises(InputError, match="seed: expected a whole number from 0 on, got"):
            whole(wrong, "seed")
