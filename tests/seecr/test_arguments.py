"""Arguments that once passed for something else: empty sets, masked numbers, half quaternions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
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


PARALLEL = load_robot("demobot_parallel")
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


# --- Paths and loaded objects give the same; what is neither is refused in a sentence


PLACE = [0.4, 0.25, 0.1, 1, 0, 0, 0]
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "solve": lambda robot: seecr.solve(robot, PLACE),
    "predict": lambda robot: seecr.predict(robot, PLACE),
    "correct": lambda robot: seecr.correct(robot, PLACE),
    "export": lambda robot: seecr.export(robot).text,
    "equilibria": lambda robot: seecr.equilibria(robot, PLACE, most=1),
    "new_model": lambda robot: seecr.new_model(robot),
    "Term.of": lambda robot: seecr.Term.of(robot, "stiffness").layout.scale,
    "tension_margin": lambda robot: seecr.tension_margin(robot, PLACE),
    "feasible": lambda robot: seecr.feasible(robot, PLACE),
    "default_axes": lambda robot: seecr.default_axes(robot, 3),
    "workspace_map": lambda robot: seecr.workspace_map(robot, 0.4, 0.25, [0.1, 0.2]),
    "boundary": lambda robot: seecr.boundary(robot, PLACE, [0.4, 0.25, 9.0, *PLACE[3:]]),
}
MODELS: dict[str, Callable[[Any], Any]] = {
    "solve": lambda model: seecr.solve("demobot_cogiro", PLACE, effects=model).pose,
    "predict": lambda model: seecr.predict("demobot_cogiro", PLACE, model).pose,
    "correct": lambda model: seecr.correct("demobot_cogiro", PLACE, effects=model).lengths,
    "export": lambda model: seecr.export("demobot_cogiro", model).mujoco_text,
    "equilibria": lambda model: (
        seecr.equilibria("demobot_cogiro", PLACE, effects=model, most=1).pose
    ),
    "workspace_map": lambda model: (
        seecr.workspace_map("demobot_cogiro", 0.4, 0.25, 0.1, effects=model).deviation
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_robot_is_given_by_its_path_its_name_or_as_loaded(name: str) -> None:
    function, path = FUNCTIONS[name], seecr.model_path("demobot_cogiro")
    wanted = repr(function(seecr.load_robot(path)))
    for given in (path, str(path), "demobot_cogiro"):
        assert repr(function(given)) == wanted
    with pytest.raises(seecr.InputError, match=r"^expected a robot, the path .* got int$"):
        function(3)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "m.toml"
    path.write_text('[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.01\n')
    return path


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_given_by_its_path_or_as_loaded(name: str, path: Path) -> None:
    function, model = MODELS[name], seecr.load_model(path, "demobot_cogiro")
    wanted = repr(function(model))
    assert wanted != repr(function(()))
    for given in (path, str(path), model.terms):
        assert repr(function(given)) == wanted


@pytest.mark.parametrize(
    ("given", "got"), [(["stiffness"], "'stiffness'"), (3, "int"), ([3], "int"), (None, "NoneType")]
)
def test_what_is_no_model_is_refused(given: Any, got: str) -> None:
    for function in MODELS.values():
        with pytest.raises(seecr.InputError, match=rf"Term\.of\(robot, name.*, got {got}$"):
            function(given)


def test_how_likely_poses_hold_is_asked_of_a_model_or_its_file(path: Path) -> None:
    functions: list[Callable[[Any], Any]] = [
        lambda model: seecr.spread_of("demobot_cogiro", PLACE, model),
        lambda model: seecr.held_chance("demobot_cogiro", PLACE, model),
    ]
    for function in functions:
        assert function(path) is None  # which keeps no covariance
        with pytest.raises(seecr.InputError, match=r"^expected a model or its path, got list$"):
            function(["stiffness"])
