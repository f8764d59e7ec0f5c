"""Arguments that once passed for something else: empty sets, masked numbers, half quaternions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import seecr
from seecr.arguments import numbers, whole
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import effect_named
from seecr.errors import InputError

ROBOT = seecr.load_robot("planar_vertical")
HOME = ROBOT.reference_pose
STIFF = seecr.Term.of(ROBOT, "stiffness", factor=1.1)
MASKED = np.ma.masked_invalid(np.array([[np.nan, *HOME[1:]]]))
WHOLE = np.ma.masked_array(np.arange(3), mask=[False, True, False])
AT = [HOME[0]], [HOME[1]], [HOME[2]]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: seecr.tension_margin(ROBOT, HOME, wrenches=np.zeros((0, 6))), "one or more"),
        (lambda: seecr.feasible(ROBOT, HOME, wrenches=[]), "wrenches: expected one or more"),
        (lambda: seecr.feasible(ROBOT, HOME, effects=[STIFF], wrenches=np.zeros((0, 6))),
         "wrenches: expected one or more"),
        *(
            (lambda most=most: seecr.equilibria(ROBOT, HOME, most=most), "most: expected a whole")
            for most in (10.5, "x", 0, -5)
        ),
        (lambda: seecr.solve(ROBOT, MASKED), "poses holds numbers that are not finite"),
        (lambda: seecr.workspace_map(ROBOT, WHOLE, 0.0, 0.3), "x holds numbers that are not fini"),
        (lambda: seecr.workspace_map(ROBOT, *AT, orientation=[1, 0, 0]),
         r"orientation must be \(4,\), qw qx qy qz, got \(3,\)"),
        (lambda: seecr.workspace_map(ROBOT, *AT, orientation=[0, 0, 0, 0]),
         "orientation: expected a unit quaternion qw qx qy qz, got one of norm 0"),
        (lambda: seecr.predict(ROBOT, HOME, [STIFF, STIFF]), "stiffness is in the list twice"),
    ],
)  # fmt: skip
def test_it_is_told_in_one_line(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as told:
        call()
    assert "\n" not in str(told.value)


def test_complex_numbers_are_refused_masked_or_not() -> None:
    for values in (np.array([1 + 2j, 2.0]), np.ma.masked_array([1 + 2j, 2.0], mask=False)):
        with pytest.raises(seecr.InputError, match="x: expected numbers"):
            numbers(values, "x")


def test_masked_arrays_without_anything_masked_are_numbers() -> None:
    poses = np.ma.masked_array(HOME[None], mask=False)
    assert seecr.solve(ROBOT, poses).converged.all()


PARALLEL = load_robot(model_path("demobot_parallel"))
POSE = PARALLEL.reference_pose[None]
BAD: dict[str, tuple[Callable[[Any], Any], Any, str]] = {
    "robot": (load_robot, None, "expected the path of an MJCF file, .* got NoneType"),
    "model": (lambda x: seecr.load_model(x, PARALLEL), 3, "expected the path of a model, got int"),
    "shipped": (model_path, 3, "shipped robot 3: expected one of"),
    "effect": (effect_named, None, "expected the name of an effect, got None"),
    "value": (
        lambda x: seecr.Term.of(PARALLEL, "stiffness", factor=x), "a",
        "factor: expected numbers, got 'a'",
    ),
    "digits": (
        lambda x: seecr.Term.of(PARALLEL, "stiffness", factor=x), 10**400,
        "factor: expected numbers, got a int",
    ),
    "limit": (
        lambda x: seecr.correct(PARALLEL, POSE, lowest=x), "a", "lowest: expected numbers, got 'a'",
    ),
    "poses": (
        lambda x: seecr.workspace.feasible(PARALLEL, x), "x", "poses: expected numbers, got 'x'",
    ),
    "imaginary": (lambda x: seecr.solve(PARALLEL, x), POSE + 1j, "expected numbers, got a ndarray"),
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
