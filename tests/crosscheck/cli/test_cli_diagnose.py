"""``crosscheck diagnose`` from outside: what it exits with, and what it tells of the model."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import made_diagnoses as made
import numpy as np
import pytest
from made_data import case, run, term

from crosscheck.diagnosis import verdict as verdict_module
from crosscheck.diagnosis.verdict import diagnose
from crosscheck.fit.gauss_newton import FitStatus
from crosscheck.fit.reasons import DiagnosisVerdict, Unfit
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.mjcf import load_robot
from seecr.shipped import model_path


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A planar robot with pulleys that its model does not know."""
    data = tmp_path_factory.mktemp("planar") / "measured.csv"
    write_measurements(data, made.readings(radius_m=0.01))
    return model_path("planar_vertical"), data


def test_notes_of_the_model_are_told(planar: tuple[Path, Path], tmp_path: Path) -> None:
    """The model was made when the platform was lighter: its effects may count twice."""
    model = tmp_path / "model.toml"
    assert run("add", "pulley_radius", *planar, "--model", model).exit_code == 0
    text = model.read_text(encoding="utf-8")
    mass = load_robot(planar[0]).mass
    model.write_text(text.replace(f"mass_kg = {mass}", f"mass_kg = {0.9 * mass}"))
    assert model.read_text() != text
    result = run("diagnose", *planar, "--model", model, "--no-recording", "--out", tmp_path / "o")
    assert "its effects may count twice" in " ".join(result.stdout.split())
    document = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert any("its effects may count twice" in note for note in document["notes"])
    assert "may count twice" in (tmp_path / "o" / "diagnosis.html").read_text()


def test_want_of_data_ends_0_and_want_of_solutions_3(tmp_path: Path) -> None:
    xml, data = case(tmp_path, points=3)
    robot = load_robot(xml)
    rows = load_measurements(data, robot)
    still = tmp_path / "still.csv"
    write_measurements(still, rows.rows(np.zeros(12, dtype=int)))
    options = ("--no-recording", "--json", "--out", tmp_path / "out")
    result = run("diagnose", xml, still, *options)
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document["verdict"] == "no_verdict"
    assert document["sentence"] == (
        "No verdict: all commands are the same: nothing tells effects apart."
    )
    xml.write_text(re.sub(r'gravity="[^"]*"', 'gravity="0 0 0"', xml.read_text()))
    far = replace(rows, command_pose=None, command_lengths=np.full((rows.n_rows, 8), 2.0))
    write_measurements(still, far)
    result = run("diagnose", xml, still, *options)
    assert result.exit_code == 3
    assert "rows have no equilibrium" in json.loads(result.stdout)["sentence"]


def test_a_model_that_cannot_be_solved_gives_no_verdict_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The reason was once empty: "No verdict: ."."""
    real = verdict_module.null_fit

    def unsolved(*arguments: object, **options: object) -> object:
        return replace(real(*arguments, **options), status=FitStatus.UNSOLVED_AT_VALUES)

    monkeypatch.setattr(verdict_module, "null_fit", unsolved)
    robot = made.robot()
    found = diagnose(robot, made.readings(), [term(robot, "stiffness", factor=1.2)])
    assert found.verdict is DiagnosisVerdict.NO_VERDICT
    assert found.sentence == "No verdict: rows could not be solved with the model's values."
    assert found.refusal is not None and found.refusal.unfit is Unfit.UNSOLVED_MODEL
    assert not found.converged


def test_verdicts_are_the_words_of_the_file_with_a_heading_and_a_meaning() -> None:
    assert DiagnosisVerdict("effects_found") is DiagnosisVerdict.EFFECTS_FOUND
    assert [v.heading for v in DiagnosisVerdict] == [
        "No effect missing", "Effects found", "Many effects", "Unknown effect", "No verdict",
    ]  # fmt: skip
    assert all(v.meaning for v in DiagnosisVerdict)
    assert json.dumps(made.pulleys().as_json()["verdict"]) == '"effects_found"'
