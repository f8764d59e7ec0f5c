"""A user's way, start to end: compare, diagnose, add, compare."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.cli import main
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.write import write_measurements
from seecr.commands import Commands
from seecr.description.mjcf import load_robot, model_path
from seecr.effects.geometry import PulleyRadius
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.prediction.experiment import Experiment

pytestmark = pytest.mark.slow

POSITION, ORIENTATION = 3e-5, 3.5e-4
# How commands hand on to one another does not hang on how many effects are tried: the tutorial,
# of the same commands, has them all.
FEW = ("--only", "pulley_radius,stiffness,centre_of_mass,cable_weight,tracker_frame")


def crosscheck(*words: str | Path) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    return int(end.value.code or 0)


def trajectory() -> tuple[Array, list[str]]:
    """Sweeps along x and y, forward and back, at two heights."""
    poses, runs = [], []
    for name, start, stop in (
        ("x_low", [0.2, 0.25, 0.1], [0.6, 0.25, 0.1]),
        ("x_high", [0.6, 0.25, 0.2], [0.2, 0.25, 0.2]),
        ("y", [0.4, 0.15, 0.15], [0.4, 0.35, 0.15]),
        ("up", [0.35, 0.2, 0.08], [0.45, 0.3, 0.3]),
    ):
        for part in np.linspace(0.0, 1.0, 10):
            place = (1 - part) * np.array(start) + part * np.array(stop)
            poses.append([*place, 1.0, 0.0, 0.0, 0.0])
            runs.append(name)
    return np.array(poses), runs


@pytest.fixture
def case(tmp_path: Path) -> tuple[Path, Path]:
    """Measurements of Cogiro with sheaves of 8 mm that its model does not have."""
    robot_file = model_path("demobot_cogiro")
    robot = load_robot(robot_file)
    poses, runs = trajectory()
    read = Experiment(robot, Commands(poses)).predict([PulleyRadius(0.008)]).readings
    rng = np.random.default_rng(7)
    turn = quat_from_rotvec(rng.normal(size=(len(poses), 3)) * ORIENTATION)
    data = Measurements(
        path=tmp_path / "measured.csv",
        n_cables=8,
        run=np.array(runs),
        command_pose=poses,
        t_s=2.0 * np.arange(len(poses)),
        position=read.position + rng.normal(size=(len(poses), 3)) * POSITION,
        quat_wxyz=quat_multiply(turn, read.quat_wxyz),
        sigma=Sigma(position_m=POSITION, orientation_rad=ORIENTATION),
    )
    write_measurements(data.path, replace(data))
    return robot_file, data.path


def test_compare_diagnose_add_compare(
    case: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, data = case
    model, limit = tmp_path / "model.toml", ("--max-position", "0.1mm", "--no-recording")
    out = tmp_path / "out"
    with monkeypatch.context() as unpaged:
        unpaged.setattr("crosscheck.show.page.write_page", lambda _found, _path, _made: None)
        assert crosscheck("compare", robot, data, "--out", out, *limit) == 1
    assert crosscheck("diagnose", robot, data, *FEW, "--out", out) == 0
    found = json.loads((out / "diagnosis.json").read_text())
    assert [m["effect"] for m in found["missing"]] == ["pulley_radius"]
    page = (out / "diagnosis.html").read_text()
    assert "pulley_radius" in page
    assert (out / "diagnosis.rrd").stat().st_size > 1000
    assert crosscheck("add", "pulley_radius", robot, data, "--model", model) == 0
    assert "pulley_radius" in model.read_text()
    monkeypatch.setattr("crosscheck.show.page.write_page", lambda _found, _path, _made: None)
    assert crosscheck("compare", robot, data, "--model", model, "--out", out, *limit) == 0
    further = (*FEW, "--model", model, "--no-recording")
    assert crosscheck("diagnose", robot, data, *further, "--out", out) == 0
    again = json.loads((out / "diagnosis.json").read_text())
    assert again["verdict"] == "no_effect_missing"
    assert again["missing"] == []
