"""The twelve twins of the shared data, from the CSV alone; one of them by the command line.

They were made by a simulator that shares nothing with this project.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from made_data import run
from true_models import true_terms

from crosscheck.diagnosis.diagnose import diagnose
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.files import json_text

# In a sweep, since every run asks it of other data as well: an unknown effect (L09) and pulleys
# (L04) in test_unknown_effects.py, a centre of mass (L03) in README's diagnosis, and in
# laboratories of the same simulator nothing (L12, as L01) in B03, hysteresis (L06) in B06, a
# misplaced start (L05) and several at once (L10) in B10.
IN_SWEEP = ("L03", "L04", "L05", "L06", "L09", "L10", "L12")
CASES = [
    pytest.param(name, marks=[pytest.mark.sweep] if name in IN_SWEEP else [])
    for name in (f"L{k:02d}" for k in range(1, 13))
]
# The command writes a page with pictures as well, which takes half as long as the diagnosis.
BY_COMMAND = "L02"

pytestmark = pytest.mark.slow


@cache
def diagnosis_of(folder: Path) -> dict:
    if folder.name == BY_COMMAND:
        with TemporaryDirectory() as out:
            result = run("diagnose", *files_of(folder), "--out", out, "--no-recording")
            assert result.exit_code == 0, result.output
            return json.loads((Path(out) / "diagnosis.json").read_text())
    return json.loads(json_text(diagnose(*files_of(folder)).as_json()))


def files_of(folder: Path) -> tuple[Path, Path]:
    return folder / "robot.xml", folder / "measured.csv"


@pytest.mark.parametrize("case", CASES)
def test_twin(case: str, shared_data: Path) -> None:
    answer = json.loads((shared_data / "twins" / "answers.json").read_text())[case]
    found = diagnosis_of(shared_data / "twins" / case)
    named = [m["effect"] for m in found["missing"]]
    if answer["hidden"] == ["null"]:
        assert found["verdict"] == "no_effect_missing"
        assert named == []
        return
    if answer["hidden"][0].startswith("unknown_"):
        assert found["verdict"] == "unknown_effect"
        assert named == []
        return
    assert found["verdict"] == "effects_found"
    assert len(named) == len(answer["hidden"])
    for hidden in answer["hidden"]:
        assert any(hidden in (m["effect"], *m["indistinguishable"]) for m in found["missing"])
    check_held_out(found, answer)
    robot = load_robot(shared_data / "twins" / case / "robot.xml")
    check_values(found, answer, robot)


def check_held_out(found: dict, answer: dict) -> None:
    """After adding, the error on runs left out is the noise."""
    assert found["held_out"]["position_rms_m"] < 1.2 * answer["noise_pos_m"]
    assert found["held_out"]["orientation_rms_rad"] < 1.2 * answer["noise_rot_rad"]


def check_values(found: dict, answer: dict, robot: Robot) -> None:
    """Parameters are within four standard errors of the truth, all of them together."""
    got = {k: v for m in found["missing"] for k, v in m["parameters"].items()}
    for term in true_terms(answer["values"], robot):
        for key, number in zip(term.layout.names, term.vector, strict=True):
            assert abs(got[key]["value"] - number) < 4.0 * got[key]["stderr"], key


def test_what_moves_a_robot_alike_is_named_together(shared_data: Path) -> None:
    found = diagnosis_of(shared_data / "twins" / "L02")
    assert found["missing"][0]["indistinguishable"] == ["platform_mass"]
    advice = " ".join(found["measure_next"])
    assert "weigh the platform" in advice
    assert "tensions" in advice
