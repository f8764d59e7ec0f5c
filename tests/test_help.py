"""``help()`` of every public function: what it takes, gives and raises, and a running example."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hoses import Hose

import crosscheck
import seecr
from seecr.effects import registry

FUNCTIONS = {
    f"{face.__name__}.{name}": function
    for face in (seecr, crosscheck)
    for name in face.__all__
    if inspect.isfunction(function := getattr(face, name))
}
# What cannot fail, or gives nothing.
NEVER_RAISES = {"seecr.model_names", "seecr.new_model", "seecr.parameter", "seecr.sensitivities"}
# Where an example takes seconds, or needs files of other programs.
LONG = {
    "crosscheck.calibrate", "crosscheck.diagnose", "crosscheck.import_case",
    "crosscheck.load_diagnosed", "crosscheck.run_suite", "crosscheck.user_cases",
    "crosscheck.write_plan", "crosscheck.write_run", "crosscheck.compare_models",
    "crosscheck.choose_poses",
}  # fmt: skip
MODEL = """[[effect]]
name = "pulley_radius"
[effect.parameters]
radius_m = { value = 0.01, stderr = 1e-5 }
[fit]
parameters = ["pulley_radius.radius_m"]
stderr = [1e-5]
correlation = [[1.0]]
"""


def example(name: str) -> str:
    """The code of a function's example."""
    text = inspect.getdoc(FUNCTIONS[name]) or ""
    found = re.search(r"^Example:\n    ``(.*?)``$", text, re.MULTILINE | re.DOTALL)
    assert found is not None, f"{name}: expected Example: with code in double backticks"
    return found[1]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_has_its_sections(name: str) -> None:
    text, signature = inspect.getdoc(FUNCTIONS[name]) or "", inspect.signature(FUNCTIONS[name])
    wanted = ["Args:"] if signature.parameters else []
    wanted += [] if name in NEVER_RAISES else ["Raises:"]
    wanted += [] if signature.return_annotation in ("None", None) else ["Returns:"]
    assert [section for section in wanted if f"\n{section}\n" not in text] == []
    assert f"{name}(" in example(name)
    compile(example(name), name, "eval")


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """What the examples may use, in a folder with the files that they name."""
    folder = tmp_path_factory.mktemp("help")
    twin = crosscheck.make_twin("demobot_cogiro", 7, effects=["pulley_radius"], points=4,
                                out=folder / "case")  # fmt: skip
    (folder / "robot.xml").write_bytes((folder / "case" / "robot.xml").read_bytes())
    crosscheck.write_measurements(folder / "measured.csv", twin.measured)
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    (folder / "limits.toml").write_text('max_position = "0.5mm"\n', encoding="utf-8")
    robot = seecr.load_robot(folder / "robot.xml")
    poses = np.linspace([0.3, 0.25, 0.15, 1, 0, 0, 0], [0.5, 0.25, 0.15, 1, 0, 0, 0], 3)
    radius = seecr.Term.of(robot, "pulley_radius", radius_m=0.01)
    bar = seecr.load_robot("planar_two_cable")
    above = robot.reference_pose + np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    yield {
        "seecr": seecr, "crosscheck": crosscheck, "robot": robot, "poses": poses,
        "solution": seecr.solve(robot, poses), "data": twin.measured, "Hose": Hose,
        "planar": seecr.load_robot("planar_vertical"), "terms": seecr.Terms([radius]),
        "experiment": seecr.Experiment(robot, seecr.Commands(poses)), "folder": folder,
        "held": robot.reference_pose[None], "not_held": above[None],
        "bars": bar.reference_pose[None], "found": crosscheck.compare(robot, twin.measured),
    }  # fmt: skip
    registry._introduced.clear()
    registry._given.clear()
    registry.catalogue.cache_clear()


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FUNCTIONS.keys() - LONG))
def test_its_example_runs(
    name: str, names: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder: Path = names["folder"]
    monkeypatch.chdir(folder)
    eval(example(name), dict(names))
