"""Effects are taken from the diagnosis of this robot only; what of its file changed is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO

from crosscheck.model import load_diagnosed
from seecr.description.fingerprint import fingerprint
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.files import digits_of, json_text

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
