"""Paths and loaded objects give the same; what is neither is refused in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import seecr

HOME = [0.4, 0.25, 0.1, 1, 0, 0, 0]
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "solve": lambda robot: seecr.solve(robot, HOME),
    "predict": lambda robot: seecr.predict(robot, HOME),
    "correct": lambda robot: seecr.correct(robot, HOME),
    "export": lambda robot: seecr.export(robot).text,
    "equilibria": lambda robot: seecr.equilibria(robot, HOME, most=1),
    "new_model": lambda robot: seecr.new_model(robot),
    "Term.of": lambda robot: seecr.Term.of(robot, "stiffness").layout.scale,
    "tension_margin": lambda robot: seecr.tension_margin(robot, HOME),
    "feasible": lambda robot: seecr.feasible(robot, HOME),
    "default_axes": lambda robot: seecr.default_axes(robot, 3),
    "workspace_map": lambda robot: seecr.workspace_map(robot, 0.4, 0.25, [0.1, 0.2]),
    "boundary": lambda robot: seecr.boundary(robot, HOME, [0.4, 0.25, 9.0, *HOME[3:]]),
}
MODELS: dict[str, Callable[[Any], Any]] = {
    "solve": lambda model: seecr.solve("demobot_cogiro", HOME, effects=model).pose,
    "predict": lambda model: seecr.predict("demobot_cogiro", HOME, model).pose,
    "correct": lambda model: seecr.correct("demobot_cogiro", HOME, effects=model).lengths,
    "export": lambda model: seecr.export("demobot_cogiro", model).mujoco_text,
    "equilibria": lambda model: (
        seecr.equilibria("demobot_cogiro", HOME, effects=model, most=1).pose
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
        lambda model: seecr.spread_of("demobot_cogiro", HOME, model),
        lambda model: seecr.held_chance("demobot_cogiro", HOME, model),
    ]
    for function in functions:
        assert function(path) is None  # which keeps no covariance
        with pytest.raises(seecr.InputError, match=r"^expected a model or its path, got list$"):
            function(["stiffness"])


def test_poses_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(seecr.InputError, match=r"^poses: expected numbers, got 'poses\.csv'$"):
        seecr.solve("demobot_cogiro", "poses.csv")
    with pytest.raises(seecr.InputError, match=r"^poses: expected numbers, got a list$"):
        seecr.solve("demobot_cogiro", [[0.4, 0.25], [0.4]])
