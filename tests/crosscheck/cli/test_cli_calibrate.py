"""``crosscheck calibrate``: a model that predicts elsewhere, with the covariance of its values."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from called import refused, run
from made_data import SIGMA, case
from made_diagnoses import SLOW

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.prediction.model import Model, load_model
from seecr.workspace.edges import held_chance

HIDDEN = {
    "pulley_radius": {"radius_m": 0.006},
    "stiffness": {"factor": 1.2},
    "drum_gain": {f"gain_{i}": 2e-3 * (-1) ** i for i in range(1, 9)},
    "centre_of_mass": {"shift_x_m": 0.002, "shift_z_m": -0.003},
    "exit_point_error": {f"error_{i}_{a}_m": 5e-4 * (-1) ** i for i in range(1, 9) for a in "xz"},
}
# The other effects cost most of the time.
FEW = [word for name in SLOW for word in ("--exclude", name)]


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Five effects at once."""
    return case(tmp_path_factory.mktemp("many"), HIDDEN)


@pytest.mark.slow
@pytest.mark.usefixtures("unpaged")
def test_all_at_once_the_error_falls_to_the_noise_and_the_model_can_be_used(
    many: tuple[Path, Path], tmp_path: Path
) -> None:
    model = tmp_path / "model.toml"
    result = run("calibrate", *many, *FEW, "--model", model, "--out", tmp_path / "out", status=0)
    assert "on test runs" in result.stdout and f"Written to {model}" in result.stdout
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert set(found["made"]["sha256"]) == {"robot.xml", "measured.csv", "measured.toml"}
    assert found["settled"] and found["improves_held_out"]
    assert found["before"]["position_rms_m"] > 10 * SIGMA.position_m
    assert found["held_out"]["position_rms_m"] < 1.5 * SIGMA.position_m
    known = load_model(model, load_robot(many[0]))
    assert {"pulley_radius", "stiffness", "drum_gain"} <= set(known.names)
    radius = known.terms["pulley_radius"].vector[0], known.stderr["pulley_radius"][0]
    assert abs(radius[0] - 0.006) < 4 * radius[1] < 0.004
    again = run("compare", *many, "--model", model, "--no-recording", "--out", tmp_path / "cmp")
    assert again.exit_code == 0 and "the residuals are noise" in again.stdout
    the_covariance_is_there(model)
    how_likely_poses_are_held(load_robot(many[0]), known)
    # from its own model on there is nothing more to gain: nothing is lost either
    second = run("calibrate", *many, *FEW, "--model", model, "--force", "--json", status=0)
    assert json.loads(second.stdout)["held_out"]["position_rms_m"] < 1.5 * SIGMA.position_m
    assert model.read_text().count("[calibration]") == 1


def the_covariance_is_there(model: Path) -> None:
    table = tomllib.loads(model.read_text())["calibration"]
    rows, names = table["correlation"], table["parameters"]
    assert len(rows) == len(names) == len(set(names)) and "pulley_radius.radius_m" in names
    whole = np.array([row + [0.0] * (len(rows) - len(row)) for row in rows])
    whole = whole + whole.T - np.eye(len(rows))
    assert np.linalg.eigvalsh(whole).min() > -1e-4
    assert table["provenance"]["by"] == "crosscheck calibrate"
    assert table["after"]["position_rms_m"] < table["before"]["position_rms_m"]


def how_likely_poses_are_held(robot: Robot, model: Model) -> None:
    """Also where values, such as the frame's compliance, stand on their bounds."""
    assert np.any(model.terms.vector <= model.terms.lower + 1e-9)
    poses = np.tile(robot.reference_pose, (2, 1))
    poses[1, 0] += 9.0
    said = held_chance(robot, poses, model, lowest=0.02)
    assert said is not None and said[0] > 0.9 and said[1] == 0.0


@pytest.mark.slow
def test_where_nothing_is_gained_nothing_is_written(tmp_path: Path) -> None:
    files = case(tmp_path, {}, points=4)
    model = tmp_path / "model.toml"
    result = run("calibrate", *files, *FEW, "--model", model)
    assert result.exit_code == 1 and not model.exists()
    assert "The prediction of test runs does not improve: not written" in result.stdout
    forced = run("calibrate", *files, "--only", "platform_mass", "--model", model, "--force")
    assert forced.exit_code == 0 and model.exists()
    assert "does not improve\n" in forced.stdout and "not written" not in forced.stdout


def test_data_that_cannot_carry_it_are_refused(many: tuple[Path, Path], tmp_path: Path) -> None:
    robot, data = many
    few = tmp_path / "few.csv"
    few.write_text("\n".join(data.read_text().splitlines()[:1]) + "\n")
    message = refused("calibrate", robot, few, "--model", tmp_path / "m.toml")
    assert str(few) in message and "expected" in message
    missing = refused("calibrate", robot, tmp_path / "no.csv", "--model", tmp_path / "m.toml")
    assert "no.csv" in missing and not (tmp_path / "m.toml").exists()
