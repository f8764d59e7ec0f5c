"""``crosscheck diagnose`` from outside: what it exits with, and what it tells of the model."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import made_diagnoses as made
import numpy as np
import pytest
from called import refused, run
from click.testing import Result
from made_data import case, term

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.fit.reasons import DiagnosisVerdict, Unfit
from crosscheck.fit.state import State
from crosscheck.inference.fit import Data
from crosscheck.measurements.read import load_measurements
from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.prediction.model import load_model
from seecr.prediction.uncertainty import covariance_of

pytestmark = pytest.mark.slow

Planar = tuple[Path, Path]


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> Planar:
    """A planar robot with pulleys that its model does not know."""
    data = tmp_path_factory.mktemp("planar") / "measured.csv"
    write_measurements(data, made.readings(radius_m=0.01))
    return model_path("planar_vertical"), data


def test_notes_of_the_model_are_told(planar: Planar, tmp_path: Path) -> None:
    """The model was made when the platform was lighter: its effects may count twice."""
    model = tmp_path / "model.toml"
    assert run("add", "pulley_radius", *planar, "--model", model).exit_code == 0
    text = model.read_text(encoding="utf-8")
    mass = load_robot(planar[0]).mass
    model.write_text(text.replace(f"mass_kg = {mass}", f"mass_kg = {0.9 * mass}"))
    assert model.read_text() != text
    few = ("--only", "stiffness,platform_mass", "--no-recording", "--out", tmp_path / "o")
    result = run("diagnose", *planar, "--model", model, *few)
    assert "its effects may be counted twice" in " ".join(result.stdout.split())
    document = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert any("its effects may be counted twice" in note for note in document["notes"])
    assert "may be counted twice" in (tmp_path / "o" / "diagnosis.html").read_text()


@pytest.mark.usefixtures("unpaged")
def test_want_of_data_ends_0_and_want_of_solutions_3(tmp_path: Path) -> None:
    xml, data = case(tmp_path, points=3)
    robot = load_robot(xml)
    rows = load_measurements(data, robot)
    still = tmp_path / "still.csv"
    write_measurements(still, rows.rows(np.zeros(12, dtype=int)))
    model, options = (
        tmp_path / "model.toml",
        ("--no-recording", "--json", "--out", tmp_path / "out"),
    )
    gate = ("--model-out", model, "--fail-on", "no_verdict")
    result = run("diagnose", xml, still, *options, *gate)
    assert result.exit_code == 1 and not model.exists()
    assert "not written: there is no verdict" in result.stderr
    result = run("diagnose", xml, still, *options, status=0)
    document = json.loads(result.stdout)
    assert document["verdict"] == "no_verdict"
    assert document["sentence"] == (
        "No verdict: all commands are the same, so effects cannot be told apart."
    )
    xml.write_text(re.sub(r'gravity="[^"]*"', 'gravity="0 0 0"', xml.read_text()))
    far = replace(rows, command_pose=None, command_lengths=np.full((rows.n_rows, 8), 2.0))
    write_measurements(still, far)
    result = run("diagnose", xml, still, *options, status=3)
    assert "the model has no equilibrium at " in json.loads(result.stdout)["sentence"]


def test_a_model_that_cannot_be_solved_gives_no_verdict_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The reason was once empty: "No verdict: ."."""
    real = Data.state

    def unsolved(data: Data, terms: Terms) -> State:
        return replace(real(data, terms), chi2=np.inf)

    monkeypatch.setattr(Data, "state", unsolved)
    robot = made.robot()
    found = diagnose(robot, made.readings(), [term(robot, "stiffness", factor=1.2)])
    assert found.verdict is DiagnosisVerdict.NO_VERDICT
    assert found.sentence == "No verdict: some rows could not be solved with the model's values."
    assert found.refusal is not None and found.refusal.unfit is Unfit.UNSOLVED_MODEL
    assert not found.converged


QUICK = ("--only", "pulley_radius,stiffness", "--no-recording")


@pytest.fixture
def quick(planar: Planar, tmp_path: Path) -> Callable[..., Result]:
    """A diagnosis of few effects."""
    return partial(run, "diagnose", *planar, *QUICK, "--out", tmp_path / "o")


