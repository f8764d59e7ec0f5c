"""What callers give: a robot that stands alone in its case, names of effects, data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import made_diagnoses
import numpy as np
import pytest

import crosscheck
from crosscheck import given
from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.errors import InputError


def test_a_robot_that_needs_files_beside_it_is_refused(tmp_path: Path) -> None:
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    (tmp_path / "beside.xml").write_text("<mujoco/>", encoding="utf-8")
    robot = tmp_path / "robot.xml"
    robot.write_text(text.replace("<worldbody>", '<include file="beside.xml"/><worldbody>', 1))
    folder = tmp_path / "case"
    folder.mkdir()
    with pytest.raises(CrosscheckError, match=r"robot\.xml: needs other files"):
        given.copy_robot(robot, folder / "robot.xml")


def test_another_failure_is_not_called_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_path: Path) -> None:
        raise MemoryError("none is left")

    monkeypatch.setattr(given, "load_robot", fail)
    with pytest.raises(MemoryError, match="none is left"):
        given.copy_robot(model_path("planar_vertical"), tmp_path / "robot.xml")


def test_effects_to_consider() -> None:
    assert given.considered("stiffness") == {"stiffness"}
    assert given.considered(["creep", "stiffness"], "creep") == {"stiffness"}
    with pytest.raises(InputError, match="only: expected names of effects, got 3"):
        given.considered(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no effect 'foo'; known, nearest first"):
        given.considered("foo")


ROBOT = load_robot(model_path("demobot_parallel"))
DATA = Measurements(Path("m.csv"), 8, np.array(["a"]), command_pose=ROBOT.reference_pose[None])
BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "no data": (lambda: crosscheck.compare(ROBOT, []), "expected measurements or their files, got"),
    "tolerance": (
        lambda: crosscheck.diagnose(ROBOT, DATA, tolerance=cast(Any, 0.1)),
        "tolerance: expected a crosscheck.Tolerance, got 0.1",
    ),
    "names": (
        lambda: crosscheck.add_effects(ROBOT, DATA, ["creep", cast(Any, 3)]),
        "expected names of effects, effects with their values, or a result .* got int",
    ),
    "a number": (lambda: crosscheck.add_effects(ROBOT, DATA, cast(Any, 3)), "effects .* got int"),
    "noise": (
        lambda: crosscheck.load_measurements("m.csv", ROBOT, sigma=cast(Any, {"position": 1.0})),
        "sigma: expected a crosscheck.Sigma, such as .* got dict",
    ),
    "a diagnosis": (
        lambda: crosscheck.compare(ROBOT, DATA, cast(Any, made_diagnoses.none())),
        "expected a model, .*, got Diagnosis; its .model is one",
    ),
    "a diagnosis to save": (
        lambda: crosscheck.save_model("m.toml", cast(Any, made_diagnoses.none())),
        "expected a model, .*, got Diagnosis; its .model is one",
    ),
    "effects to save": (
        lambda: crosscheck.save_model("m.toml", cast(Any, Terms())),
        "expected a model, such as the .model of a diagnosis, got Terms$",
    ),
    "seed": (lambda: crosscheck.make_twin(ROBOT, -1), "seed: expected a whole number from 0 on"),
    "count": (
        lambda: crosscheck.make_twin(ROBOT, 1, n_effects=-2), "n_effects: expected a whole number",
    ),
    "points": (
        lambda: crosscheck.make_twin(ROBOT, 1, points=0), "points: expected a whole number from 1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_other_arguments_are_one_sentence(what: str) -> None:
    call, words = BAD[what]
    with pytest.raises(InputError, match=words):
        call()
