"""What ``import seecr`` gives."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import seecr

POSES = [[0.4, 0.25, 0.1, 1, 0, 0, 0], [0.3, 0.2, 0.1, 1, 0, 0, 0]]


@pytest.fixture(scope="module")
def robot() -> seecr.Robot:
    return seecr.load_robot(seecr.model_path("demobot_cogiro"))


@pytest.mark.parametrize("name", seecr.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    value = getattr(seecr, name)
    assert value.__name__ == name
    assert len(inspect.getdoc(value) or "") > 20
    assert name in dir(seecr)


def test_types_are_told_of_the_same_names() -> None:
    tree = ast.parse(Path(inspect.getfile(seecr)).read_text(encoding="utf-8"))
    typed = next(n for n in tree.body if isinstance(n, ast.If))
    names = [a.name for n in typed.body if isinstance(n, ast.ImportFrom) for a in n.names]
    assert sorted(names) == sorted(seecr.__all__) == sorted(seecr._WHERE)


def test_workspaces_and_the_inverse_are_there_as_modules() -> None:
    words = "import seecr; print(seecr.workspace.feasible.__name__, seecr.inverse.correct.__name__)"
    got = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert got.stdout.split() == ["feasible", "correct"]


@pytest.mark.parametrize("folder", ["workspace", "inverse"])
def test_a_public_folder_gives_what_the_package_gives(folder: str) -> None:
    module = getattr(seecr, folder)
    assert {name: getattr(module, name) for name in module.__all__} == {
        name: getattr(seecr, name) for name in module.__all__
    }


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'seecr' has no attribute 'Solver'"):
        _ = seecr.Solver


def test_no_module_hides_a_public_name() -> None:
    modules = {path.stem for path in Path(inspect.getfile(seecr)).parent.iterdir()}
    assert not modules & set(seecr.__all__)


@pytest.mark.slow
def test_importing_all_of_it_by_name_loads_nothing_heavy() -> None:
    code = (
        "import sys, seecr; dir(seecr); seecr.Robot, seecr.Term, seecr.model_path, seecr.Status;"
        "print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


# --- predict -------------------------------------------------------------------------------------


def test_a_prediction_without_effects_is_the_plain_robots(robot: seecr.Robot) -> None:
    found, plain = seecr.predict(robot, POSES), seecr.solve(robot, POSES)
    assert found.solved.all() and not found.slack.all()
    assert np.array_equal(found.pose, plain.pose)
    assert np.array_equal(found.slack, plain.slack)


def test_models_terms_and_effects_predict_the_same(robot: seecr.Robot, tmp_path: Path) -> None:
    term = seecr.Term.of(robot, "pulley_radius", radius_m=0.01)
    path = tmp_path / "model.toml"
    path.write_text('[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.01\n')
    model = seecr.load_model(path, robot)
    commands = seecr.Commands(np.array(POSES))
    ways = (model, model.terms, [term], seecr.Terms([term]), [term.effect()])
    found = [seecr.predict(robot, commands, way).readings for way in ways]
    assert all(np.array_equal(one.position, found[0].position) for one in found)
    plain = seecr.predict(robot, POSES).readings
    assert np.abs(found[0].position - plain.position).max() > 1e-4


def test_wrong_poses_are_refused_as_solve_refuses_them(robot: seecr.Robot) -> None:
    with pytest.raises(seecr.InputError, match=r"poses must be \(n, 7\).*got \(2, 6\)"):
        seecr.predict(robot, np.zeros((2, 6)))


def test_a_term_by_name_knows_its_parameters(robot: seecr.Robot) -> None:
    term = seecr.Term.of(robot, "drum_gain", gain_3=0.002)
    assert term.vector.tolist() == [0, 0, 0.002, 0, 0, 0, 0, 0]
    with pytest.raises(seecr.InputError, match=r"drum_gain: no parameter gain3; .*gain_3"):
        seecr.Term.of(robot, "drum_gain", gain3=0.002)
    with pytest.raises(seecr.InputError, match="no effect 'drum_gian'; known, nearest first: drum"):
        seecr.Term.of(robot, "drum_gian")
