"""Where a model may be written, and what it keeps of values that each file has of its own."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO

import crosscheck
import seecr
from crosscheck.model.fitted import Fitted, load_diagnosed
from crosscheck.model.write import check_place, kept, save_model, state_of, without_parts
from seecr.description.fingerprint import fingerprint
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Knowledge, Own, Term, Values, apart
from seecr.errors import InputFileError
from seecr.files import digits_of, json_text
from seecr.prediction.model import new_model


def test_a_new_file_and_an_older_model_may_be_written(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    check_place(path)
    assert not path.exists()
    path.write_text(new_model("demobot_cogiro").document.as_string())
    check_place(path)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("robot.xml", "<mujoco/>", "is not TOML: .* expected the name of a new file, or a model"),
        ("measured.csv", "run,cmd_x_m\na,0\n", "is not TOML: .* expected the name of a new file"),
        ("measured.toml", "[sigma]\nposition_m = 1e-4\n", "is not a model, it has sigma; expected"),
        ("empty.toml", "", "is empty; expected the name of a new file, or a model to be replaced"),
    ],
)
def test_other_files_are_refused_and_stay(tmp_path: Path, name: str, text: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputFileError, match=f"{name}: (line 1: )?{words}"):
        check_place(path)
    assert path.read_text() == text


def test_a_folder_and_a_file_inside_of_a_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path, words in ((tmp_path, "is a folder"), (tmp_path / "file" / "m.toml", "not a folder")):
        with pytest.raises(InputFileError, match=f"cannot be written: .*{words}"):
            check_place(path)


BASE = seecr.layout_of("pulley_radius", "demobot_cogiro")


def fitted(parts: dict[str, float], stderr: float, before: Own | None = None) -> Fitted:
    layout = apart(BASE, "file", tuple(parts), BASE.null)
    vector = np.array(list(parts.values()))
    term = Term(layout, vector, Knowledge.nothing(len(vector)), before)
    return Fitted(term, np.full(len(vector), stderr), np.zeros(len(vector), dtype=bool))


def test_another_file_may_differ_by_their_spread_and_their_errors() -> None:
    """4 and 10 mm: mean 7 mm, standard deviation 4.243 mm, beside errors of 3 mm."""
    found = kept(fitted({"monday": 0.004, "tuesday": 0.010}, 0.003), None)
    assert found.usual.term.vector == pytest.approx([0.007])
    assert found.usual.stderr == pytest.approx([np.hypot(0.006 / 2**0.5, 0.003)])
    assert list(found.parts) == ["monday", "tuesday"]
    assert found.parts["tuesday"].term.vector == [0.010]
    assert found.usual.term.own is not None and list(found.usual.term.own.values) == list(
        found.parts
    )


def test_of_one_file_another_may_differ_by_a_plausible_size() -> None:
    found = kept(fitted({"monday": 0.004}, 0.003), None)
    assert found.usual.term.vector == pytest.approx([0.004])
    assert found.usual.stderr == pytest.approx(BASE.scale)


def test_a_fixed_value_is_what_is_usual_whatever_the_files_have() -> None:
    fixed = Term(BASE, np.array([0.02])).fixed()
    found = kept(fitted({"monday": 0.004, "tuesday": 0.010}, 0.003), fixed)
    assert found.usual.term.vector == pytest.approx(BASE.null)


def test_an_effect_that_is_the_same_everywhere_stays_as_it_was_fitted() -> None:
    one = Fitted(Term(BASE, np.array([0.01])), np.array([0.001]), np.array([False]))
    assert kept(one, None).usual is one and kept(one, None).parts == {}
    both = [one, fitted({"monday": 0.004, "tuesday": 0.010}, 0.003)]
    same, covariance = without_parts(both, np.diag([1.0, 2.0, 3.0]))
    assert same == [one] and covariance.tolist() == [[1.0]]


# Commands that change one model at once lose nothing in silence


def test_a_model_that_was_changed_since_it_was_read_is_not_replaced(tmp_path: Path) -> None:
    robot, path = seecr.load_robot("planar_vertical"), tmp_path / "model.toml"
    before = state_of(path)
    assert before == ""
    model = seecr.new_model(robot)
    save_model(path, model, before)
    kept = path.read_text()
    with pytest.raises(seecr.InputFileError, match="was changed by another command since it was"):
        save_model(path, model, before)
    assert path.read_text() == kept and [*tmp_path.iterdir()] == [path]
    save_model(path, model, state_of(path))
    crosscheck.save_model(path, model)  # in Python it is the caller's choice


def test_of_many_at_once_one_is_kept_and_the_others_are_told(tmp_path: Path) -> None:
    robot, path = seecr.load_robot("planar_vertical"), tmp_path / "model.toml"
    model, lost = seecr.new_model(robot), []
    save_model(path, model)
    path.write_text(path.read_text() + "# before\n")
    start, state = threading.Barrier(8), state_of(path)

    def replace() -> None:
        start.wait()
        try:
            save_model(path, model, state)
        except seecr.InputFileError:
            lost.append(1)

    many = [threading.Thread(target=replace) for _ in range(8)]
    for one in many:
        one.start()
    for one in many:
        one.join()
    assert len(lost) == 7


# Effects are taken from the diagnosis of this robot only; what of its file changed is said

ROBOT = load_robot(COGIRO)

# It belongs to every robot: its name and parameters tell nothing.
PULLEYS = {"effect": "pulley_radius", "parameters": {"radius_m": {"value": 0.01}}}


def diagnosis(folder: Path, robot: Robot | None = ROBOT, source: Path | None = COGIRO) -> Path:
    """One that lists pulleys, of a robot and a file if these are given."""
    content: dict[str, Any] = {"verdict": "effects_found", "missing": [PULLEYS]}
    if robot is not None:
        content["robot"] = fingerprint(robot)
    if source is not None:
        content["made"] = {"sha256": {source.name: digits_of(source)}}
    path = folder / "diagnosis.json"
    path.write_text(json_text(content), encoding="utf-8")
    return path


def test_its_own_diagnosis_is_read_without_a_word(tmp_path: Path) -> None:
    terms, notes = load_diagnosed(diagnosis(tmp_path), ROBOT)
    assert terms["pulley_radius"].vector == pytest.approx([0.01]) and notes == ()
    assert load_diagnosed(diagnosis(tmp_path, robot=None), ROBOT)[1] == ()


@pytest.mark.parametrize(
    "other, words",
    [
        ("planar_vertical", "planar_vertical with 4 cables; demobot_cogiro has 8; use the robot"),
        ("demobot_parallel", "demobot_parallel, not demobot_cogiro: its exit point of cable"),
    ],
)
def test_that_of_another_robot_is_refused(tmp_path: Path, other: str, words: str) -> None:
    path = diagnosis(tmp_path, load_robot(other), model_path(other))
    with pytest.raises(InputFileError, match=f"^{path}: made for another robot: {words}"):
        load_diagnosed(path, ROBOT)


def test_a_value_beyond_all_sizes_is_refused(tmp_path: Path) -> None:
    path = diagnosis(tmp_path)
    path.write_text(path.read_text().replace('"value": 0.01', '"value": 1e3'))
    with pytest.raises(InputFileError, match=r"radius_m: 1000 is out of bounds; expected 0 to"):
        load_diagnosed(path, ROBOT)


def test_a_file_that_moved_and_was_edited_is_the_same_robot(tmp_path: Path) -> None:
    moved = tmp_path / "mine.xml"
    moved.write_bytes(COGIRO.read_bytes())
    robot = load_robot(moved)
    assert load_diagnosed(diagnosis(tmp_path), robot)[1] == ()
    moved.write_text(f"{COGIRO.read_text()}<!-- checked -->\n", encoding="utf-8")
    (note,) = load_diagnosed(diagnosis(tmp_path), robot)[1]
    assert "was made from a different text of" in note and "are the same" in note


def test_other_numbers_and_a_diagnosis_that_says_nothing_are_noted(tmp_path: Path) -> None:
    heavier = replace(ROBOT, mass=1.25 * ROBOT.mass, ea=np.array(ROBOT.ea))
    (note,) = load_diagnosed(diagnosis(tmp_path, heavier), ROBOT)[1]
    assert "mass_kg of robot demobot_cogiro was 0.5" in note
    assert note.endswith("the fit begins at what was found then")
    for path in (diagnosis(tmp_path, None, None), diagnosis(tmp_path, None, Path(__file__))):
        (note,) = load_diagnosed(path, ROBOT)[1]
        assert note == f"{path} does not say which robot it was made for"
    assert "robot" not in json.loads(path.read_text())


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("[" * 200_000, "nests too deeply"),
        ("1" * 5000, "has a whole number of thousands of digits"),
        ("1" * 400, "effect pulley_radius: expected a number for radius_m"),
        ("null", "effect pulley_radius: expected a number for radius_m; is it of another robot"),
    ],
)
def test_what_holds_no_numbers_is_refused(tmp_path: Path, value: str, words: str) -> None:
    path = diagnosis(tmp_path)
    path.write_text(path.read_text().replace('"value": 0.01', f'"value": {value}'))
    with pytest.raises(InputFileError, match=f"^{path}: {words}") as error:
        load_diagnosed(path, ROBOT)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        (["pulley_radius"], "an item of missing without effect and parameters"),
        ([{"effect": "pulley_radius"}], "an item of missing without effect and parameters"),
        ([PULLEYS, PULLEYS], "effect pulley_radius is among the terms twice"),
        ([], r"lists no missing effect \(effects_found\); there is nothing to add"),
        (None, "has no verdict and no list of missing effects"),
    ],
)
def test_what_lists_no_effects_is_refused(tmp_path: Path, missing: Any, words: str) -> None:
    path = diagnosis(tmp_path)
    content = json.loads(path.read_text()) | {"missing": missing}
    path.write_text(json.dumps(content))
    with pytest.raises(InputFileError, match=f"^{path}: {words}"):
        load_diagnosed(path, ROBOT)


def test_a_file_that_the_model_knows_without_its_folder_is_the_same_file() -> None:
    known = Values(np.array([0.002]), np.array([0.001]), Knowledge.nothing(1))
    found = kept(fitted({"days/monday": 0.004}, 0.003, Own("file", {"monday": known})), None)
    assert found.usual.term.own is not None
    assert list(found.usual.term.own.values) == ["monday"]
    assert found.usual.term.vector == pytest.approx([0.004])