@pytest.mark.usefixtures("unpaged")
def test_the_model_that_was_found_is_written_and_gates_end_1(
    quick: Callable[..., Result], planar: Planar, tmp_path: Path
) -> None:
    first, again = tmp_path / "found.toml", tmp_path / "again.toml"
    gate = ("--fail-on", "effects_found,unknown_effect")
    done = quick("--model-out", first, *gate)
    assert done.exit_code == 1 and f"Written to {first}: pulley_radius" in done.stdout
    robot = load_robot(planar[0])
    model = load_model(first, robot)
    assert model.terms["pulley_radius"].vector == pytest.approx([0.01], abs=2e-4)
    table = model.document["effect"][0]
    assert table["provenance"]["by"] == "crosscheck diagnose"
    assert table["before"]["position_rms_m"] > 5.0 * table["after"]["position_rms_m"]
    # so that it says how far its predictions may be off
    known = covariance_of(model)
    assert known is not None and known.shape == (1, 1)
    assert np.sqrt(known[0, 0]) == pytest.approx(model.stderr["pulley_radius"][0], rel=5e-3)
    # with it nothing is missing: the gate is open, and the model is written as it stands
    done = quick("--model", first, "--model-out", again, *gate)
    assert done.exit_code == 0 and "nothing added" in done.stdout
    assert again.read_text() == first.read_text()  # errors, too: nothing was fitted
    # and what has no model is plain SEECR
    done = quick("--exclude", "pulley_radius", "--model-out", again)
    assert done.exit_code == 0 and "nothing added" in done.stdout, done.output
    assert load_model(again, robot).names == ()


@pytest.mark.usefixtures("unpaged")
def test_a_model_that_agrees_only_with_other_values_is_written_with_these(
    quick: Callable[..., Result], planar: Planar, tmp_path: Path
) -> None:
    """Once it was written as it was, with "model and data agree", which they did not."""
    old, new = tmp_path / "old.toml", tmp_path / "new.toml"
    old.write_text('[[effect]]\nname = "pulley_radius"\nparameters.radius_m = 0.008\n')
    done = quick("--model", old, "--model-out", new)
    assert done.exit_code == 0 and done.stdout.count("no_effect_missing: ") == 1, done.output
    assert f"Written to {new}: pulley_radius, refitted to these data; nothing added" in done.stdout
    assert f"next: seecr correct {planar[0]} {planar[1]} --model {new}  #" in done.stdout
    model = load_model(new, load_robot(planar[0]))
    assert model.terms["pulley_radius"].vector == pytest.approx([0.01], abs=2e-4)
    assert model.document["effect"][0]["refitted"]["by"] == "crosscheck diagnose"
    # and where nothing is written, the next command does it
    done = quick("--model", old)
    assert f"add pulley_radius {planar[0]} {planar[1]} --model {old} --refit" in done.stdout


@pytest.mark.usefixtures("unpaged")
def test_all_that_a_diagnosis_lists_is_added_at_once(
    quick: Callable[..., Result], planar: Planar, tmp_path: Path
) -> None:
    found, model = tmp_path / "o" / "diagnosis.json", tmp_path / "model.toml"
    assert quick().exit_code == 0
    words = ("--all-from", found, *planar, "--model", model)
    run("add", *words, status=0)
    assert load_model(model, load_robot(planar[0])).names == ("pulley_radius",)
    other = ("add", "--all-from", found, model_path("demobot_cogiro"), *words[3:])
    said = refused(*other)
    assert "made for another robot: planar_vertical with 4 cables; demobot_cogiro has 8" in said
    listing = found.read_text().replace('"pulley_radius"', '"puley_radius"')
    for text, word in (
        ("{", "line 1: is not JSON"),
        (listing, "no effect 'puley_radius'; known, nearest first: pulley_radius"),
    ):
        found.write_text(text)
        said = refused("add", *words)
        assert f"{found}" in said and word in said
    said = refused("add", *words[:3], "--model", model)
    assert "expected ROBOT.xml DATA.csv with --all-from, got " in said
    said = refused("add", *planar, "--model", model)
    assert "expected EFFECT ROBOT.xml DATA.csv, got " in said


def test_gates_are_named(planar: Planar, tmp_path: Path) -> None:
    said = refused("diagnose", *planar, "--fail-on", "unkown_effect", "--out", tmp_path / "o")
    assert "no verdict 'unkown_effect'; expected one of, nearest first: unknown_effect, " in said
